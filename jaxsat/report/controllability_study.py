"""Study of controllability, as a spacecraft is and after every failure: findings and figures."""

from collections.abc import Callable, Mapping, Sequence
from typing import TYPE_CHECKING, Any, NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxsat.controllability.drift import energy_bound, energy_counterexample, recurrence
from jaxsat.controllability.failures import FailureCase, failure_csv, failure_records, failure_table
from jaxsat.controllability.gyros import GyroCluster
from jaxsat.controllability.judgement import Judgement
from jaxsat.controllability.judging import judge_once_stopped
from jaxsat.controllability.lie import DriftField, pack
from jaxsat.controllability.maps import (
    angle_grid,
    margins_over_angles,
    margins_over_inertias,
    physical_inertias,
    uncontrollable_single_directions,
)
from jaxsat.controllability.rank import Analysis, analyse
from jaxsat.controllability.rods import judge_with_rods
from jaxsat.controllability.torque_ranges import stuck_on_words
from jaxsat.controllability.wording import verdict_sentence
from jaxsat.core.declaration.actuators import ACTUATORS, PASSIVE
from jaxsat.report.controllability_document import (
    controllability_document,
    controllability_lines,
    failure_dataset,
)
from jaxsat.report.document import Document
from jaxsat.report.printers import markdown_page
from jaxsat.report.rod_findings import magnetic_lines, stuck_rod_words
from jaxsat.report.saving import save_figures
from jaxsat.scenario import Scenario, dump
from jaxsat.scenario.build.actuator_set import (
    all_actuators,
    all_rods,
    gyro_cluster,
    judge_scenario,
    law_words,
)
from jaxsat.scenario.build.balance import held_with_momentum, undriven_balance
from jaxsat.scenario.build.plant import build_plant
from jaxsat.scenario.build.reached_torques import ReachedTorques, reached_torques
from jaxsat.store.folder import OutputFolder

if TYPE_CHECKING:
    from matplotlib.figure import Figure

MAP_STEPS = 300  # about 45,000 bodies, one for each two pixels of the figure
MAP_ANGLES = (241, 121)
MAX_ACTUATORS = 8  # 256 cases; beyond, only single and double failures are listed


class ControllabilityStudy(NamedTuple):
    """Controllability by the working actuators of a scenario, and after every failure.

    `lines` are the findings; `drift_lines` those of a simulation of the drift, if requested, and
    `drift_data` the data of its figures.
    """

    scenario: Scenario
    judgement: Judgement
    cases: tuple[FailureCase, ...]
    lines: list[str]
    drift_lines: list[str]
    drift_data: Mapping[str, tuple[Any, ...]]

    @property
    def findings(self) -> list[str]:
        """All findings."""
        return [*self.lines, *self.drift_lines]

    @property
    def verdict(self) -> str:
        """The verdict as a sentence, first that of actuators which the table does not count, last
        that without magnetorquers."""
        sentence, uncounted = verdict_sentence(self.judgement), _uncounted(self.scenario)
        without, lacking = self.judgement.without_rods, "magnetorquers"
        if uncounted is not None:
            first, without, lacking = uncounted.verdict(), self.judgement, "them"
            if isinstance(uncounted, GyroCluster) and not uncounted.turning.any():
                locked, lacking = "All gimbals are locked.", "the momentum of their rotors"
                first = locked if without.actuators.names or without.orbit else first
        elif without is not None:
            first, sentence = sentence, verdict_sentence(without)
        else:
            return sentence
        if not without.actuators.names and without.orbit is None:
            return first
        return f"{first} Without {lacking}: {sentence[0].lower()}{sentence[1:]}"

    def document(self, failures: int | None = None) -> Document:
        """Return the document of every failure, or of those of `failures` actuators."""
        title = f"Controllability: {self.scenario.title}"
        return controllability_document(
            title, self.verdict, failure_records(self.cases), self.findings, failures
        )

    def write(self, folder: OutputFolder) -> None:
        """Write tables, maps and the page; raises `OutputError`."""
        from jaxsat.store.netcdf import dataset_bytes  # takes its time

        text, cases, document = dump(self.scenario), self.cases, self.document()
        folder.write("scenario.toml", text)
        folder.write("controllability.md", markdown_page(document))
        folder.write("failures.csv", failure_csv(cases))
        dataset = failure_dataset(
            cases,
            self.judgement,
            title=document.title,
            scenario=text,
            verdict=self.verdict,
            findings=self.findings,
        )
        folder.write("failures.nc", dataset_bytes(dataset))
        save_figures(
            lambda: (
                _figures(self.scenario, self.judgement, cases) | _drift_figures(self.drift_data)
            ),
            folder.write,
        )


