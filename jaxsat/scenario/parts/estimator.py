"""`[estimator]`: the estimator between sensors with a table and a sampled law.

If the table is given, rules receive the values of its keys; if not, they receive it as None.
"""

from collections.abc import Iterator
from typing import Annotated, Any, ClassVar

from annotated_types import Ge, Le
from pydantic import ConfigDict, SerializeAsAny

from jaxsat.core.declaration.keys import choice as key_choice
from jaxsat.core.declaration.keys import number
from jaxsat.core.declaration.sensors import PATIENCE, PROBATION
from jaxsat.core.ranges import PROBABILITY, RATE_RANGE, TORQUE_NOISE, TRACKER_NOISE, Range
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.parts.named import PartTable, by_its_kind
from jaxsat.scenario.parts.sensors import ATTITUDE, MAX_PERIODS, given_sensors
from jaxsat.scenario.plugins import ESTIMATOR, PluginKind
from jaxsat.scenario.quantities import Whole, choice, fields_of, quantity, table_with
from jaxsat.scenario.rules import Values, at, rule, rule_over
from jaxsat.scenario.wording import shown

ESTIMATOR_KIND = key_choice(
    "kind",
    'What the law receives: the estimates of a multiplicative extended Kalman filter ("mekf"), '
    'or what was measured last ("none")',
    ESTIMATOR.own,
    "mekf",
)

ATTITUDE_SIGMA = number(
    "attitude_sigma_rad",
    "Standard deviation of the random error of the first attitude estimate, about each axis",
    at_least=0,
    at_most=TRACKER_NOISE.high,
    default=0.01,
)


RATE_SIGMA = number(
    "rate_sigma_rad_s",
    "Standard deviation of the first rate about each axis relative to the orbit frame, of which "
    "the first estimate is zero; for a filter by the dynamics",
    within=Range(0.0, RATE_RANGE.high),
    default=None,
)

TORQUE_KEYS = (
    number(
        "torque_noise_N_m_sqrt_Hz",
        "Density of the white noise of torques that the filter does not know, about each axis; "
        "with [gyro], given for a filter by the dynamics, which tests the gyro as other sensors",
        within=TORQUE_NOISE,
        default=None,
    ),
    number(
        "torque_sigma_N_m",
        "Standard deviation of the unknown torque that the filter estimates, about each axis, at "
        "the start; for a filter by the dynamics",
        within=TORQUE_NOISE,
        default=0.0,
    ),
    number(
        "torque_walk_N_m_s_sqrt_Hz",
        "Density of the white noise that moves the unknown torque, about each axis; for a filter "
        "by the dynamics",
        within=TORQUE_NOISE,
        default=0.0,
    ),
)

OF_DYNAMICS = (RATE_SIGMA, *TORQUE_KEYS)
"""Keys of a filter that predicts rates by the dynamics."""

FALSE_ALARM_PROBABILITY = number(
    "false_alarm_probability",
    "Probability that the filter rejects a good reading of a sensor of the attitude, or of a gyro "
    "that it does not integrate, as one that does not agree with its prediction; by default none "
    "is tested",
    at_least=PROBABILITY.low,
    at_most=0.5,
    default=None,
)


class EstimatorTable(
    table_with(fields_of([ATTITUDE_SIGMA, *OF_DYNAMICS, FALSE_ALARM_PROBABILITY]), PartTable)
):
    """`[estimator]`: estimates of attitude and rates for the law from the measurements."""

    plugin: ClassVar[PluginKind] = ESTIMATOR

    kind: str = choice(
        f"{ESTIMATOR_KIND.meaning}; or an estimator that does not come with jaxsat, "
        '"module:Class" or the name of an installed one, whose keys follow',
        ESTIMATOR_KIND.default,
    )
    patience: Annotated[Whole, Ge(1), Le(MAX_PERIODS)] | None = quantity(
        "Readings of a sensor in a row that the filter rejects before it excludes the sensor; "
        f"{PATIENCE} by default",
        "1",
        None,
    )
    probation: Annotated[Whole, Ge(1), Le(MAX_PERIODS)] | None = quantity(
        "Readings of an excluded sensor in a row that pass the test before the filter uses it "
        f"again; {PROBATION} by default",
        "1",
        None,
    )


class OwnEstimatorTable(table_with(fields_of([ESTIMATOR_KIND]), EstimatorTable)):
    """`[estimator]` of a kind that comes with jaxsat."""

    model_config = ConfigDict(extra="forbid")


EstimatorOfAKind = Annotated[
    SerializeAsAny[EstimatorTable], by_its_kind(EstimatorTable, OwnEstimatorTable)
]


def _is_own_filter(values: Values) -> bool:
    return values.get("estimator.kind", ESTIMATOR_KIND.default) == "mekf"


@rule_over("gyro")
def _a_filter_without_a_gyro_knows_the_torques(values):
    names = given_sensors(values)
    if values["gyro"] is not None or not names or not _is_own_filter(values):
        return
    keys = [f"estimator.{key.name}" for key in (RATE_SIGMA, TORQUE_KEYS[0])]
    table = values.get("estimator", 0) is not None
    missing = [key for key in keys if not table or values.get(key, 0) is None]
    if missing == keys:
        message = (
            f"must be given with [{names[0]}], or else {' and '.join(keys)}, for a filter that "
            "predicts the rates from the commanded torques, got none of them"
        )
        yield at("gyro", message, True)
    elif missing:
        yield at(missing[0], f"must be given with [{names[0]}] without [gyro], got nothing", True)


