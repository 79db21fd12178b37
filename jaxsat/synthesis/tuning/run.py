"""Tuning of a scenario in one call: descent, receipt, verdict, and the folder of results."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jaxsat.core.once import once_property
from jaxsat.core.process import processors
from jaxsat.report.document import Document
from jaxsat.report.printers import markdown_page, notebook_text
from jaxsat.report.tuning_document import tuning_document
from jaxsat.scenario import Scenario, dump
from jaxsat.scenario.build.study import EngineName
from jaxsat.store.files import parse_json
from jaxsat.store.resumable import ResumableFolder
from jaxsat.studies.work import Work
from jaxsat.synthesis.execution import Listener, plain_data
from jaxsat.synthesis.tuning.baselines import (
    BaselineResult,
    missing_packages,
    run_baselines,
)
from jaxsat.synthesis.tuning.build import build_plan, tuned_scenario
from jaxsat.synthesis.tuning.checkpoint import (
    history_dataset,
    stored_state,
    tuning_folder,
    write_state,
)
from jaxsat.synthesis.tuning.descent import DescentProgress, DescentState, descend, initial_state
from jaxsat.synthesis.tuning.plan import TuningPlan
from jaxsat.synthesis.tuning.receipt import Receipt, make_receipt
from jaxsat.synthesis.tuning.verdict import TuningVerdict, make_verdict

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

TUNED, SUMMARY, BASELINES = "tuned.toml", "summary.md", "baselines.json"


CASE = 1000
"""Approximate bytes of a case in memory, and as much for each gain."""

FOLDER = 10**7
"""Approximate bytes of a folder, most of them figures."""


@dataclass(frozen=True)
class TuningResult:
    """Result of tuning: the scenario with the best gains, and its checks.

    `receipt` says whether the gradients were right, `verdict` how both scenarios do on cases that
    were never tuned on, `baselines` what other methods reach; they are computed on first access.
    `plan.remark` says why an engine was not used. `kept` is the document of an earlier complete run
    in the same folder, else None.
    """

    original: Scenario
    scenario: Scenario
    plan: TuningPlan
    state: DescentState
    with_baselines: bool = False
    listener: Listener = Listener()
    kept: Document | None = None

    _repr_markdown_ = notebook_text

    @once_property
    def receipt(self) -> Receipt:
        """Check of the gradients."""
        self.listener.progress("computing the receipt", None)
        return make_receipt(self.plan, self.state)

    @once_property
    def verdict(self) -> TuningVerdict:
        """Results of both scenarios on cases that were never tuned on."""
        self.listener.progress("evaluating held-out cases", None)
        return make_verdict(self.plan, self.state.best_point)

    @once_property
    def baselines(self) -> tuple[BaselineResult, ...]:
        """Results of other methods, empty unless requested."""
        if not self.with_baselines:
            return ()

        def report(name: str) -> None:
            self.listener.progress(f"baseline: {name}", None)

        return tuple(run_baselines(self.plan, self.state, report))

    @property
    def gains(self) -> dict[str, float]:
        """Best gains by the name of their key, each in its unit."""
        return dict(zip(self.verdict.labels, map(float, self.verdict.gains_after), strict=True))

    @property
    def history(self) -> "xr.Dataset":
        """Losses and gains of all steps, as in `history.nc`."""
        return history_dataset(self.plan, self.state, self.original.title, dump(self.original))

    @property
    def document(self) -> Document:
        """The document that `jaxsat tune` prints."""
        if self.kept is not None:
            return self.kept
        parts = self.verdict, self.receipt, self.baselines
        verdict, receipt, baselines = map(plain_data, parts)
        title = self.original.title
        return tuning_document(title, verdict, receipt, baselines, missing_packages())

    @property
    def summary(self) -> str:
        """The document that `jaxsat tune` prints, in Markdown."""
        return markdown_page(self.document)


def tune(
    scenario: Scenario,
    *,
    engine: EngineName = "auto",
    batch_size: int = 32,
    workers: int | None = None,
    baselines: bool = False,
    out: str | Path | None = None,
    elsewhere: bool = False,
    listener: Listener = Listener(),
) -> TuningResult:
    """Tune gains of a scenario over its dispersions by its `[tuning]` table.

    `engine`, `batch_size`, `workers` (None: as many as processors), `baselines` and `elsewhere` are
    the options of `jaxsat tune`. With `out` the run is kept in that folder, with the files of the
    command, and the same call resumes it. `listener.progress` is called after every step. Raises
    `ValueError` where the scenario cannot be tuned, `OutputError` for a folder that cannot be used,
    and `NoGradient` where no case of a step has a usable gradient.
    """
    listener.progress("compiling", None)
    plan = build_plan(
        scenario, engine=engine, batch_size=batch_size, workers=workers or processors()
    )
    if plan.remark is not None:
        listener.remark(plan.remark)
    listener.approve([tuning_work(plan, baselines)])
    if out is None:
        state = descend(plan, initial_state(plan), report=_descent_report(listener))
        return _conclude(scenario, plan, state, None, baselines, listener)
    with tuning_folder(out, plan, elsewhere=elsewhere) as folder:
        state = stored_state(folder, plan)
        if state is None and folder.is_begun:
            listener.warn(f"{out} has lost its state, so the run begins again")
        complete = folder.is_complete(SUMMARY) and (folder.is_complete(BASELINES) or not baselines)
        if state is not None and complete:
            document = read_document(scenario.title, folder)
            return _result(scenario, plan, state, baselines, listener, document)
        listener.progress("compiling; trying the starts", None)
        state = run_descent(scenario, plan, folder, report=_descent_report(listener))
        return _conclude(scenario, plan, state, folder, baselines, listener)


def tuning_work(plan: TuningPlan, baselines: bool) -> Work:
    """Estimate the work of descent and verdict; a gradient of n gains counts n + 1."""
    settings = plan.settings
    free = settings.descent.derivative_free
    gradients = (
        settings.steps * settings.starts * settings.cases * (1 if free else len(plan.start) + 1)
    )
    screening = 0 if free else settings.screened * len(settings.screening())
    checks = (
        (settings.steps // settings.validate_every + 2)
        * settings.starts
        * settings.validation_cases
    )
    descent = gradients + screening + checks
    if baselines:
        descent += 4 * (settings.baseline_trajectories or descent)
    trajectories = descent + 3 * settings.held_out_cases
    together = max(settings.cases, settings.validation_cases, settings.held_out_cases)
    memory = CASE * together * (len(plan.start) + 1)
    return Work(trajectories, trajectories * plan.intervals, memory, FOLDER)


def run_descent(
    scenario: Scenario,
    plan: TuningPlan,
    folder: ResumableFolder,
    *,
    report: Callable[[DescentProgress], None] | None = None,
) -> DescentState:
    """Run the descent to its last state; every state and its best gains are written."""

    def keep(state: DescentState) -> None:
        best = tuned_scenario(scenario, plan, state.best_point)
        write_state(folder, state)
        folder.write(TUNED, dump(best))

    state = stored_state(folder, plan)
    state = initial_state(plan) if state is None else state
    keep(state)
    return descend(plan, state, keep=keep, report=report)


def _conclude(
    scenario: Scenario,
    plan: TuningPlan,
    state: DescentState,
    folder: ResumableFolder | None,
    baselines: bool,
    listener: Listener,
) -> TuningResult:
    """Write receipt, verdict and all files; the summary last, which marks a complete run."""
    result = _result(scenario, plan, state, baselines, listener)
    receipt = result.receipt
    _write_json(folder, "receipt.json", receipt)
    if receipt.problems:
        listener.warn("the gradient is not trustworthy: " + "; ".join(receipt.problems))
    if receipt.first_masked:
        listener.warn(f"runs without a usable gradient are left out: {receipt.first_masked}")
    _write_json(folder, "verdict.json", result.verdict)
    if result.baselines:
        _write_json(folder, BASELINES, result.baselines)
    if folder is not None:
        _write_results(result, folder)
    return result


def _result(
    scenario: Scenario,
    plan: TuningPlan,
    state: DescentState,
    baselines: bool,
    listener: Listener,
    document: Document | None = None,
) -> TuningResult:
    best_scenario = tuned_scenario(scenario, plan, state.best_point)
    return TuningResult(scenario, best_scenario, plan, state, baselines, listener, document)


def _descent_report(listener: Listener) -> Callable[[DescentProgress], None]:
    return lambda progress: listener.progress("tuning", progress)


def read_document(title: str, folder: ResumableFolder) -> Document:
    """Return the document of a concluded run."""
    names = ("verdict.json", "receipt.json", BASELINES)
    verdict, receipt, baselines = (parse_json(folder.read(name)) for name in names)
    return tuning_document(title, verdict, receipt, baselines or (), missing_packages())


def _write_json(folder: ResumableFolder | None, name: str, result: Any) -> None:
    if folder is not None:
        folder.write(name, json.dumps(plain_data(result), indent=1, ensure_ascii=False) + "\n")


def _write_results(result: TuningResult, folder: ResumableFolder) -> None:
    from jaxsat.report.saving import save_figures
    from jaxsat.store.netcdf import dataset_bytes

    folder.write("history.nc", dataset_bytes(result.history))
    folder.write(SUMMARY, result.summary)
    save_figures(lambda: _figures(result), folder.write)


def _figures(result: TuningResult) -> "dict[str, Figure]":
    from jaxsat.report.figure_painter import paint, paint_grid
    from jaxsat.report.tuning_document import (
        before_after_plots,
        gain_plots,
        loss_plots,
        methods_plot,
    )

    title, history = result.original.title, result.history
    columns = (result.verdict.before.columns, result.verdict.after.columns)
    figures = {
        "loss": paint(loss_plots(history), f"{title}: loss"),
        "gains": paint(gain_plots(history), f"{title}: gains", 1.9),
        "before-after": paint(before_after_plots(*columns), f"{title}: held-out cases"),
    }
    if result.baselines:
        traces = {entry.method: entry.trace for entry in result.baselines}
        figures["baselines"] = paint_grid([[methods_plot(traces)]], f"{title}: other ways")
    return figures
