"""`[[failure]]`: failures in flight of actuators and sensors, and cautions about them."""

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any, Literal

from pydantic import field_validator

from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.declaration.sensor import TACHOMETER, TachometerFailureKind
from jaxsat.core.declaration.sensors import FAILING, GYRO, OTHER_SENSORS, SENSORS
from jaxsat.core.declaration.thrusters import IDEAL_KINDS
from jaxsat.core.errors import ArgumentError
from jaxsat.core.text import suggestion
from jaxsat.scenario.derived import predicts_by_dynamics
from jaxsat.scenario.errors import Issue, Location
from jaxsat.scenario.parts.named import names_of, number_of
from jaxsat.scenario.parts.sensors import given_sensors
from jaxsat.scenario.quantities import (
    Line,
    ScenarioTable,
    Time,
    choice,
    fields_of,
    quantity,
    table_with,
)
from jaxsat.scenario.rules import STEPS, at, key_of_fixed_steps, rule, rule_over
from jaxsat.scenario.wording import shown

_IDEAL = "thruster of thruster_torque_axes"
_BY_NAME = {one.name: one for one in ACTUATORS}
_TABLES = tuple(_BY_NAME)
_OF_SENSORS = FAILING | {TACHOMETER: tuple(TachometerFailureKind)}
_KINDS = {one.name: one.kinds for one in ACTUATORS} | {_IDEAL: IDEAL_KINDS} | _OF_SENSORS
_WORDS = {
    name: ", ".join(f'"{kind.text}" ({kind.meaning})' for kind in kinds)
    for name, kinds in _KINDS.items()
}
_KINDS_IN_WORDS = ". ".join(
    f"Of a {' or '.join(name for name, other in _WORDS.items() if other == words)}: {words}"
    for words in dict.fromkeys(_WORDS.values())
)

_NAMES = tuple(dict.fromkeys(kind.text for kinds in _KINDS.values() for kind in kinds))

if TYPE_CHECKING:
    FailureName = str
else:
    FailureName = Literal[_NAMES]

_AMOUNTS = {one.name: one for kinds in _KINDS.values() for kind in kinds for one in kind.amounts}

AMOUNTS = sorted(_AMOUNTS)
"""Keys that quantify a failure."""


class _Failure(ScenarioTable):
    """Keys of every failure."""

    of: Line = choice(
        "What fails, such as "
        + ", ".join(f'"{name} {number}"' for number, name in enumerate(_TABLES, 1))
        + f' or "thruster" and its name; or a sensor, {", ".join(one.name for one in SENSORS)}, '
        f'"{OTHER_SENSORS}" and its name, or "tachometer" and the name or number of its wheel'
    )
    at_s: Time = quantity("When it fails", "s")
    kind: FailureName = choice(f"How it fails. {_KINDS_IN_WORDS}")

    @field_validator("kind", mode="before")
    @classmethod
    def _is_one_of_its_part(cls, value: Any, info: Any) -> Any:
        part = str(info.data.get("of")).partition(" ")[0]
        if part in _KINDS and isinstance(value, str) and value not in _NAMES:
            names = list(dict.fromkeys(kind.text for kind in _KINDS[part]))
            rule = f"must be one of {', '.join(names)} for a {part}"
            raise ArgumentError("kind", rule, f"{shown(value)}{suggestion(value, names)}")
        return value


class FailureTable(table_with(fields_of(_AMOUNTS.values()), _Failure)):
    """`[[failure]]`: a failure of an actuator or a sensor in flight, unknown to the law.

    Of several failures of one part the later one replaces the earlier.
    """

    @property
    def part(self) -> str:
        """Kind of the failing part: the first word of `of`."""
        return self.of.partition(" ")[0]

    @property
    def of_sensor(self) -> bool:
        """Whether a sensor fails, not an actuator."""
        return self.part in _OF_SENSORS


@rule_over("failure", "spacecraft.thruster_torque_axes", *_TABLES)
def _failures_have_something_to_strike(values):
    tables = {name: values[name] for name in _TABLES}
    tables["thruster"] = tables["thruster"] or values["spacecraft.thruster_torque_axes"] or ()
    tables[TACHOMETER] = tables["wheel"]
    gyro = [GYRO.name] if any(key.startswith(f"{GYRO.name}.") for key in values) else []
    sensors = [*gyro, *(name.replace(".", " ") for name in given_sensors(values))]
    for number, one in enumerate(values["failure"]):
        if one.of not in sensors and number_of(one.of, one.part, tables.get(one.part, ())) is None:
            names = [f"{name} {which}" for name, all in tables.items() for which in names_of(all)]
            names = [*sensors, *names]
            few = ", ".join(f'"{name}"' for name in names[:6]) + (", …" if names[6:] else "")
            few = f"one of {few}" if names else "an actuator or a sensor"
            hint = "" if one.of[-1:].isdigit() else suggestion(one.of, names)
            yield Issue(("failure", number, "of"), f"must name {few}, got {shown(one.of)}{hint}")


