"""`jaxsat montecarlo`: many dispersed copies of a scenario into a store, or one of them again."""

import os
import re
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

from cyclopts import Parameter

from jaxsat.cli.computing import interruptibly, use_double_precision
from jaxsat.cli.loading import load_or_explain
from jaxsat.cli.terminal import SUCCESS, UserMistake, console

if TYPE_CHECKING:
    import xarray as xr

    from jaxsat.montecarlo import StopRule, Study, StudyProgress, Summary
    from jaxsat.scenario import Scenario

SHOWN = 8
"""Lines of the sensitivity ranking that are printed."""


def montecarlo(
    scenario: str,
    /,
    *,
    count: Annotated[int, Parameter(name=["--count", "-n"])] = 1000,
    seed: int | None = None,
    out: Path | None = None,
    overrides: Annotated[tuple[str, ...], Parameter(name="--set", negative="")] = (),
    engine: Literal["auto", "scan", "diffrax"] = "auto",
    workers: int | None = None,
    width: int = 64,
    chunk: int = 256,
    until_ci: str | None = None,
    case: int | None = None,
    figures: Path | None = None,
    elsewhere: Annotated[bool, Parameter(negative="")] = False,
    quiet: Annotated[bool, Parameter(negative="")] = False,
) -> int:
    """Simulate many dispersed copies of a scenario, as its [dispersion] table says.

    A store that is there is gone on with if it holds the same study, so a run that was broken off
    is finished by the same command.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file.
    count
        Number of cases.
    seed
        Seed of the study; that of the scenario if left out.
    out
        Zarr store of the results, jaxsat-NAME.zarr if left out; with --case a folder for the one
        trajectory.
    overrides
        KEY=VALUE to put in place of what the scenario says, as for `jaxsat simulate`.
    engine
        scan, a plain loop of jaxsat's own, fastest; diffrax, the method of a single run; auto is
        scan for sampled and smooth loops and diffrax for laws with corners.
    workers
        Chunks computed at once, each in a thread; as many as processors if left out.
    width
        Cases that go through the compiled loop together; results may depend on it in their last
        bits.
    chunk
        Cases that are computed and written together.
    until_ci
        Stop once the settled fraction is known to within this, such as 0.5%.
    case
        Compute this case alone again and write its whole trajectory.
    figures
        Folder for figures: settling times, where it settles, convergence, fans of attitude and
        rates.
    elsewhere
        Go on with a store that was begun with other versions or on another processor.
    quiet
        Print nothing unless something is wrong.
    """
    chosen = load_or_explain(scenario, overrides)
    rule = None if until_ci is None else _stop_rule(until_ci)
    use_double_precision()
    try:
        from jaxsat.scenario.study import build_study

        study = build_study(chosen, count, seed=seed, engine=engine, width=width, chunk=chunk)
    except ValueError as error:
        raise UserMistake(str(error)) from None
    stem = Path(scenario).stem
    if case is not None:
        return _one_case(chosen, study, case, out or Path(f"jaxsat-{stem}-{case}"), quiet)
    target = out or Path(f"jaxsat-{stem}.zarr")
    counted = _run(study, target, workers or os.cpu_count() or 1, rule, elsewhere, quiet)

    from jaxsat.montecarlo import summarise
    from jaxsat.results import open_study

    dataset = open_study(target)
    summary = summarise(dataset, counted)
    if figures is not None:
        _write_figures(figures, chosen.title, study, dataset, summary)
    if not quiet:
        for line in summary_lines(summary):
            console().print(line)
        console().print(f"written          {target}{f' and {figures}' if figures else ''}")
    return SUCCESS


def summary_lines(summary: "Summary") -> list[str]:
    """What a study found, for a person."""
    settled = summary.settled
    lines = [
        f"cases            {summary.cases}: "
        + ", ".join(f"{number} {name}" for name, number in summary.outcomes.items()),
        f"settled          {settled.value:.2%} (95 % interval {settled.low:.2%} to "
        f"{settled.high:.2%})",
    ]
    for name, unit in (("settling_time", "s"), ("effort", "N m s")):
        parts = [
            f"{percent:g} %: {found.value:.4g} ({found.low:.4g} to {found.high:.4g})"
            for percent, found in getattr(summary, name).items()
        ]
        if parts:
            lines.append(f"{name.replace('_', ' '):<16} {', '.join(parts)} {unit}")
    lines.append(f"worst cases      {', '.join(map(str, summary.worst))} (see --case)")
    ranked = [entry for entry in summary.cost_sensitivity if entry.first_order > 0][:SHOWN]
    for label, entry in zip(["what the cost depends on"], [ranked], strict=True):
        shown = [f"{e.name} {e.first_order:.2f} ({e.rank_correlation:+.2f})" for e in entry]
        if shown:
            lines.append(f"{label}: {', '.join(shown)}, first-order index (rank correlation)")
    return lines


def _stop_rule(text: str) -> "StopRule":
    from jaxsat.montecarlo import StopRule

    match = re.fullmatch(r"([0-9.eE+-]+)\s*(%?)", text.strip())
    try:
        number = float(match.group(1)) if match else float("nan")
        return StopRule(number / 100 if match and match.group(2) else number)
    except ValueError:
        raise UserMistake(
            f"--until-ci: must be a half width such as 0.5% or 0.005, got {text}"
        ) from None