def controllability_study(
    scenario: Scenario,
    *,
    drift: bool = False,
    tolerance: float = 5e-6,
    report: Callable[[str], None] = lambda what: None,
) -> ControllabilityStudy:
    """Judge the controllability by the working actuators, and after every failure.

    Margins below `tolerance` are borderline. With `drift` a simulation follows the drift, which
    takes seconds. `report` receives progress.
    """
    report("deciding controllability")
    judgement, analysis, cases = _analyse(scenario, tolerance)
    torque = scenario.spacecraft.torque_limit_N_m or 1.0
    stopped = judge_once_stopped(judgement.without_rods or judgement, tolerance)
    rods, places = all_rods(scenario)
    if stopped is not None and rods is not None:
        stopped = judge_with_rods(stopped, rods, places, tolerance)
    uncounted, counts = _uncounted(scenario), bool(cases[0].working)
    lines = [] if uncounted is None else uncounted.lines()
    if counts or uncounted is None:
        lines += controllability_lines(
            judgement,
            analysis,
            torque=torque,
            stopped=stopped,
            magnetorquers=bool(places),
            laws=law_words(scenario, judgement),
        )
    stuck = stuck_on_words(scenario.spacecraft.inertia_kg_m2, judgement.actuators)
    of_rods = stuck_rod_words(scenario, judgement)
    lines += [one for one in (stuck, of_rods) if one is not None]
    balance = undriven_balance(scenario)
    lines += [] if balance is None else [" ".join(balance.lines())]
    holding = held_with_momentum(scenario, judgement)
    lines += [] if holding is None else [holding]
    lines += magnetic_lines(scenario)
    if len(cases[0].working) > MAX_ACTUATORS:
        lines.append(f"More than {MAX_ACTUATORS} actuators: only single and double failures")
    if passive := [f"{one.called}s" for one in PASSIVE if getattr(scenario, one.name)]:
        lines.append(f"Not included, as if locked to the body: {', '.join(passive)}.")
    if scenario.disturbance.torques:
        names = ", ".join(scenario.disturbance.torques)
        lines.append(f"Disturbances not included: {names}.")
    if drift:
        report("following the drift")
    drift_results = _follow_drift(scenario) if drift else ([], {})
    return ControllabilityStudy(scenario, judgement, cases, lines, *drift_results)


def _uncounted(scenario: Scenario) -> ReachedTorques | GyroCluster | None:
    """Return the torques of actuators that the judgement does not count; None without any."""
    return reached_torques(scenario) or gyro_cluster(scenario)


def _analyse(
    scenario: Scenario, tolerance: float
) -> tuple[Judgement, Analysis | None, tuple[FailureCase, ...]]:
    """Return the judgement, the rank of the torques, and every failure case."""
    inertia = scenario.spacecraft.inertia_kg_m2
    actuators, working = all_actuators(scenario)
    healthy = actuators.only(working)
    judgement, analysis = judge_scenario(scenario, tolerance=tolerance), None
    disturbance = scenario.disturbance.amplitude_N_m
    decided = judgement.decision is not None and not judgement.coasting
    if decided and (judgement.orbit is None or healthy.columns.any()):
        analysis = analyse(
            judgement.inertia if healthy.free_rotors.any() else inertia,
            healthy.columns,
            disturbance=disturbance if any(disturbance) else None,
            orbit_rate=scenario.orbit.rate(),
            tolerance=tolerance,
            labels=healthy.names,
        )
    rods, _ = all_rods(scenario)
    count = len(actuators.names) + (0 if rods is None else len(rods.names))
    cases = failure_table(
        inertia,
        actuators,
        tolerance=tolerance,
        most_failed=None if count <= MAX_ACTUATORS else 2,
        rods=rods,
    )
    return judgement, analysis, cases