@rule("failure")
def _one_actuator_fails_once_at_a_time(failures):
    for number, one in enumerate(failures):
        for before, other in enumerate(failures[:number], 1):
            if (one.of, one.at_s) == (other.of, other.at_s):
                yield Issue(
                    ("failure", number, "at_s"),
                    f"must differ from that of failure {before}: of two failures of {one.of} the "
                    f"later one replaces the earlier, and at one instant neither is (here "
                    f'"{other.kind}" and "{one.kind}"), got {shown(one.at_s)}',
                )


@rule("failure", "control.law")
def _gyros_and_tachometers_fail_after_the_first_sample(failures, law):
    for number, one in enumerate(failures):
        if one.part == TACHOMETER and not law.declaration.sampled:
            message = f'must not be a tachometer under the law "{law}", which is not sampled'
            yield Issue(("failure", number, "of"), f"{message}, got {shown(one.of)}")
        if one.part in ("gyro", TACHOMETER) and one.at_s <= 0:
            message = f"must be above 0 for a {one.part}, after the first sample"
            yield Issue(("failure", number, "at_s"), f"{message}, got {shown(one.at_s)}")


@rule("failure", "thruster")
def _failures_say_what_and_how_much(failures, thrusters):
    for number, one in enumerate(failures):
        ideal = one.part == "thruster" and not thrusters
        which = _IDEAL if ideal else one.part
        if which not in _KINDS:
            continue
        alike = [kind for kind in _KINDS[which] if kind.text == one.kind]
        if not alike:
            names = ", ".join(dict.fromkeys(kind.text for kind in _KINDS[which]))
            message = f"must be one of {names} for a {which}, got {shown(one.kind)}"
            yield Issue(("failure", number, "kind"), message)
            continue
        yield from _amounts(number, one, [kind.keys for kind in alike])
        both_signs = one.part in _BY_NAME and _BY_NAME[one.part].both_signs
        may_be_negative = (ideal or both_signs) and one.kind == "stuck-at"
        if one.fraction is not None and one.fraction < 0 and not may_be_negative:
            message = f"must be at least 0, got {shown(one.fraction)}"
            yield Issue(("failure", number, "fraction"), message)


def _amounts(number, one, alternatives):
    """Yield issues on the keys that quantify a failure, those of one of the `alternatives`."""
    amounts = [key for keys in alternatives for key in keys]
    present = [key for key in AMOUNTS if getattr(one, key) is not None]
    what = f'for a failure of kind "{one.kind}"'
    for key in present:
        if key not in amounts:
            got = shown(getattr(one, key))
            yield Issue(("failure", number, key), f"must not be given {what}, got {got}")
    partial = [keys for keys in alternatives if set(present) & set(keys)]
    for key in amounts[-1:] if not partial else partial[0] if len(partial) == 1 else ():
        if key not in present:
            message = f"must be given {what}, got nothing"
            yield Issue(("failure", number, key), message, (), True)
    if len(partial) > 1:
        message = f"must not be given with {amounts[0]} {what}"
        yield Issue(("failure", number, amounts[-1]), message)


@rule("failure", "spacecraft.torque_limit_N_m", "thruster")
def _stuck_torques_have_a_size(failures, limit, thrusters):
    for number, one in enumerate(failures):
        ideal = not thrusters and one.part == "thruster"
        if ideal and limit is None and one.kind.startswith("stuck"):
            message = f'must not be "{one.kind}" without spacecraft.torque_limit_N_m'
            yield Issue(
                ("failure", number, "kind"), f"{message}: the stuck torque is a fraction of it"
            )


@rule("failure", "actuators.kind")
def _failures_are_those_of_jaxsats_own_actuators(failures, kind):
    for number, one in enumerate(failures):
        if not one.of_sensor:
            message = f"must be a sensor with actuators.kind = {shown(kind)}, got {shown(one.of)}"
            yield Issue(("failure", number, "of"), message)


@rule_over("failure", "control.law", *STEPS)
def _no_fixed_steps_across_a_failure(values):
    key = key_of_fixed_steps(values)
    if values["failure"] and key:
        yield at(
            key,
            "must be left to adaptive steps where something fails in flight, which ends a step, "
            f"got {shown(values[key])}",
        )


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
    actuator = _BY_NAME.get(one.part)
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
