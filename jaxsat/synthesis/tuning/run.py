"""Tuning a scenario in one call: descent, receipt, verdict, and the folder of all that."""

import json
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

from jaxsat.core.processors import processors
from jaxsat.report.document import Document
from jaxsat.report.markdown import markdown_page
from jaxsat.report.tuning_document import tuning_document
from jaxsat.scenario import Scenario, dump
from jaxsat.scenario.build.study import EngineName
from jaxsat.store.files import parse_json
from jaxsat.synthesis.tuning import (
    DescentProgress,
    DescentState,
    Receipt,
    TuningPlan,
    TuningVerdict,
    descend,
    initial_state,
    make_receipt,
    make_verdict,
)
from jaxsat.synthesis.tuning.baselines import (
    BaselineResult,
    as_data,
    missing_packages,
    run_baselines,
)
from jaxsat.synthesis.tuning.build import build_plan, tuned_scenario
from jaxsat.synthesis.tuning.checkpoint import TuningFolder, plan_identity
from jaxsat.synthesis.tuning.history import history_dataset

if TYPE_CHECKING:
    import xarray as xr
    from matplotlib.figure import Figure

TUNED, SUMMARY, BASELINES = "tuned.toml", "summary.md", "baselines.json"


@dataclass(frozen=True)
class TuningResult:
    """What tuning found: the scenario with the best gains, and whether to trust them.

    `receipt` tells whether the gradients were right, `verdict` how both scenarios do on cases that
    were never tuned on, `baselines` what other methods found. `plan.remark` says why an engine was
    not taken.
    """

    original: Scenario
    scenario: Scenario
    plan: TuningPlan
    state: DescentState
    receipt: Receipt
    verdict: TuningVerdict
    baselines: tuple[BaselineResult, ...] = ()

    @property
    def gains(self) -> dict[str, float]:
        """The best gains by the name of their key, each in its unit."""
        return dict(zip(self.verdict.labels, map(float, self.verdict.gains_after), strict=True))

    @property
    def history(self) -> "xr.Dataset":
        """Losses and gains of all steps, as in `history.nc`."""
        return history_dataset(self.plan, self.state, self.original.title, dump(self.original))

    @property
    def document(self) -> Document:
        """What `jaxsat tune` prints."""
        found = as_data(self.baselines)
        records = self.verdict.as_data(), self.receipt.as_data(), found
        return tuning_document(self.original.title, *records, missing_packages())

    @property
    def summary(self) -> str:
        """The same in Markdown."""
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
    report: Callable[[DescentProgress], None] | None = None,
) -> TuningResult:
    """Tune gains of a scenario over its dispersions, as its `[tuning]` table says.

    `engine`, `batch_size`, `workers` (None: as many as processors), `baselines` and `elsewhere`
    are the options of `jaxsat tune`. With `out` the run is kept in that folder, with the files
    that the command writes, and the same call resumes it. `report` is called after every step.
    Raises `ValueError` where the scenario cannot be tuned, `OutputError` for a folder that
    cannot be used, and `NoGradient` where no case of a step has a usable gradient.
    """
    plan = build_plan(
        scenario, engine=engine, batch_size=batch_size, workers=workers or processors()
    )
    if out is None:
        return conclude(scenario, plan, run_descent(scenario, plan, report=report), None, baselines)
    with TuningFolder(out, plan_identity(plan), elsewhere=elsewhere) as folder:
        state = run_descent(scenario, plan, folder, report=report)
        return conclude(scenario, plan, state, folder, baselines)


def run_descent(
    scenario: Scenario,
    plan: TuningPlan,
    folder: TuningFolder | None = None,
    *,
    report: Callable[[DescentProgress], None] | None = None,
) -> DescentState:
    """The last state; a folder keeps every state on the way, with the best gains so far."""
    if folder is None:
        return descend(plan, initial_state(plan), report=report)

    def keep(state: DescentState) -> None:
        best = tuned_scenario(scenario, plan, state.best_point)
        folder.keep(state)
        folder.write(TUNED, dump(best))

    state = folder.state(plan)
    keep(state)
    return descend(plan, state, keep=keep, report=report)


def conclude(
    scenario: Scenario,
    plan: TuningPlan,
    state: DescentState,
    folder: TuningFolder | None = None,
    baselines: bool = False,
    *,
    tell: Callable[[str], None] = lambda text: None,
    warn: Callable[[str], None] = lambda text: None,
) -> TuningResult:
    """Receipt, verdict and all files; the summary last, by which a run is known to be complete.

    `tell` is called with what is being done, `warn` if the gradients cannot be trusted.
    """
    tell("making the receipt")
    receipt = make_receipt(plan, state)
    _write_json(folder, "receipt.json", receipt.as_data())
    if receipt.problems:
        warn("the gradient is not trustworthy: " + "; ".join(receipt.problems))
    if receipt.first_masked:
        warn(f"runs without a usable gradient are left out: {receipt.first_masked}")
    tell("judging on held-out cases")
    verdict = make_verdict(plan, state.best_point)
    _write_json(folder, "verdict.json", verdict.as_data())
    found = ()
    if baselines:
        found = tuple(run_baselines(plan, state, lambda name: tell(f"baseline: {name}")))
        _write_json(folder, BASELINES, as_data(found))
    tuned = tuned_scenario(scenario, plan, state.best_point)
    result = TuningResult(scenario, tuned, plan, state, receipt, verdict, found)
    if folder is not None:
        _write_results(result, folder)
    return result


def is_concluded(folder: TuningFolder, baselines: bool = False) -> bool:
    """Whether a folder has all that `conclude` writes."""
    return folder.is_complete(SUMMARY) and (folder.is_complete(BASELINES) or not baselines)


def read_document(title: str, folder: TuningFolder) -> Document:
    """The document of a concluded run."""
    names = ("verdict.json", "receipt.json", BASELINES)
    verdict, receipt, baselines = (parse_json(folder.read(name)) for name in names)
    return tuning_document(title, verdict, receipt, baselines or (), missing_packages())


def _write_json(folder: TuningFolder | None, name: str, data: Any) -> None:
    if folder is not None:
        folder.write(name, json.dumps(data, indent=1, ensure_ascii=False) + "\n")


def _write_results(result: TuningResult, folder: TuningFolder) -> None:
    """The history, the summary, and the figures made of the history and of the verdict."""
    from jaxsat.report.saving import save_figures
    from jaxsat.store import dataset_bytes

    folder.write("history.nc", dataset_bytes(result.history))
    folder.write(SUMMARY, result.summary)
    save_figures(lambda: _figures(result), folder.write)


def _figures(result: TuningResult) -> "dict[str, Figure]":
    from jaxsat.report.tuning_figures import (
        baselines_figure,
        before_after_figure,
        gains_figure,
        loss_figure,
    )

    title, history = result.original.title, result.history
    columns = (result.verdict.before.columns, result.verdict.after.columns)
    figures = {
        "loss": loss_figure(history, f"{title}: loss"),
        "gains": gains_figure(history, f"{title}: gains"),
        "before-after": before_after_figure(*columns, f"{title}: held-out cases"),
    }
    if result.baselines:
        traces = {entry.method: entry.trace for entry in result.baselines}
        figures["baselines"] = baselines_figure(traces, f"{title}: other ways")
    return figures
