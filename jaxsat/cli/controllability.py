"""`jaxsat controllability`: can the remaining actuators still control the spacecraft?"""

import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from jaxsat.cli.computing import interruptibly, use_double_precision
from jaxsat.cli.loading import vehicle_or_explain
from jaxsat.cli.options import Digits, Flag, OptionalPath, Overrides, Report, number, whole
from jaxsat.cli.places import try_folder
from jaxsat.cli.progress import show_progress
from jaxsat.cli.report import finish_report, planned_report
from jaxsat.cli.terminal import SUCCESS, UserMistake, output_problem, print_stdout, show_table
from jaxsat.core.numerals import number_text

if TYPE_CHECKING:
    from collections.abc import Callable

    from matplotlib.figure import Figure

    from jaxsat.controllability import Analysis, FailureCase, Judgement
    from jaxsat.scenario import Scenario

    Drift = tuple[list[str], Callable[[], dict[str, Figure]]]

COLOURS = {
    "controllable": "green",
    "by drift": "cyan",
    "some attitudes": "yellow",
    "not decided": "yellow",
    "borderline": "yellow",
    "uncontrollable": "red",
}
TURN = "turn at 1 N m (s)"
MAP_STEPS = 450  # about 10⁵ bodies
MAP_ANGLES = (361, 181)
MAX_ACTUATORS = 8  # 256 cases; of more actuators, single and double failures are told


def controllability(
    scenario: str,
    /,
    *,
    overrides: Overrides = (),
    out: OptionalPath = None,
    report: Report = False,
    overwrite: Flag = False,
    digits: Digits = None,
    quiet: Flag = False,
    failures: Annotated[int | None, Parameter(converter=whole(0, 99))] = None,
    drift: Flag = False,
    tolerance: Annotated[float, Parameter(converter=number(0.0, 1.0, open_ends=True))] = 1e-6,
) -> int:
    """Say whether the spacecraft of a scenario can be steered, now and after every failure.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file. [spacecraft] is enough.
    overrides
        KEY=VALUE that replaces a value of the scenario, such as spacecraft.failed_thrusters=[2,3];
        may be given several times.
    out
        Folder for tables, maps and the page; by default nothing is written.
    report
        Also write a report, as `jaxsat report` does: report.html in the output folder, or the given
        file.
    overwrite
        Replace the folder, or the file of --report, if jaxsat wrote it.
    digits
        Significant digits of the numbers that are printed, at least; by default about four.
    quiet
        Print only warnings and errors.
    failures
        List only cases of so many failures; by default all.
    drift
        Also follow the drift: recurrence, and the energy claim (18). Takes a few seconds.
    tolerance
        Margins below this are called borderline; use the relative error of your inertia.
    """
    del digits  # `jaxsat.cli.app` sees to it
    chosen = vehicle_or_explain(scenario, overrides).scenario
    if report is not False and out is None:
        raise UserMistake("--report: must be given with --out, the folder of the results")
    planned = None if out is None else planned_report(report, out, overwrite=overwrite)
    if out is not None:
        from jaxsat.store import OutputFolder

        try_folder(lambda: OutputFolder(out, kind="controllability", overwrite=overwrite))
    use_double_precision()
    show_progress("deciding controllability")
    judgement, analysis, cases = interruptibly(lambda: _analyse(chosen, tolerance))
    from jaxsat.report.controllability_page import controllability_lines, survival_words

    torque = chosen.spacecraft.torque_limit_N_m or 1.0
    from jaxsat.controllability import judge_once_stopped

    stopped = judge_once_stopped(judgement, tolerance)
    lines = [survival_words(cases)]
    lines += controllability_lines(judgement, analysis, torque=torque, stopped=stopped)
    lines += interruptibly(lambda: _magnetic_lines(chosen))
    if len(cases[0].working) > MAX_ACTUATORS:
        lines.append(f"More than {MAX_ACTUATORS} actuators: only single and double failures")
    if chosen.disturbance.torques:
        names = ", ".join(chosen.disturbance.torques)
        lines.append(f"Disturbances not included: {names}.")
    show_progress("following the drift")
    found = interruptibly(lambda: _follow_drift(chosen)) if drift else ([], dict)
    if out is not None:
        show_progress("drawing maps")
        _write_folder(out, overwrite, chosen, judgement, cases, lines, found)
    if not quiet:
        _print(lines, cases, found[0], failures)
        if out is not None:
            print_stdout(f"written to {out}")
    finish_report(planned, quiet=quiet)
    return SUCCESS


