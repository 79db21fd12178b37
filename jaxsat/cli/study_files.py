"""What a study leaves beside its store: figures, and single cases with their histories."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

from jaxsat.cli.computing import interruptibly
from jaxsat.cli.terminal import SUCCESS, UserMistake, console, output_problem

if TYPE_CHECKING:
    import xarray as xr

    from jaxsat.montecarlo import Study, Summary
    from jaxsat.scenario import Scenario


def write_figures(
    folder: Path, title: str, study: "Study", store: Path, summary: "Summary"
) -> None:
    """The figures of a study in its store, into a folder of their own."""
    import numpy as np

    from jaxsat.report.saving import save_figures
    from jaxsat.report.study_figures import fan_chart, study_figures
    from jaxsat.results import OutputError, OutputFolder, open_study

    def write() -> None:
        dataset = open_study(store)
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
        raise output_problem(error) from None


def write_one_case(
    scenario: "Scenario", study: "Study", number: int, target: Path, quiet: bool
) -> int:
    """One case again, as a folder like that of `jaxsat simulate`."""
    from jaxsat.report.figures import trajectory_figures
    from jaxsat.report.saving import save_figures
    from jaxsat.results import OutputError, OutputFolder, save_dataset

    try:
        with OutputFolder(target, overwrite=False) as folder:
            dataset, drawn = interruptibly(lambda: replayed(scenario, study, number))
            (folder.path / "scenario.toml").write_text(dataset.attrs["scenario"], encoding="utf-8")
            save_dataset(dataset, folder.path / "trajectory.nc")
            save_figures(trajectory_figures(dataset), folder.path)
    except OutputError as error:
        raise output_problem(error) from None
    except ValueError as error:
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
