"""`jaxsat tune`: better gains by gradient descent through the simulator, and the proof."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Literal

from jaxsat.cli.computing import interruptibly, use_double_precision
from jaxsat.cli.loading import load_or_explain
from jaxsat.cli.options import Flag, OptionalPlace, Overrides, Together, Workers
from jaxsat.cli.progress import tell
from jaxsat.cli.terminal import (
    SUCCESS,
    Terminated,
    UserMistake,
    output_problem,
    report,
    say,
    say_text,
)
from jaxsat.cli.work import approve
from jaxsat.processors import processors

if TYPE_CHECKING:
    from jaxsat.montecarlo import Work
    from jaxsat.scenario import Scenario
    from jaxsat.tuning import DescentState, Report, TuningPlan
    from jaxsat.tuning.checkpoint import TuningFolder

CASE = 1000
"""Bytes of a case in memory, and as much for each gain, about."""

FOLDER = 10**7
"""Bytes of a folder, most of them figures, about."""

TUNED, SUMMARY = "tuned.toml", "summary.md"


def tune(
    scenario: str,
    /,
    *,
    out: OptionalPlace = None,
    overrides: Overrides = (),
    engine: Literal["auto", "native", "scan", "diffrax"] = "auto",
    workers: Workers = None,
    width: Together = 32,
    baselines: Flag = False,
    yes: Flag = False,
    elsewhere: Flag = False,
    quiet: Flag = False,
) -> int:
    """Tune gains of a scenario's control law over its dispersions, as its [tuning] table says.

    The folder gets tuned.toml, ready to run, a summary that begins with whether the gradients can
    be trusted, the verdict on cases that were never tuned on, the history and figures. A run that
    was broken off goes on by the same command and ends as if it had not been.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file, with [dispersion] and [tuning] tables.
    out
        Folder to write to; jaxsat-NAME-tuned in the current folder if left out.
    overrides
        KEY=VALUE to put in place of what the scenario says, such as tuning.steps=20; may be given
        several times.
    engine
        native, machine code made for the program; scan, a plain loop under XLA; diffrax, the
        method of a single run; auto is native where that can be, else scan.
    workers
        Threads that share a batch out; as many as processors if left out.
    width
        Cases that go through the compiled loop together.
    baselines
        Afterwards spend as many trajectories, or what [tuning] says, on Nelder-Mead, random
        search, CMA-ES and BFGS.
    yes
        Begin even what takes more steps, memory or disk than jaxsat does unasked.
    elsewhere
        Go on with a run that was begun with other versions or on another processor, if the
        program is the same.
    quiet
        Print nothing unless something is wrong.
    """
    chosen = load_or_explain(scenario, overrides, "study")
    use_double_precision()
    target = Path(f"jaxsat-{Path(scenario).stem}-tuned") if out is None else out

    from jaxsat.assembly.tuning import build_plan
    from jaxsat.results import OutputError
    from jaxsat.tuning.checkpoint import TuningFolder, plan_identity

    try:
        tell("compiling")
        plan = interruptibly(
            lambda: build_plan(chosen, engine=engine, width=width, workers=workers or processors())
        )
        if plan.remark is not None and not quiet:
            report(plan.remark, "")
        approve([_work(plan, baselines)], target, yes=yes, quiet=quiet)
        with TuningFolder(target, plan_identity(plan), elsewhere=elsewhere) as folder:
            done = folder.is_whole(SUMMARY) and (folder.is_whole("baselines.json") or not baselines)
            if folder.lost_state and not quiet:
                report(f"{target} has lost its state, so the run begins again", "warning: ")
            if not done:
                state = _descended(plan, chosen, folder)
                _concluded(plan, chosen, folder, state, baselines, quiet)
            if not quiet:
                say_text((folder.read(SUMMARY) or b"").decode())
                say("")
                say(f"{'already ' if done else ''}written to {target}")
    except OutputError as error:
        raise output_problem(error, "--elsewhere") from None
    except ValueError as error:
        raise UserMistake(str(error)) from None
    return SUCCESS


def _work(plan: "TuningPlan", baselines: bool) -> "Work":
    """What the descent and the verdict take, about; a gradient of n gains counts n + 1."""
    from jaxsat.montecarlo import Work

    told = plan.settings
    gradients = told.steps * told.starts * told.cases * (len(plan.start) + 1)
    screened = told.screened * len(told.screening())
    checks = (told.steps // told.validate_every + 2) * told.starts * told.validation_cases
    descent = gradients + screened + checks
    if baselines:
        descent += 4 * (told.baseline_trajectories or descent)
    trajectories = descent + 3 * told.held_out_cases
    together = max(told.cases, told.validation_cases, told.held_out_cases)
    memory = CASE * together * (len(plan.start) + 1)
    return Work(trajectories, trajectories * plan.intervals, memory, FOLDER)


def _descended(plan: "TuningPlan", scenario: "Scenario", folder: "TuningFolder") -> "DescentState":
    """The last state; every state on the way is kept, with the best gains so far."""
    from jaxsat.assembly.tuning import tuned_scenario
    from jaxsat.scenario import dump
    from jaxsat.tuning import descend

    tell("compiling; trying the starts")
    kept = {"step": 0}

    def keep(state: "DescentState") -> None:
        best = tuned_scenario(scenario, plan, state.best_point)
        folder.keep(state)
        folder.write(TUNED, dump(best))
        kept["step"] = state.step

    def work() -> "DescentState":
        state = folder.state(plan)
        keep(state)
        return descend(plan, state, keep=keep, report=told)

    def told(progress: "Report") -> None:
        tell(progress_text(progress))

    try:
        return interruptibly(work)
    except (KeyboardInterrupt, Terminated) as stop:
        best = f"the best gains so far are in {folder.path / TUNED}" if kept["step"] else "no step"
        text = f"{best}, after {kept['step']} steps; the same command goes on from there"
        raise type(stop)(text) from None


def progress_text(progress: "Report") -> str:
    """One line on how far a run is."""
    several = f", {progress.starts} starts" if progress.starts > 1 else ""
    return (
        f"step {progress.step} of {progress.steps}{several}: loss {progress.loss:.4g}, gradient "
        f"{progress.gradient_norm:.3g}, {progress.settled:.0%} settled; best on validation "
        f"{progress.best_loss:.4g}"
    )


def _concluded(
    plan: "TuningPlan",
    scenario: "Scenario",
    folder: "TuningFolder",
    state: "DescentState",
    baselines: bool,
    quiet: bool,
) -> None:
    """Receipt, verdict and all files; the summary last, by which a run is known to be complete."""
    from jaxsat.tuning import make_receipt, make_verdict
    from jaxsat.tuning.baselines import as_data, run_baselines
    from jaxsat.tuning.summary import summary_page

    def work() -> None:
        receipt = make_receipt(plan, state)
        _write_json(folder, "receipt.json", receipt.as_data())
        if receipt.problems and not quiet:
            report("the gradient is not trustworthy: " + "; ".join(receipt.problems), "warning: ")
        tell("judging on held-out cases")
        verdict = make_verdict(plan, state.best_point)
        _write_json(folder, "verdict.json", verdict.as_data())
        found = ()
        if baselines:
            found = run_baselines(plan, state, lambda name: tell(f"baseline: {name}"))
            _write_json(folder, "baselines.json", as_data(found))
        _write_figures(plan, scenario, folder, state, verdict, found)
        folder.write(SUMMARY, summary_page(scenario.title, receipt, verdict, found))

    tell("checking the gradients")
    try:
        interruptibly(work)
    except (KeyboardInterrupt, Terminated) as stop:
        text = f"the tuned gains are in {folder.path / TUNED}; the same command goes on from there"
        raise type(stop)(text) from None


def _write_json(folder: "TuningFolder", name: str, data: object) -> None:
    folder.write(name, json.dumps(data, indent=1, ensure_ascii=False) + "\n")


def _write_figures(
    plan: "TuningPlan",
    scenario: "Scenario",
    folder: "TuningFolder",
    state: "DescentState",
    verdict,
    found: Sequence,
) -> None:
    """The history, and the figures made of it and of the verdict."""
    from jaxsat.report.saving import save_figures
    from jaxsat.report.tuning_figures import (
        baselines_figure,
        before_after_figure,
        gains_figure,
        loss_figure,
    )
    from jaxsat.results import dataset_bytes
    from jaxsat.scenario import dump
    from jaxsat.tuning.history import history_dataset

    title = scenario.title
    history = history_dataset(plan, state, title, dump(scenario))
    columns = (verdict.before.columns, verdict.after.columns)
    figures = {
        "loss": loss_figure(history, f"{title}: loss"),
        "gains": gains_figure(history, f"{title}: gains"),
        "before-after": before_after_figure(*columns, f"{title}: held-out cases"),
    }
    if found:
        traces = {entry.method: entry.trace for entry in found}
        figures["baselines"] = baselines_figure(traces, f"{title}: other ways")
    folder.write("history.nc", dataset_bytes(history))
    save_figures(figures, folder.write)
