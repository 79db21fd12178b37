"""`[[failure]]`: failures in flight of actuators and sensors."""

from typing import TYPE_CHECKING, Any, Literal

from pydantic import field_validator

from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.declaration.sensor import TACHOMETER, TachometerFailureKind
from jaxsat.core.declaration.sensors import FAILING, GYRO, OTHER_SENSORS, SENSORS
from jaxsat.core.declaration.thrusters import IDEAL_KINDS
from jaxsat.core.errors import ArgumentError
from jaxsat.core.text import suggestion
from jaxsat.scenario.errors import Issue
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
BY_NAME = {one.name: one for one in ACTUATORS}
"""Actuators by name."""

_TABLES = tuple(BY_NAME)
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
        both_signs = one.part in BY_NAME and BY_NAME[one.part].both_signs
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