def _analyse(
    scenario: "Scenario", tolerance: float
) -> "tuple[Judgement, Analysis | None, tuple[FailureCase, ...]]":
    """What the working actuators can do, the rank of their torques, and every failure."""
    from jaxsat.controllability import analyse, failure_table, judge
    from jaxsat.scenario.build.actuator_set import all_actuators
    from jaxsat.scenario.build.plant import orbit_rate

    inertia = scenario.spacecraft.inertia_kg_m2
    actuators, working = all_actuators(scenario)
    left = actuators.only(working)
    judgement, analysis = judge(inertia, left, tolerance=tolerance), None
    disturbance = scenario.disturbance.amplitude_N_m
    if judgement.decision is not None and not judgement.coasting:
        analysis = analyse(
            judgement.inertia if left.free_rotors.any() else inertia,
            left.columns,
            disturbance=disturbance if any(disturbance) else None,
            orbit_rate=orbit_rate(scenario),
            tolerance=tolerance,
            labels=left.names,
        )
    most = None if len(actuators.names) <= MAX_ACTUATORS else 2
    cases = failure_table(inertia, actuators, tolerance=tolerance, most_failed=most)
    return judgement, analysis, cases


def _magnetic_lines(scenario: "Scenario") -> list[str]:
    """What magnetorquers add to a verdict that leaves them out."""
    if not scenario.magnetorquer:
        return []
    import numpy as np

    from jaxsat.controllability import NoEquilibriumError, magnetic_authority, magnetic_words
    from jaxsat.scenario.build.actuator_set import all_actuators
    from jaxsat.scenario.build.plant import build_plant

    working = [place for place, one in enumerate(scenario.magnetorquer) if not one.failed]
    plant = build_plant(scenario)
    if not working or plant.magnetorquers is None or plant.field is None:
        return ["Magnetorquers: all have failed"]
    axes, limits = (
        np.asarray(x)[..., working]
        for x in (plant.magnetorquers.axes, plant.magnetorquers.dipole_limit)
    )
    actuators, others = all_actuators(scenario)
    left = actuators.only(others)
    sizes = np.linalg.norm(left.torques, axis=0) if scenario.thruster else np.zeros(0)
    try:
        found = magnetic_authority(scenario.spacecraft.inertia_kg_m2, axes, limits, plant.field)
    except NoEquilibriumError:
        return [
            "Magnetorquers: not analysed, and not part of the verdict and the table. The analysis "
            "linearises about rest in the orbit frame, which is no equilibrium of this body"
        ]
    return magnetic_words(found, sizes.max(initial=0.0), bool(left.wheels))


def _follow_drift(scenario: "Scenario") -> "Drift":
    """What simulation says of the drift: lines for a person, and what draws it."""
    import jax.numpy as jnp
    import numpy as np

    from jaxsat.controllability import (
        DriftField,
        energy_bound,
        energy_counterexample,
        pack,
        recurrence,
    )
    from jaxsat.scenario.build.plant import build_plant

    plant = build_plant(scenario)
    inertia, omega = plant.spacecraft.inertia, jnp.asarray(scenario.initial.omega_rad_s)
    table = scenario.disturbance
    amplitude, frequency = (
        jnp.asarray(table.amplitude_N_m),
        jnp.asarray(table.frequency_rad_s),
    )
    lines, drawn = [], {}
    if jnp.any(omega != 0):
        found = recurrence(
            DriftField(inertia), pack(jnp.eye(3), omega), radius=0.3, step=0.2, count=100_000
        )
        lines.append(
            f"Recurrence without disturbance: {len(found.returns)} returns to within 0.3 of the "
            f"start in {found.times[-1]:.0f} s. That almost every state returns is Poincaré's "
            "theorem; a simulation only shows it."
        )
        drawn["recurrence"] = (found.times, found.distances, found.radius)
    if jnp.any(amplitude * frequency != 0):
        found = energy_counterexample(inertia, amplitude, frequency)
        axis = int(np.argmax(np.abs(found.omega)))
        passed = found.times[np.argmax(found.energies > found.claimed)]
        lines.append(
            f"Claim (18), that the energy stays within C + Σa_i: from a spin of "
            f"{found.omega[axis]:g} rad/s about {'xyz'[axis]}, all phases zero, the energy has "
            f"grown by {found.gain:.3g} J after {found.times[-1]:.3g} s, where the claim allows "
            f"{found.claimed - found.energies[0]:.3g} J"
            + (f"; refuted (passed at {passed:.3g} s)" if found.excess > 0 else "; not refuted")
        )
        bound = energy_bound(inertia, found.energies[0], amplitude, jnp.asarray(found.times))
        drawn["energy"] = (found.times, found.energies, found.claimed, np.asarray(bound))

    def figures() -> "dict[str, Figure]":
        from jaxsat.report.controllability_figures import energy_chart, recurrence_chart

        charts = {"recurrence": recurrence_chart, "energy": energy_chart}
        return {name: charts[name](*given) for name, given in drawn.items()}

    return lines, figures


