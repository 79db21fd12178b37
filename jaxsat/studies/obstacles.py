"""Why a loop has no such quantity, as a clause; None where it has."""

from collections.abc import Callable
from typing import Any

from jaxsat.control.controller import AbstractBacksteppingLaw
from jaxsat.simulation.error_coordinates import ErrorCoordinateLoop
from jaxsat.simulation.loops import AbstractLoop, failures_of, parts_of
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.effector import AbstractEffector
from jaxsat.studies.part_changes import navigation_of, thrusters_of
from jaxsat.studies.perturbed import controller_of


def always(loop: AbstractLoop) -> None:
    """None: every loop has such a quantity."""


def needs_torque_level(loop: AbstractLoop) -> str | None:
    """The obstacle unless torques reach the plant through actuators."""
    if isinstance(loop, ErrorCoordinateLoop):
        return "a loop in error coordinates has ideal thrusters and the plant's own model"
    return None


def needs_model(kind: type) -> Callable[[AbstractLoop], str | None]:
    """Gives the obstacle unless the controller believes a model with such a part."""

    def obstacle(loop: AbstractLoop) -> str | None:
        if not parts_of(kind, controller_of(loop)):
            return "the controller has no model of the plant"
        return needs_torque_level(loop)

    return obstacle


def needs_sensor(place: str, what: str) -> Callable[[AbstractLoop], str | None]:
    """Gives the obstacle unless the loop is sampled with a sensor at this attribute."""

    def obstacle(loop: AbstractLoop) -> str | None:
        if not isinstance(loop, SampledLoop):
            return "only sampled loops have sensors"
        part: Any = loop
        for name in place.split("."):
            part = getattr(part, name, None)
        return None if part is not None else f"the loop has no {what}"

    return obstacle


def needs_navigation(loop: AbstractLoop) -> str | None:
    """The obstacle unless the loop has gyro and star tracker."""
    there = isinstance(loop, SampledLoop) and loop.navigation is not None
    return None if there else "the loop has no gyro and star tracker"


def needs_latency(loop: AbstractLoop) -> str | None:
    """The obstacle unless the loop has a star tracker with a latency."""
    obstacle = needs_navigation(loop)
    if obstacle is None and not navigation_of(loop).tracker.latency:
        return "the star tracker has no latency"
    return obstacle


def needs_delay(loop: AbstractLoop) -> str | None:
    """The obstacle unless the loop has a computing delay."""
    delayed = isinstance(loop, SampledLoop) and loop.delay is not None
    return None if delayed else "the loop has no delay"


def needs_reference(loop: AbstractLoop) -> str | None:
    """The obstacle unless the law has a reference rate of its own."""
    law = isinstance(controller_of(loop), AbstractBacksteppingLaw)
    return None if law else "the controller has no reference rate of its own"


def needs_thrusters(loop: AbstractLoop) -> str | None:
    """The obstacle unless the loop has one set of thrusters."""
    obstacle = needs_torque_level(loop)
    if obstacle is None and len(thrusters_of(loop)) != 1:
        return "the actuators are no thrusters"
    return obstacle


def needs_failures(part: str | None = None) -> Callable[[AbstractLoop], str | None]:
    """Gives the obstacle unless an actuator of the kind `part`, or any, fails in flight."""

    def obstacle(loop: AbstractLoop) -> str | None:
        if any(part in (None, one.part) for one in failures_of(loop)):
            return None
        which = "" if part is None else f" of a {part}"
        return f"the scenario has no failure{which} in flight"

    return obstacle


def needs_effector(kind: type[AbstractEffector]) -> Callable[[AbstractLoop], str | None]:
    """Gives the obstacle unless the spacecraft has an effector of this class."""

    def obstacle(loop: AbstractLoop) -> str | None:
        there = loop.plant.find(kind) is not None
        return None if there else f"the spacecraft has no {kind.kind}s"

    return obstacle


def needs_disturbance(kind: type, what: str) -> Callable[[AbstractLoop], str | None]:
    """Gives the obstacle unless the plant has one disturbance of this class."""

    def obstacle(loop: AbstractLoop) -> str | None:
        count = len(parts_of(kind, loop.plant.disturbance))
        return None if count == 1 else f"the plant has {what} {count} times, not once"

    return obstacle
