"""The `[control]` table, one class for each control law."""

from typing import Annotated, Literal

from annotated_types import Le, Len
from pydantic import Field

from jaxsat.ranges import KNOWN_FREQUENCY, ORBIT_RATE
from jaxsat.scenario.quantities import (
    Inertia,
    NonNegative,
    Number,
    Positive,
    PositiveOrPair,
    PositivePair,
    Switch,
    Switches3,
    Table,
    choice,
    quantity,
    within,
)
from jaxsat.scenario.tables import Relation, Seconds

KnownFrequencies = Annotated[tuple[Annotated[Number, within(KNOWN_FREQUENCY)], ...], Len(2, 2)]


class ModelTable(Table):
    """`[control.model]`: what the controller believes; left out, it equals the plant."""

    inertia_kg_m2: Inertia | None = quantity(
        "Inertia that the controller believes, in either form of spacecraft.inertia_kg_m2",
        "kg m²",
        None,
    )
    orbit_rate_rad_s: Annotated[Number, within(ORBIT_RATE)] | None = quantity(
        "Orbital rate that the controller believes", "rad/s", None
    )
    orbit_relation: Relation | None = choice("Form of (11) that the controller uses", None)


MODEL = choice("What the controller believes of the plant", ModelTable())
MEASURED = choice(
    "Axes x, y, z whose periodic disturbance the controller measures and feeds forward",
    (False, False, False),
)
K1 = quantity("Gain of the reference (38)", "√(rad/s)")
K2 = quantity("Gain of the torque (39)", "1/s")
OMEGA3_WIDTH = quantity("Rounds √|ω3| of (38) near zero; 0 is the printed law", "rad/s", 0.0)
K3 = quantity("Gain of the reference (40) on the tilt", "1/s")
MU = quantity("Gain μ of the reference (40) on the turn", "1/s")
A = quantity("Bound a of the saturation in (41)", "1")
K4 = quantity("Gain of (42) on the rate errors: one number, or one for each axis", "N m s")
INTERNAL_MODEL = choice("Whether the internal model of the disturbance, in (42), is on", True)
INTERNAL_MODEL_FREQUENCY = quantity(
    "Frequencies of the internal model; left out, those of the disturbance about x and y",
    "rad/s",
    None,
)
ATTITUDE_WEIGHT = quantity("Factor on the attitude terms of (42); 1 as printed", "N m", 1.0)
SATURATION_WIDTH = quantity(
    "Part of the bound a over which the corner of sat is rounded, 0 (printed) to 1", "1", 0.0
)
TILT_WIDTH = quantity("δ in |w|² + δ² under the fraction of (41); 0 as printed", "1", 0.0)


class CoastTable(Table):
    """`law = "coast"`: no control."""

    law: Literal["coast"] = choice("The control law")


class RateTable(Table):
    """`law = "rate"`: angular-velocity stabilisation, (38) and (39)."""

    law: Literal["rate"] = choice("The control law")
    k1: Positive = K1
    k2: Positive = K2
    omega3_width_rad_s: NonNegative = OMEGA3_WIDTH
    measured_disturbance: Switches3 = MEASURED
    model: ModelTable = MODEL


class ThreeAxisTable(Table):
    """`law = "three-axis"`: three-axis stabilisation, (40) to (42)."""

    law: Literal["three-axis"] = choice("The control law")
    k3: Positive = K3
    mu: Positive = MU
    a: Positive = A
    k4: PositiveOrPair = K4
    internal_model: Switch = INTERNAL_MODEL
    internal_model_frequency_rad_s: KnownFrequencies | None = INTERNAL_MODEL_FREQUENCY
    attitude_weight_N_m: NonNegative = ATTITUDE_WEIGHT
    saturation_width: Annotated[NonNegative, Le(1)] = SATURATION_WIDTH
    tilt_width: NonNegative = TILT_WIDTH
    measured_disturbance: Switches3 = MEASURED
    model: ModelTable = MODEL