def _write_folder(
    out: Path,
    overwrite: bool,
    scenario: "Scenario",
    judgement: "Judgement",
    cases: "Sequence[FailureCase]",
    lines: list[str],
    drift: "Drift",
) -> None:
    from jaxsat.controllability import failure_csv, failure_markdown
    from jaxsat.report.controllability_page import controllability_page
    from jaxsat.report.failure_dataset import failure_dataset
    from jaxsat.report.saving import save_figures
    from jaxsat.scenario import dump
    from jaxsat.store import OutputError, OutputFolder, dataset_bytes

    def write(folder: OutputFolder) -> None:
        text = dump(scenario)
        title = f"Controllability: {scenario.title}"
        page = controllability_page(title, lines, failure_markdown(cases), drift[0])
        folder.write("scenario.toml", text)
        folder.write("controllability.md", page)
        folder.write("failures.csv", failure_csv(cases))
        dataset = failure_dataset(cases, judgement, title=title, scenario=text)
        folder.write("failures.nc", dataset_bytes(dataset))
        save_figures(lambda: {**_figures(judgement, cases), **drift[1]()}, folder.write)

    try:
        with OutputFolder(out, kind="controllability", overwrite=overwrite) as folder:
            interruptibly(lambda: write(folder))
    except OutputError as error:
        raise output_problem(error) from None


def _figures(judgement: "Judgement", cases: "Sequence[FailureCase]") -> "dict[str, Figure]":
    """Margins of every failure; torques that can be made, or margins of bodies and directions."""
    import numpy as np

    from jaxsat.controllability import (
        angle_grid,
        failure_records,
        margins_over_angles,
        margins_over_inertias,
        physical_inertias,
        uncontrollable_single_directions,
    )
    from jaxsat.report.controllability_figures import (
        angle_map,
        failure_chart,
        inertia_map,
        torque_map,
    )

    figures = {"failures": failure_chart(failure_records(cases))}
    inertia, axes = judgement.inertia, judgement.actuators.torques
    if judgement.one_signed or judgement.actuators.wheels:
        figures["torque-map"] = torque_map(judgement.cone, judgement.actuators)
        return figures
    if axes.shape[1] == 0:
        return figures
    moments = np.diag(inertia)
    physical = 2 * np.max(moments) <= np.sum(moments) * (1 + 1e-12)
    if np.array_equal(inertia, np.diag(moments)) and physical:
        points, moments = physical_inertias(MAP_STEPS)
        margins = np.asarray(margins_over_inertias(moments, axes))
        figures["inertia-map"] = inertia_map(
            points, margins, spacecraft=np.diag(inertia), title="Margin over all bodies"
        )
    azimuths, elevations = angle_grid(*MAP_ANGLES)
    others = axes[:, 1:]
    margins = np.asarray(margins_over_angles(inertia, azimuths, elevations, others))
    alone = others.shape[1] == 0
    figures["angle-map"] = angle_map(
        azimuths,
        elevations,
        margins,
        uncontrollable=uncontrollable_single_directions(inertia) if alone else (),
        title="Margin as the first working thruster turns" + ("" if alone else ", others fixed"),
    )
    return figures


def count_of(record: "Mapping[str, object]") -> int:
    """How many actuators have failed in a record of `failure_records`."""
    return 0 if record["failed"] == "none" else len(str(record["failed"]).split())


def _print(
    lines: list[str], cases: "Sequence[FailureCase]", drift: list[str], failures: int | None
) -> None:
    from rich.table import Table
    from rich.text import Text

    from jaxsat.controllability import failure_records

    for line in [*lines, *drift]:
        print_stdout(line.replace("**", ""))
    table = Table(pad_edge=False)
    numbers = ("rank", "margin", TURN)
    both = any(case.once_stopped for case in cases)
    records = [one for one in failure_records(cases) if failures in (None, count_of(one))]
    timed = any(math.isfinite(float(one["turn_time_s"])) for one in records)
    headings = ["failed", "rank", "verdict", "margin", *([TURN] if timed else []), "lost"]
    for heading in [*headings, *(["once stopped"] if both else [])]:
        table.add_column(heading, justify="right" if heading in numbers else "left")
    for record in records:
        verdict = Text(str(record["verdict"]), style=COLOURS[str(record["verdict"])])
        margin, turn = (number_text(float(record[name]), 3) for name in ("margin", "turn_time_s"))
        rank = "{rank}" if record["dimension"] == 6 else "{rank} of {dimension}"
        row = (Text(str(record["failed"])), rank.format(**record), verdict, margin)
        row = (*row, turn) if timed else row
        later = (str(record["once_stopped"]),) if both else ()
        table.add_row(*row, str(record["lost"]), *later)
    show_table(table)
