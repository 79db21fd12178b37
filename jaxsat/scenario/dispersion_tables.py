"""The `[dispersion]` and `[sampling]` tables: what differs between the cases of a study."""

from typing import Annotated, Any, Literal

from annotated_types import Ge, Le, Len
from pydantic import Discriminator, Tag, model_validator

from jaxsat.errors import ArgumentError
from jaxsat.ranges import ATTITUDE_NOISE, RATE_NOISE, SECONDS
from jaxsat.scenario.quantities import Number, Switch, Table, choice, quantity, within

NumberOrList = Annotated[
    Annotated[Number, Tag("one")] | Annotated[tuple[Number, ...], Len(1, 1000), Tag("each")],
    Discriminator(lambda value: "each" if isinstance(value, list | tuple) else "one"),
]
Numbers = Annotated[tuple[Number, ...], Len(1, 1000)]

Kind = Literal["uniform", "normal", "truncated-normal", "discrete", "random-attitude"]

PARAMETERS = {
    "uniform": ("low", "high"),
    "normal": ("mean", "sigma"),
    "truncated-normal": ("mean", "sigma", "low", "high"),
    "discrete": ("values", "weights"),
    "random-attitude": (),
}
"""The parameters of each distribution."""


class DistributionTable(Table):
    """`[dispersion.QUANTITY]`: a distribution, in the unit of the quantity.

    A parameter is one number for all components or a list with one for each.
    """

    distribution: Kind = choice("Kind of distribution")
    low: NumberOrList | None = choice("Least value", None)
    high: NumberOrList | None = choice("Largest value", None)
    mean: NumberOrList | None = choice("Mean, before truncation", None)
    sigma: NumberOrList | None = choice("Standard deviation, before truncation", None)
    values: Numbers | None = choice("Values of which each component takes one", None)
    weights: Numbers | None = choice("Weights of the values", None)

    @model_validator(mode="after")
    def _own_parameters(self) -> "DistributionTable":
        wanted, kind = PARAMETERS[self.distribution], f'a "{self.distribution}" distribution'
        for name in sorted({entry for names in PARAMETERS.values() for entry in names}):
            given = getattr(self, name) is not None
            if given and name not in wanted:
                raise ArgumentError(name, f"must not have {name} in {kind}")
            if not given and name in wanted:
                raise ArgumentError(name, f"must have {name} in {kind}")
        return self


def _dispersed(what: str, unit: str) -> Any:
    return quantity(f"Distribution of {what}", unit, None)


Distribution = DistributionTable | None


class DispersionTable(Table):
    """`[dispersion]`: what a Monte-Carlo study draws anew for every case."""

    design: Literal["independent", "sobol", "latin-hypercube"] = choice(
        "How the cases are spread over the distributions", "independent"
    )
    frequency_known: Switch = choice(
        "Whether the law's internal model or ripple estimator knows the drawn disturbance "
        "frequencies",
        False,
    )
    inertia: Distribution = _dispersed("relative changes of J1, J2, J3", "1")
    products_of_inertia: Distribution = _dispersed(
        "Jxy, Jxz, Jyz to add, in parts of the least of J1, J2, J3", "1"
    )
    misalignment_rad: Distribution = _dispersed(
        "the turn of each torque axis towards two directions across it", "rad"
    )
    torque_gain: Distribution = _dispersed("relative changes of each thruster's torque", "1")
    disturbance_amplitude: Distribution = _dispersed(
        "relative changes of the periodic torque's amplitudes", "1"
    )
    disturbance_frequency: Distribution = _dispersed(
        "relative changes of the periodic torque's frequencies", "1"
    )
    disturbance_phase_rad: Distribution = _dispersed("phases of the periodic torque", "rad")
    constant_torque_N_m: Distribution = _dispersed("torque to add, fixed in body axes", "N m")
    model_inertia: Distribution = _dispersed(
        "relative changes of J1, J2, J3 in the controller's model", "1"
    )
    model_orbit_rate: Distribution = _dispersed(
        "relative changes of the orbit rate in the controller's model", "1"
    )
    rate_noise_rad_s: Distribution = _dispersed("the rate sensors' standard deviation", "rad/s")
    attitude_noise_rad: Distribution = _dispersed("the attitude sensors' standard deviation", "rad")
    delay_s: Distribution = _dispersed("the time that the controller takes to compute", "s")
    attitude: Distribution = _dispersed('initial attitudes; "random-attitude"', "1")
    tilt: Distribution = _dispersed("the initial |w|", "1")
    tilt_direction_rad: Distribution = _dispersed("the angle of the initial (w1, w2)", "rad")
    turn_rad: Distribution = _dispersed("the initial z", "rad")
    attitude_error_rad: Distribution = _dispersed(
        "rotation vectors from the nominal initial attitude", "rad"
    )
    omega_rad_s: Distribution = _dispersed("initial angular velocities", "rad/s")
    rate_error_rad_s: Distribution = _dispersed(
        "the initial (ω1, ω2) less the law's reference", "rad/s"
    )


class SamplingTable(Table):
    """`[sampling]`: what is between a sampled law and the plant."""

    rate_noise_rad_s: Annotated[Number, within(RATE_NOISE)] = quantity(
        "Standard deviation of white noise on each measured rate, a sample", "rad/s", 0.0
    )
    attitude_noise_rad: Annotated[Number, within(ATTITUDE_NOISE)] = quantity(
        "Standard deviation of the measured attitude about each body axis, a sample", "rad", 0.0
    )
    delay_s: Annotated[Number, Ge(0), Le(SECONDS.high)] = quantity(
        "Time from a sample to its torque, at most one period of the law", "s", 0.0
    )
