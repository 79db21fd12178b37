"""Findings on magnetorquers, in words: authority, law, and what one that is stuck leaves."""

from typing import final

import numpy as np

from jaxsat.control.magnetic import magnetic_motion
from jaxsat.controllability.judgement import Judgement
from jaxsat.controllability.layout import TOLERANCE
from jaxsat.controllability.magnetic import (
    MagneticAuthority,
    magnetic_authority,
    magnetic_law_words,
    magnetic_words,
)
from jaxsat.controllability.rods import RodSet, judge_with_rods
from jaxsat.controllability.torque_ranges import torque_reserve
from jaxsat.core.text import number_text
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.actuator_set import all_actuators, all_rods
from jaxsat.scenario.build.actuators import magnetic_context
from jaxsat.scenario.build.plant import build_plant
from jaxsat.scenario.build.run import build_start
from jaxsat.scenario.build.study import tolerances_of
from jaxsat.scenario.parts.wheels import inertia_of
from jaxsat.scenario.quantities import inertia_matrix
from jaxsat.simulation.loops import AbstractLoop
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.studies.momentum_left import Held
from jaxsat.studies.rods_left import LEAST_HOLD, RodsLeft, ThrustersLeft


@final
class _Uncommanded(AbstractLoop):
    """A plant without a law."""

    plant: RigidBody

    def start(self, state: PlantState) -> PlantState:
        """The plant's state with its effectors at rest."""
        return self.plant.complete(state)


def stuck_rod_words(scenario: Scenario, judgement: Judgement) -> str | None:
    """Return which magnetorquers the others oppose while one is stuck at its limit, by the
    `judgement` of all that work.

    With wheels about three axes these hold its momentum until the end of the scenario, as a study
    judges, but for an orbit at least, as a file of a vehicle alone has no end; else the others
    oppose it over an orbit. None where neither applies.
    """
    rods, places = all_rods(scenario)
    if rods is None or not places:
        return None
    plant = build_plant(scenario)
    start = build_start(scenario, plant.effectors)
    rate = abs(scenario.orbit.rate())
    duration = max(scenario.simulation.duration_s, np.ceil(2 * np.pi / rate) if rate else 0.0)
    hold = Held(_Uncommanded(plant), start, duration, tolerances_of(scenario), {})
    if judgement.laws == "three torques":
        words = _filling(scenario, judgement, rods, places, hold)
    elif judgement.laws == "magnetic":
        words = _opposing(scenario, judgement, rods, places, hold.angle)
    else:
        words = None
    return None if words is None else f"One magnetorquer stuck at its limit: {words}"


def _capacity(scenario: Scenario) -> np.ndarray:
    limits = [one.momentum_limit_N_m_s for one in scenario.wheel if not one.failed]
    return np.array([np.inf if limit is None else limit for limit in limits], float)


def _left(rods: RodSet, places: list[int], stuck: int, sign: float) -> RodsLeft:
    """With one that is stuck from the start."""
    count = np.arange(len(rods.names))
    fails = count == stuck
    dipoles, since = np.where(fails, sign * rods.limits, 0.0), np.where(fails, 0.0, np.inf)
    return RodsLeft(rods, np.isin(count, places) & ~fails, dipoles, rods.limits, since)


def _filling(
    scenario: Scenario, judgement: Judgement, rods: RodSet, places: list[int], hold: Held
) -> str | None:
    actuators = judgement.actuators
    low = np.where(actuators.two_sided, -1.0, 0.0)
    beside = ThrustersLeft(actuators.torques, low, np.ones_like(low))
    if not actuators.wheels or (low.size and torque_reserve(*beside) > 0):
        return None
    axes = actuators.wheel_axes / np.linalg.norm(actuators.wheel_axes, axis=0)
    capacity = _capacity(scenario)
    loads = {}
    for place in places:
        each = [_left(rods, places, place, sign) for sign in (1.0, -1.0)]
        loads[rods.names[place]] = max(one.load(axes, capacity, beside, hold) for one in each)
    full = [name for name, load in loads.items() if load > 1 - LEAST_HOLD]
    words = f"wheels hold {len(loads) - len(full)} of {len(loads)} for {hold.duration:g} s"
    return words + (f"; {', '.join(full)} would fill them" if full else "")


def _opposing(
    scenario: Scenario, judgement: Judgement, rods: RodSet, places: list[int], tolerance: float
) -> str:
    without, parts = judgement.without_rods or judgement, []
    for place in places:
        stuck = _left(rods, places, place, 1.0)
        later = judge_with_rods(without, rods, np.flatnonzero(stuck.healthy).tolist(), TOLERANCE)
        magnetic = later.laws == "magnetic"
        most = stuck.opposed(later, _capacity(scenario), tolerance) if magnetic else 0.0
        level = number_text(100 * min(most, 1.0), 2, scale=100.0)
        parts.append(f"{rods.names[place]} up to {level} %")
    return f"over an orbit the others oppose {', '.join(parts)} of it"


def _magnetic_authority(
    scenario: Scenario, rods: RodSet, places: list[int]
) -> MagneticAuthority | None:
    """The authority of the magnetorquers of these places about rest near the orbit frame; None
    where there is none."""
    inertia = inertia_matrix(scenario.spacecraft.inertia_kg_m2)
    rest = rods.rest(places, inertia, np.zeros(3), np.zeros((3, 0)))
    if rest is None:
        return None
    axes, limits = rods.axes[:, places], rods.limits[places]
    return magnetic_authority(inertia, axes, limits, rods.field, rest.to_body)


def magnetic_lines(scenario: Scenario) -> list[str]:
    """Return findings on the authority of the magnetorquers, and on their law where it flies."""
    rods, places = all_rods(scenario)
    if rods is None:
        return []
    if not places:
        return ["Magnetorquers: all have failed"]
    authority = _magnetic_authority(scenario, rods, places)
    if authority is None:
        return [
            "Magnetorquers: not analysed. The analysis linearises about rest, and no attitude near "
            "the orbit frame is an equilibrium of this body, or one that they hold"
        ]
    actuators, others = all_actuators(scenario)
    healthy = actuators.only(others)
    sizes = np.linalg.norm(healthy.torques, axis=0) if scenario.thruster else np.zeros(0)
    words = magnetic_words(authority, sizes.max(initial=0.0), bool(healthy.wheels))
    return [*words, *_magnetic_law(scenario)]


def _magnetic_law(scenario: Scenario) -> list[str]:
    """Describe the law of magnetorquers for small errors, where it flies."""
    context = magnetic_context(scenario)
    if scenario.control.law != "magnetic" or context is None:
        return []
    motion = magnetic_motion(
        inertia_of(scenario),
        context,
        scenario.disturbance.gravity_gradient,
    )
    control = scenario.control
    return [magnetic_law_words(motion, control.control_weight, control.wheel_weight)]