def _follow_drift(scenario: Scenario) -> tuple[list[str], dict[str, tuple[Any, ...]]]:
    """Simulate the drift; return findings and the data of figures."""
    plant = build_plant(scenario)
    inertia, omega = plant.spacecraft.inertia, jnp.asarray(scenario.initial.omega_rad_s)
    table = scenario.disturbance
    amplitude, frequency = (jnp.asarray(table.amplitude_N_m), jnp.asarray(table.frequency_rad_s))
    lines: list[str] = []
    charts: dict[str, tuple[Any, ...]] = {}
    if jnp.any(omega != 0):
        motion = recurrence(
            DriftField(inertia), pack(jnp.eye(3), omega), radius=0.3, step=0.2, count=100_000
        )
        lines.append(
            f"Recurrence without disturbance: {len(motion.returns)} returns to within 0.3 of the "
            f"start in {motion.times[-1]:.0f} s. That almost every state returns is Poincaré's "
            "theorem; a simulation only shows it."
        )
        charts["recurrence"] = (motion.times, motion.distances, motion.radius)
    if jnp.any(amplitude * frequency != 0):
        motion = energy_counterexample(inertia, amplitude, frequency)
        axis = int(np.argmax(np.abs(motion.omega)))
        crossing_time = motion.times[np.argmax(motion.energies > motion.claimed)]
        lines.append(
            f"Claim (18), that the energy stays within C + Σa_i: from a spin of "
            f"{motion.omega[axis]:g} rad/s about {'xyz'[axis]}, all phases zero, the energy has "
            f"grown by {motion.gain:.3g} J after {motion.times[-1]:.3g} s, where the claim allows "
            f"{motion.claimed - motion.energies[0]:.3g} J"
            + (
                f"; refuted (passed at {crossing_time:.3g} s)"
                if motion.excess > 0
                else "; not refuted"
            )
        )
        bound = energy_bound(inertia, motion.energies[0], amplitude, jnp.asarray(motion.times))
        charts["energy"] = (motion.times, motion.energies, motion.claimed, np.asarray(bound))
    return lines, charts


def _drift_figures(chart_data: Mapping[str, tuple[Any, ...]]) -> "dict[str, Figure]":
    from jaxsat.report.controllability_figures import energy_chart, recurrence_chart

    charts = {"recurrence": recurrence_chart, "energy": energy_chart}
    return {name: charts[name](*data) for name, data in chart_data.items()}


def _figures(
    scenario: Scenario, judgement: Judgement, cases: Sequence[FailureCase]
) -> "dict[str, Figure]":
    """Return figures of margins of every failure, and of torques, or bodies and directions."""
    from jaxsat.report.controllability_figures import (
        angle_map,
        failure_chart,
        inertia_map,
        torque_map,
    )

    figures = {"failures": failure_chart(failure_records(cases))}
    inertia, axes = judgement.inertia, judgement.actuators.torques
    if judgement.one_signed or judgement.actuators.wheels:
        kinds = {one.called: getattr(scenario, one.name) for one in ACTUATORS if one.steering}
        steered = [
            f"{kind}s" for kind, tables in kinds.items() if not all(x.failed for x in tables)
        ]
        figures["torque-map"] = torque_map(judgement.cone, judgement.actuators, without=steered)
        return figures
    if axes.shape[1] == 0:
        return figures
    moments = np.diag(inertia)
    physical = 2 * np.max(moments) <= np.sum(moments) * (1 + 1e-12)
    if np.array_equal(inertia, np.diag(moments)) and physical:
        points, moments = physical_inertias(MAP_STEPS)
        margins = np.asarray(margins_over_inertias(moments, axes))
        figures["inertia-map"] = inertia_map(points, margins, spacecraft=np.diag(inertia))
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
