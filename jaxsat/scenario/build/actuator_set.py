"""Control authority of the thrusters and wheels of a scenario, whatever its law."""

import re
from collections.abc import Sequence

import numpy as np
from jaxtyping import Float

from jaxsat.control.flyable_laws import FLYABLE
from jaxsat.controllability.actuators import (
    ActuatorSet,
    actuator_set,
    sum_of_momenta,
    thruster_torques,
)
from jaxsat.controllability.cone import ROUNDING
from jaxsat.controllability.gyros import GyroCluster
from jaxsat.controllability.judgement import Judgement
from jaxsat.controllability.judging import judge
from jaxsat.controllability.layout import TOLERANCE
from jaxsat.controllability.rods import RodSet, judge_with_rods
from jaxsat.controllability.wording import verdict_sentence
from jaxsat.core.declaration.actuators import ACTUATORS, STEERED
from jaxsat.core.declaration.gimbals import GIMBAL
from jaxsat.scenario.build.plant import build_effectors, field_of
from jaxsat.scenario.control import known_law
from jaxsat.scenario.parts.registry import suits
from jaxsat.scenario.parts.thrusters import ThrusterTable
from jaxsat.scenario.parts.wheels import lacks_torque
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.tables import working_axes
from jaxsat.spacecraft.gimbals import ControlMomentGyros
from jaxsat.spacecraft.spacecraft import Spacecraft

FAULT_TOLERANT = "fault-tolerant"
"""The law that finds failures in flight."""

UNCOUNTED = tuple(one for one in ACTUATORS if not one.judged and one is not GIMBAL)
"""Actuators that the verdicts on thrusters, wheels, magnetorquers and gyros do not count."""

APART = 1e-3
"""Singular value of unit torques above which their directions are distinct beyond doubt."""


def all_actuators(scenario: Scenario) -> tuple[ActuatorSet, list[int]]:
    """Return all actuators of a scenario, failed ones too, and the indices of the working ones.

    Tables [[thruster]] and [[wheel]], or thrusters of `spacecraft.thruster_torque_axes`, whose
    torques have both signs. Net forces are known if every thruster has a position. The momentum is
    that of body and all wheels at the start; a failed wheel coasts with its own.
    """
    wheels = scenario.wheel
    axes = np.array([one.axis for one in wheels], float).reshape(-1, 3).T
    axes = axes / np.linalg.norm(axes, axis=0)
    inertia = np.asarray(Spacecraft(scenario.spacecraft.inertia_kg_m2).inertia)
    omega = np.array(scenario.initial.omega_rad_s)
    relative = np.array([one.momentum_N_m_s for one in wheels], float)
    rotors = np.array([one.rotor_inertia_kg_m2 or 0.0 for one in wheels])
    torques, forces, signs, failed = _thrusters(scenario)
    names = [one.name for one in scenario.thruster] or [None] * len(failed)
    jets, wheel_names = _names(names, [one.name for one in wheels])
    actuators = actuator_set(
        torques,
        two_sided=signs,
        forces=forces,
        names=jets,
        wheel_axes=axes,
        wheel_names=wheel_names,
        stored=relative + rotors * (axes.T @ omega),
        rotors=rotors,
        momentum=sum_of_momenta(np.column_stack([inertia @ omega, axes * relative])),
        target_turns=scenario.orbit.rate() != 0,
    )
    failed = [*failed, *(one.failed for one in wheels)]
    return actuators, [place for place, gone in enumerate(failed) if not gone]