class SwitchingTable(Table):
    """`law = "switching"`: the rate law while |ω3| is large, else the three-axis law."""

    law: Literal["switching"] = choice("The control law")
    k1: Positive = K1
    k2: Positive = K2
    k3: Positive = K3
    mu: Positive = MU
    a: Positive = A
    k4: PositiveOrPair = K4
    upper_threshold_rad_s: Positive = quantity(
        "The rate law takes over when |ω3| exceeds this", "rad/s"
    )
    lower_threshold_rad_s: Positive = quantity(
        "The three-axis law takes over again when |ω3| falls below this", "rad/s"
    )
    period_s: Seconds = quantity("Time between two runs of the controller", "s")
    rate_slope_limit_rad_s2: PositivePair | None = quantity(
        "Bounds of the rate law's reference derivative; left out, torque limit / J_i",
        "rad/s²",
        None,
    )
    three_axis_slope_limit_rad_s2: PositivePair | None = quantity(
        "Bounds of the three-axis law's reference derivative; left out, 5 torque limit / J_i",
        "rad/s²",
        None,
    )
    omega3_width_rad_s: NonNegative = OMEGA3_WIDTH
    internal_model: Switch = INTERNAL_MODEL
    internal_model_frequency_rad_s: KnownFrequencies | None = INTERNAL_MODEL_FREQUENCY
    attitude_weight_N_m: NonNegative = ATTITUDE_WEIGHT
    saturation_width: Annotated[NonNegative, Le(1)] = SATURATION_WIDTH
    tilt_width: NonNegative = TILT_WIDTH
    measured_disturbance: Switches3 = MEASURED
    model: ModelTable = MODEL


OBSERVE = choice("Whether the ripple of d3 is observed and left out of the feedback", True)
RIPPLE_FREQUENCY = quantity(
    "Frequency of d3 that the controller believes; left out, that of the disturbance",
    "rad/s",
    None,
)
RIPPLE_AMPLITUDE = quantity(
    "Amplitude of d3 that the controller expects; left out, that of the disturbance", "N m", None
)
ESTIMATE = choice("Whether leaning thruster axes and the inertia ratio are estimated", True)
PERIOD = quantity("Time between two runs of the controller; the gains are tuned for 0.1", "s", 0.1)


class OscillatoryTable(Table):
    """`law = "oscillatory"`: oscillate about the driven axes until all is small, then regulate.

    Gains that are left out are those tuned for torque limits of 1, 5 and 20 N m, interpolated in
    between.
    """

    law: Literal["oscillatory"] = choice("The control law")
    frequency_rad_s: Positive | None = quantity("Frequency ν of the oscillation", "rad/s", None)
    tilt_gain: Positive | None = quantity("Gain k on the tilt", "1/s", None)
    rate_gain: Positive | None = quantity("Gain kω on the rate errors", "1/s", None)
    largest_amplitude_rad_s: Positive | None = quantity(
        "Largest amplitude ρm of the oscillation", "rad/s", None
    )
    ratio: Positive | None = quantity("How the oscillation is shared out, r", "1", None)
    k3: Positive | None = quantity("Gain of the slow motion about the third axis", "1/s", None)
    damping: Positive | None = quantity("Damping ratio ζ of that motion", "1", None)
    observe_ripple: Switch = OBSERVE
    ripple_frequency_rad_s: Positive | None = RIPPLE_FREQUENCY
    ripple_amplitude_N_m: NonNegative | None = RIPPLE_AMPLITUDE
    estimate_axes: Switch = ESTIMATE
    period_s: Seconds = PERIOD
    model: ModelTable = MODEL


class ThreeSlewTable(Table):
    """`law = "three-slew"`: stop, three slews about the driven axes, oscillate, regulate.

    The gains are tuned for torque limits of 1, 5 and 20 N m and interpolated in between.
    """

    law: Literal["three-slew"] = choice("The control law")
    observe_ripple: Switch = OBSERVE
    ripple_frequency_rad_s: Positive | None = RIPPLE_FREQUENCY
    ripple_amplitude_N_m: NonNegative | None = RIPPLE_AMPLITUDE
    estimate_axes: Switch = ESTIMATE
    period_s: Seconds = PERIOD
    model: ModelTable = MODEL


ControlTable = Annotated[
    CoastTable | RateTable | ThreeAxisTable | SwitchingTable | OscillatoryTable | ThreeSlewTable,
    Field(discriminator="law"),
]
SAMPLED_LAWS = ("switching", "oscillatory", "three-slew")
"""Laws that run once a period and hold their torque in between."""

SETTLING_LAWS = ("oscillatory", "three-slew")
"""Laws whose gains follow from the torque limit."""

LAWS: dict[str, type[Table]] = {
    "coast": CoastTable,
    "rate": RateTable,
    "three-axis": ThreeAxisTable,
    "switching": SwitchingTable,
    "oscillatory": OscillatoryTable,
    "three-slew": ThreeSlewTable,
}