@rule_over("gyro.noise_density_rad_s_sqrt_Hz", "estimator.kind")
def _a_filter_by_the_dynamics_knows_the_torques_beside_a_gyro(values):
    names = [key.name for key in OF_DYNAMICS if values.get(f"estimator.{key.name}")]
    if not names or not _is_own_filter(values):
        return
    for key in (RATE_SIGMA, TORQUE_KEYS[0]):
        if values.get(f"estimator.{key.name}", 0) is None:
            yield at(f"estimator.{key.name}", f"must be given with {names[0]}, got nothing", True)
    if not values["gyro.noise_density_rad_s_sqrt_Hz"]:
        message = "must be above 0 for a filter that takes in rates as measurements, got 0"
        yield at("gyro.noise_density_rad_s_sqrt_Hz", message)


@rule_over()
def _a_filter_by_the_dynamics_knows_the_body(values):
    request = f"estimator.{TORQUE_KEYS[0].name}"
    without = values.get("gyro", 0) is None
    if not given_sensors(values) or not (without or values.get(request) is not None):
        return
    law, where = values.get("control.law"), "without [gyro]" if without else f"with {request}"
    if values.get("spacecraft.third_rate") == "held":
        message = f'must be "free" {where}: the filter does not know the torque that holds it'
        yield at("spacecraft.third_rate", f'{message}, got "held"')
    if law is not None and law.declaration.commands_actuators:
        rule = "must be given" if without else "must be left out"
        message = (
            f"{rule} with this law, which finds failures by measured rates: {where} the filter "
            "predicts them from the commands"
        )
        got = "nothing" if without else shown(values[request])
        yield at("gyro" if without else request, f"{message}, got {got}", without)
    for number_, one in enumerate(values.get("wheel") or ()):
        if one.tachometer_outage_start_s is not None:
            message = f"must be left out {where}: the filter has the rates from the momenta"
            got = shown(one.tachometer_outage_start_s)
            yield at(f"wheel.{number_}.tachometer_outage_start_s", f"{message}, got {got}")


@rule_over("estimator.kind")
def _the_filter_alone_needs_torques(values):
    kind = values["estimator.kind"]
    for key in OF_DYNAMICS if kind != "mekf" else ():
        value = values.get(f"estimator.{key.name}")
        if value:
            message = f'must be left out with kind "{kind}", got {shown(value)}'
            yield at(f"estimator.{key.name}", message)


@rule_over("gyro", *ATTITUDE, "estimator.kind")
def _estimator_has_sensors(values):
    if values["gyro"] is None:
        kind = values["estimator.kind"]
        yield at("estimator", f'must belong to [gyro] and [star_tracker], got kind "{kind}" alone')


@rule_over("estimator.kind")
def _a_law_without_estimator_has_a_gyro_and_a_tracker(values):
    names, kind = given_sensors(values), values["estimator.kind"]
    missing = [name for name in ("gyro", "star_tracker") if values.get(name, 0) is None]
    if kind == "none" and names and missing:
        yield at("estimator.kind", f'must be "mekf" without [{missing[-1]}], got "none"')


@rule(
    "estimator.kind",
    "estimator.false_alarm_probability",
    "estimator.patience",
    "estimator.probation",
)
def _the_filter_alone_tests_innovations(kind, probability, patience, probation):
    if kind != "mekf" and probability is not None:
        message = f'must be left out with kind "{kind}", got {shown(probability)}'
        yield at("estimator.false_alarm_probability", message)
    for key, count in (("patience", patience), ("probation", probation)):
        if probability is None and count is not None:
            message = f"must be left out without false_alarm_probability, got {shown(count)}"
            yield at(f"estimator.{key}", message)


def estimator_cautions(scenario: Any) -> Iterator[Issue]:
    """Yield cautions about what a filter that predicts rates by the dynamics does not expect."""
    table = scenario.estimator
    if table is None or table.rate_sigma_rad_s is None:
        return
    most = max(map(abs, scenario.initial.omega_rad_s))
    if most > 5 * table.rate_sigma_rad_s + scenario.orbit.rate():
        message = (
            "should be at least a fifth of the first rate, which the filter does not know, "
            f"{most:.3g} rad/s, got {shown(table.rate_sigma_rad_s)}"
        )
        yield Issue(("estimator", "rate_sigma_rad_s"), message)
    unknown = _unknown_torques(scenario)
    if unknown and not table.torque_sigma_N_m and not table.torque_walk_N_m_s_sqrt_Hz:
        message = (
            "should be given, so that the filter estimates a torque that it does not know, here "
            f"{unknown[0]}; else its errors may be larger than it claims, got nothing"
        )
        yield Issue(("estimator", "torque_sigma_N_m"), message, (), True)


UNKNOWN = (
    "amplitude_N_m",
    "constant_N_m",
    "residual_dipole_A_m2",
    "drag_density_kg_m3",
    "solar_area_m2",
)
"""Keys of `[disturbance]` that are zero without the torques that such a filter does not know."""


def _unknown_torques(scenario: Any) -> list[str]:
    """Keys of torques that a filter by the dynamics does not know: all but the gravity gradient."""
    table = scenario.disturbance
    values = ((key, getattr(table, key)) for key in UNKNOWN)
    own = [key for key, value in values if (any(value) if isinstance(value, tuple) else value)]
    keys = own + [f"torques.{name}" for name in table.torques]
    failing = [one.of for one in scenario.failure if one.part in ("thruster", "magnetorquer")]
    return [f"disturbance.{key}" for key in keys] + [f"that of the failed {one}" for one in failing]