def all_rods(scenario: Scenario) -> tuple[RodSet | None, list[int]]:
    """Return all magnetorquers of a scenario, failed ones too, and the indices of the working ones.

    None without any. Names differ from those of the other actuators.
    """
    tables = scenario.magnetorquer
    if not tables:
        return None, []
    axes = np.array([one.axis for one in tables], float).T
    names, others = _words([one.name for one in tables], "m"), all_actuators(scenario)[0].names
    if len({*names, *others}) < len(names) + len(others):
        names = [f"{name}-m{number}" for number, name in enumerate(names, 1)]
    rods = RodSet(
        names=tuple(names),
        axes=axes / np.linalg.norm(axes, axis=0),
        limits=np.array([one.dipole_limit_A_m2 for one in tables], float),
        field=field_of(scenario.orbit),
        bias=0.0 if scenario.unloading is None else scenario.unloading.bias_N_m_s,
        gravity_gradient=scenario.disturbance.gravity_gradient,
    )
    return rods, [place for place, one in enumerate(tables) if not one.failed]


def judge_scenario(scenario: Scenario, *, tolerance: float | int = TOLERANCE) -> Judgement:
    """Judge the controllability by all actuators that work at the start.

    Control moment gyros are left out. `tolerance` as in `judge`.
    """
    actuators, working = all_actuators(scenario)
    inertia = scenario.spacecraft.inertia_kg_m2
    judgement = judge(inertia, actuators.only(working), tolerance=tolerance)
    rods, places = all_rods(scenario)
    return judgement if rods is None else judge_with_rods(judgement, rods, places, tolerance)


def gyro_cluster(scenario: Scenario) -> GyroCluster | None:
    """Return the control moment gyros of a scenario, failed ones too; None without any."""
    for gyros, state in build_effectors(scenario):
        if isinstance(gyros, ControlMomentGyros):
            return GyroCluster(
                gimbal_axes=np.asarray(gyros.gimbal_axes),
                spin_axes=np.asarray(gyros.spin_axes),
                momentum=np.asarray(state.momentum),
                rate_limit=np.asarray(gyros.rate_limit),
                angle=np.asarray(state.angle),
                turning=np.array([not one.failed for one in getattr(scenario, gyros.kind)]),
            )
    return None


def why_no_law(scenario: Scenario) -> str | None:
    """Return a sentence where no law of jaxsat applies to the actuators that work at the start;
    None where one does, or where actuators of a package may help."""
    if any(getattr(scenario, one.name) for one in UNCOUNTED):
        return None
    judgement, gyros = judge_scenario(scenario), gyro_cluster(scenario)
    if gyros is not None and gyros.torques == 3:
        return None
    words = law_words(scenario, judgement)
    if judgement.laws == "none":
        reason = verdict_sentence(judgement) if gyros is None else gyros.verdict()
        return f"{words} to the actuators left. {reason}"
    return None if words == FLYABLE[judgement.laws].words else words


def law_words(scenario: Scenario, judgement: Judgement) -> str:
    """Return which laws apply by a judgement of the scenario, as text.

    It is that of `FLYABLE`, unless no such law takes an actuator with a steering of its own, or
    wheels would have to complete the torques of ideal thrusters.
    """
    words, laws = FLYABLE[judgement.laws].words, map(known_law, _laws_left(scenario, judgement))
    declarations = [one.declaration for one in laws if one is not None]
    for actuator in ACTUATORS if declarations else ():
        refused = not any(suits(actuator, one) for one in declarations)
        if actuator.steering and getattr(scenario, actuator.name) and refused:
            return f"no law of jaxsat applies beside [[{actuator.name}]]; without it {words}"
    table = scenario.spacecraft
    rows = working_axes(table.thruster_torque_axes or (), table.failed_thrusters)
    alone = rows.size and scenario.wheel and not any(getattr(scenario, name) for name in STEERED)
    if alone and declarations and all(lacks_torque(scenario.wheel, rows, x) for x in declarations):
        tables = "with tables [[thruster]] in place of spacecraft.thruster_torque_axes"
        return (
            f"no law of jaxsat applies, as wheels do not complete ideal torques; {tables} {words}"
        )
    return words


def _laws_left(scenario: Scenario, judgement: Judgement) -> tuple[str, ...]:
    """Names in `FLYABLE`; laws that command each actuator do not suit ideal thrusters."""
    names = FLYABLE[judgement.laws].laws
    if scenario.spacecraft.thruster_torque_axes is None:
        return names
    return tuple(name for name in names if name != FAULT_TOLERANT)


