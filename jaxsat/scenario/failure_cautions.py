"""Cautions about failures in flight that change nothing, or that nothing tests."""

from collections.abc import Iterator
from typing import Any

from jaxsat.core.declaration.sensors import FAILING, OTHER_SENSORS, SENSORS
from jaxsat.scenario.derived import predicts_by_dynamics
from jaxsat.scenario.errors import Issue, Location
from jaxsat.scenario.parts.failures import BY_NAME, FailureTable
from jaxsat.scenario.parts.named import number_of
from jaxsat.scenario.wording import shown

LASTING = ("dead", "stopped", "locked")
"""Kinds after which an actuator is not expected to work again."""


def failure_cautions(scenario: Any) -> Iterator[Issue]:
    """Yield cautions about failures without effect, those that end a lasting one, and readings of
    a failed sensor that nothing tests."""
    yield from _after_the_end(scenario)
    yield from _untested(scenario)
    for number, one in enumerate(scenario.failure):
        if _failed_before(scenario, one):
            message = "should be an actuator that works at the start, else nothing more fails"
            yield Issue(("failure", number, "of"), f"{message}, got {shown(one.of)}")
    if _drawn(scenario, "failure_time_s") is None:
        yield from _working_again(scenario)


def _untested(scenario: Any) -> Iterator[Issue]:
    """Yield cautions about a filter that believes a sensor with false readings, and about one that
    integrates the rates of a gyro that fails."""
    estimator = scenario.estimator
    kind = "mekf" if estimator is None else estimator.kind
    if kind != "mekf":
        return
    failing = {one.of for one in scenario.failure}
    if "gyro" in failing and not predicts_by_dynamics(scenario):
        failing.discard("gyro")
        if not scenario.law.declaration.commands_actuators:
            message = (
                "should be given, so that the filter predicts rates by the dynamics and tests the "
                "gyro that fails, else it believes every rate, got nothing"
            )
            yield Issue(("estimator", "torque_noise_N_m_sqrt_Hz"), message, (), True)
    if getattr(estimator, "false_alarm_probability", None) is not None:
        return
    for one in scenario.failure:
        tested = one.of in failing and one.part in FAILING
        if tested and one.kind != "dead":
            message = (
                f"should be given, else the filter uses every reading of the failed {one.of}, got "
                "nothing"
            )
            yield Issue(("estimator", "false_alarm_probability"), message, (), True)
            return


def _after_the_end(scenario: Any) -> Iterator[Issue]:
    """Yield cautions about times at or after the end of the run; of drawn times the smallest."""
    begins: dict[str, dict[Location, float]] = {
        key: {
            ("failure", number, "at_s"): one.at_s
            for number, one in enumerate(scenario.failure)
            if one.of_sensor == of_sensor
        }
        for key, of_sensor in (("failure_time_s", False), ("sensor_failure_time_s", True))
    } | {
        f"{key.drawn}_s": _outage(scenario, one.name)
        for one in SENSORS
        for key in one.keys
        if key.name == "outage_start_s"
    }
    begins[OTHER_SENSORS] = {
        (OTHER_SENSORS, name, "outage_start_s"): table.outage_start_s
        for name, table in scenario.sensor.items()
        if table.outage_start_s is not None
    }
    begins["tachometer_outage_start_s"] = {
        ("wheel", number, "tachometer_outage_start_s"): one.tachometer_outage_start_s
        for number, one in enumerate(scenario.wheel)
        if one.tachometer_outage_start_s is not None
    }
    end = scenario.simulation.duration_s
    for key, times in begins.items():
        distribution = _drawn(scenario, key)
        earliest = times if distribution is None else _least(key, distribution)
        for location, time in earliest.items():
            if time >= end:
                message = f"should be before simulation.duration_s = {shown(end)}"
                yield Issue(location, f"{message}, else it never strikes, got {shown(time)}")


def _outage(scenario: Any, sensor: str) -> dict[Location, float]:
    start = getattr(getattr(scenario, sensor), "outage_start_s", None)
    return {} if start is None else {(sensor, "outage_start_s"): start}


def _drawn(scenario: Any, key: str) -> Any:
    return getattr(scenario.dispersion, key, None)


def _least(key: str, distribution: Any) -> dict[Location, float]:
    """Smallest value of a distribution, by the key that gives it; empty without one."""
    for name in ("low", "values"):
        bound = getattr(distribution, name)
        if bound is not None:
            return {("dispersion", key, name): _smallest(bound)}
    return {}


def _smallest(bound: Any) -> float:
    return min(map(_smallest, bound)) if isinstance(bound, tuple) else bound


def _failed_before(scenario: Any, one: FailureTable) -> bool:
    """Whether the failure changes nothing because the actuator has failed before the start."""
    actuator = BY_NAME.get(one.part)
    if actuator is None or one.kind not in [kind.text for kind in actuator.idle]:
        return False
    if one.part == "thruster" and not scenario.thruster:
        return one.of.partition(" ")[2] in map(str, scenario.spacecraft.failed_thrusters)
    tables = getattr(scenario, one.part)
    number = number_of(one.of, one.part, tables)
    return number is not None and tables[number].failed


def _working_again(scenario: Any) -> Iterator[Issue]:
    """Yield cautions about failures that replace a lasting one, of a dead or seized actuator."""
    last: dict[str, FailureTable] = {}
    for number, one in sorted(enumerate(scenario.failure), key=lambda entry: entry[1].at_s):
        before = last.get(one.of)
        if before is not None and before.kind in LASTING and one.kind not in LASTING:
            yield Issue(
                ("failure", number, "kind"),
                f'should be meant to replace "{before.kind}" at {shown(before.at_s)} s, after '
                f"which {one.of} works again in part, got {shown(one.kind)}",
            )
        last[one.of] = one