def _run(
    study: "Study",
    target: Path,
    workers: int,
    rule: "StopRule | None",
    elsewhere: bool,
    quiet: bool,
) -> int:
    from jaxsat.montecarlo import Serial, Threads, run_study
    from jaxsat.results import OutputError

    executor = Threads(workers) if workers > 1 else Serial()
    status = console(error=True).status(f"compiling; {study.count} cases to do")

    def report(progress: "StudyProgress") -> None:
        status.update(progress_text(progress))

    try:
        with status:
            return interruptibly(
                lambda: run_study(
                    study,
                    target,
                    executor=executor,
                    until=rule,
                    report=None if quiet else report,
                    elsewhere=elsewhere,
                )
            )
    except (OutputError, ValueError) as error:
        hint = " (--elsewhere)" if "allow that explicitly" in str(error) else ""
        raise UserMistake(f"{error}{hint}") from None
    except KeyboardInterrupt:
        kept = f"the chunks that are done are in {target}; the same command goes on from there"
        raise KeyboardInterrupt(kept) from None


def progress_text(progress: "StudyProgress") -> str:
    """One line on how far a study is."""
    left = progress.seconds_left
    return (
        f"{progress.done} of {progress.count} cases, {progress.rate:.1f} a second, "
        f"{left:.0f} s left, {progress.fraction_settled:.1%} settled"
    )


def _write_figures(
    folder: Path, title: str, study: "Study", dataset: "xr.Dataset", summary: "Summary"
) -> None:
    import numpy as np

    from jaxsat.report.saving import save_figures
    from jaxsat.report.study_figures import fan_chart, study_figures
    from jaxsat.results import OutputError, OutputFolder

    def write() -> None:
        count = summary.cases
        drawn = {}
        for name in study.copies.dispersions.names:
            values = np.asarray(dataset[f"drawn_{name}"])[:count]
            several = values.shape[1] > 1
            drawn |= {f"{name}[{i + 1}]" if several else name: x for i, x in enumerate(values.T)}
        ranked = [entry.name for entry in summary.settling_sensitivity]
        axes = (ranked[0], ranked[1]) if len(ranked) > 1 else None
        figures = study_figures(
            {"settling_time": np.asarray(dataset["settling_time"])[:count]}, drawn, axes, title
        )
        numbers = np.arange(min(count, study.engine.width))
        signals = study.engine.histories(study.program, study.cases(numbers), study.gains)
        times = np.arange(study.program.intervals + 1) * float(study.program.interval)
        attitude = np.concatenate([signals.w, signals.z[:, :, None]], axis=2)
        labels = ("w1", "w2", "z")
        figures["attitude-fan"] = fan_chart(times, attitude, labels, "1, rad", f"{title}: attitude")
        labels = ("ω1", "ω2", "ω3")
        omega = np.asarray(signals.omega)
        figures["rates-fan"] = fan_chart(times, omega, labels, "rad/s", f"{title}: rates")
        with OutputFolder(folder, overwrite=True) as made:
            save_figures(figures, made.path)

    try:
        interruptibly(write)
    except OutputError as error:
        raise UserMistake(str(error)) from None


def _one_case(scenario: "Scenario", study: "Study", number: int, target: Path, quiet: bool) -> int:
    from jaxsat.report.figures import trajectory_figures
    from jaxsat.report.saving import save_figures
    from jaxsat.results import OutputError, OutputFolder, save_dataset

    try:
        with OutputFolder(target, overwrite=False) as folder:
            dataset, drawn = interruptibly(lambda: replayed(scenario, study, number))
            (folder.path / "scenario.toml").write_text(dataset.attrs["scenario"], encoding="utf-8")
            save_dataset(dataset, folder.path / "trajectory.nc")
            save_figures(trajectory_figures(dataset), folder.path)
    except (OutputError, ValueError) as error:
        raise UserMistake(str(error)) from None
    if not quiet:
        console().print(f"case {number}: {dataset.attrs['outcome_explanation']}")
        for line in drawn:
            console().print(line)
        console().print(f"written to {target}")
    return SUCCESS


def replayed(
    scenario: "Scenario", study: "Study", number: int
) -> tuple["xr.Dataset", Sequence[str]]:
    """The trajectory of one case as a dataset, and what was drawn for it as lines."""
    import jax
    import jax.numpy as jnp

    from jaxsat.montecarlo import QUANTITIES
    from jaxsat.results import trajectory_dataset
    from jaxsat.scenario import dump
    from jaxsat.simulation import Trajectory

    replay = study.replay(number)
    steps = jnp.array(len(replay.times) - 1)
    signals = jax.tree.map(jnp.asarray, replay.signals)
    code = jnp.asarray(replay.outputs.code)
    trajectory = Trajectory(jnp.asarray(replay.times), signals, None, code, steps)
    dataset = trajectory_dataset(
        trajectory, title=scenario.title, scenario=dump(scenario), seed=study.design.seed
    )
    dataset.attrs["case"] = number
    lines = []
    for name, values in replay.outputs.drawn.items():
        dataset.attrs[f"drawn_{name}"] = [float(value) for value in values]
        shown = ", ".join(f"{float(value):.6g}" for value in values)
        lines.append(f"{name:<24} {shown} {QUANTITIES[name].unit.replace('1', '')}".rstrip())
    return dataset, lines