def fitting_laws(scenario: Scenario, judgement: Judgement) -> list[str]:
    """Names of the laws of jaxsat for what a judgement of the scenario says is left.

    They are those of `FLYABLE`, after the one that finds failures of wheels and thrusters where
    some strike in flight.
    """
    strikes = any(not one.of_sensor for one in scenario.failure)
    finds_failures = strikes and (scenario.wheel or scenario.thruster)
    first = (FAULT_TOLERANT,) if finds_failures else ()
    return list(dict.fromkeys(first + _laws_left(scenario, judgement)))


def borderline_words(scenario: Scenario) -> str | None:
    """Caution if only round-off decides whether the remaining torques are two or three, else None.

    The verdict is that of `judge` on the actuators that work at the start; their directions are
    clearly distinct or clearly equal where the result is None.
    """
    actuators, working = all_actuators(scenario)
    healthy = actuators.only(working)
    columns = healthy.columns[:, np.any(healthy.columns, axis=0)]
    sines = np.linalg.svd(columns / np.linalg.norm(columns, axis=0), compute_uv=False)
    if not np.any((sines > ROUNDING) & (sines < APART)):
        return None
    judgement = judge_scenario(scenario)
    judgement = judgement if judgement.controllable else judgement.without_rods or judgement
    if judgement.verdict != "borderline":
        return None
    key = "thruster" if scenario.thruster else "spacecraft.thruster_torque_axes"
    return (
        f"key {'wheel' if scenario.wheel else key}: should have directions that are apart by more "
        f"than their last digits. {verdict_sentence(judgement)}"
    )


def _thrusters(
    scenario: Scenario,
) -> tuple[Float[np.ndarray, "3 m"], Float[np.ndarray, "3 m"] | None, list[bool], list[bool]]:
    """Torques (N m), forces (N) if all are known, two-sided flags, and failed flags."""
    tables, spacecraft = scenario.thruster, scenario.spacecraft
    if not tables:
        rows = spacecraft.thruster_torque_axes or ()
        failed = [number in spacecraft.failed_thrusters for number in range(1, len(rows) + 1)]
        # unnormalised, so that exact numbers stay exact
        return np.array(rows, float).reshape(-1, 3).T, None, [True] * len(rows), failed
    torques = np.array([_torque(one) for one in tables]).T
    forces = np.array([one.force() for one in tables]).T
    have_places = all(one.position_m is not None for one in tables)
    signs, failed = [one.two_sided for one in tables], [one.failed for one in tables]
    return torques, forces if have_places else None, signs, failed


def _torque(thruster: ThrusterTable) -> Float[np.ndarray, "3"]:
    """Torque at full thrust, N m; zero for a force through the centre of mass up to round-off."""
    if thruster.position_m is None:
        return thruster.torque()
    position = np.array(thruster.position_m)
    return thruster_torques(position[:, None], thruster.force()[:, None])[:, 0]


def _names(
    thrusters: Sequence[str | None], wheels: Sequence[str | None]
) -> tuple[list[str], list[str]]:
    """Names without spaces; g1, g2, … and w1, w2, … for unnamed thrusters and wheels."""
    jets, wheel_names = _words(thrusters, "g"), _words(wheels, "w")
    if len({*jets, *wheel_names}) < len(jets) + len(wheel_names):
        jets = [f"{name}-g{number}" for number, name in enumerate(jets, 1)]
        wheel_names = [f"{name}-w{number}" for number, name in enumerate(wheel_names, 1)]
    return jets, wheel_names


def _words(labels: Sequence[str | None], letter: str) -> list[str]:
    clean_labels = [name and re.sub(r"[^\w.+-]+", "-", name.strip()) for name in labels]
    return [name or f"{letter}{number}" for number, name in enumerate(clean_labels, 1)]
