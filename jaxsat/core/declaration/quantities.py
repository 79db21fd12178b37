"""The quantities that a study can disperse. `jaxsat.studies.quantities` applies them."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import MappingProxyType

from jaxsat.core.declaration.failures import (
    AbstractFailureKind,
    FailureKind,
    GimbalFailureKind,
    WheelFailureKind,
)
from jaxsat.core.declaration.keys import with_unit


@dataclass(frozen=True)
class DispersibleQuantity:
    """A quantity that a study can draw for every case, with its unit in SI ("1" for none).

    It is not dispersed together with those that it `excludes`. Where `random_attitude` is true its
    distribution is "random-attitude", which no other quantity has. One that `turns` moves the
    initial attitude away from where the scenario has it. `axis` is what the axis of its numbers is
    called where there are several.
    """

    name: str
    meaning: str
    unit: str = "1"
    excludes: tuple[str, ...] = ()
    random_attitude: bool = False
    turns: bool = False
    axis: str | None = None

    @property
    def key(self) -> str:
        """Its key of `[dispersion]`: the name with the unit."""
        return with_unit(self.name, self.unit)


def _numbered(actuator: str, kinds: Sequence[AbstractFailureKind]) -> str:
    """The numbers by which kinds of failure are drawn, and the key that each one's amount has."""
    names = []
    for kind in kinds:
        amount = "".join(f" ({key})" for key in kind.keys)
        names.append(f"{kind:d} {kind.word}{amount}")
    return f"of a {actuator} {', '.join(names)}"


_DRAWN_KINDS = "; ".join(
    (
        _numbered("thruster", tuple(FailureKind)[: FailureKind.TURNED]),
        _numbered("wheel", tuple(WheelFailureKind)),
        _numbered("magnetorquer", tuple(FailureKind)[: FailureKind.LEAKING]),
        _numbered("gimbal", tuple(GimbalFailureKind)),
    )
)

DISPERSIBLE: Mapping[str, DispersibleQuantity] = MappingProxyType(
    {
        quantity.name: quantity
        for quantity in (
            DispersibleQuantity("inertia", "relative change of J1, J2, J3", axis="body_axis"),
            DispersibleQuantity(
                "products_of_inertia",
                "Jxy, Jxz, Jyz to add, in parts of the least of J1, J2, J3",
                axis="product_of_inertia",
            ),
            DispersibleQuantity(
                "rotor_inertia",
                "relative change of the rotor inertia of each wheel, which the law does not know; "
                "that of the whole body stays",
                axis="wheel",
            ),
            DispersibleQuantity(
                "misalignment",
                "turn of each torque axis towards two directions across it",
                "rad",
                axis="thruster_turn",
            ),
            DispersibleQuantity(
                "torque_gain", "relative change of each thruster's torque", axis="thruster"
            ),
            DispersibleQuantity(
                "dipole_limit",
                "relative change of each magnetorquer's dipole limit",
                axis="magnetorquer",
            ),
            DispersibleQuantity(
                "magnetorquer_misalignment",
                "turn of each magnetorquer towards two directions across it",
                "rad",
                axis="magnetorquer_turn",
            ),
            DispersibleQuantity(
                "rotor_momentum",
                "relative change of the momentum of each control moment gyro's rotor",
                axis="gimbal",
            ),
            DispersibleQuantity(
                "disturbance_amplitude",
                "relative change of the periodic torque's amplitudes",
                axis="body_axis",
            ),
            DispersibleQuantity(
                "disturbance_frequency",
                "relative change of the periodic torque's frequencies",
                axis="body_axis",
            ),
            DispersibleQuantity(
                "disturbance_phase", "phases of the periodic torque", "rad", axis="body_axis"
            ),
            DispersibleQuantity(
                "constant_torque", "torque to add, fixed in body axes", "N m", axis="body_axis"
            ),
            DispersibleQuantity(
                "model_inertia",
                "relative change of the J1, J2, J3 that the controller believes",
                axis="body_axis",
            ),
            DispersibleQuantity(
                "model_orbit_rate", "relative change of the orbit rate that the controller believes"
            ),
            DispersibleQuantity("rate_noise", "standard deviation of the rate sensors", "rad/s"),
            DispersibleQuantity(
                "attitude_noise", "standard deviation of the attitude sensors", "rad"
            ),
            DispersibleQuantity(
                "gyro_noise_density", "density of the white noise on each rate", "rad/s/√Hz"
            ),
            DispersibleQuantity(
                "gyro_bias_walk", "density of the white noise that moves each bias", "rad/s²/√Hz"
            ),
            DispersibleQuantity(
                "gyro_bias", "bias of the gyro at the start", "rad/s", axis="body_axis"
            ),
            DispersibleQuantity(
                "gyro_scale_factor", "relative error of each measured rate", axis="body_axis"
            ),
            DispersibleQuantity(
                "gyro_misalignment",
                "small rotation of the gyro's input axes",
                "rad",
                axis="body_axis",
            ),
            DispersibleQuantity(
                "tracker_across",
                "standard deviation of the star tracker across its boresight",
                "rad",
            ),
            DispersibleQuantity(
                "tracker_along", "standard deviation of the star tracker about its boresight", "rad"
            ),
            DispersibleQuantity(
                "tracker_update_period",
                "time between the star tracker's measurements, rounded to whole control periods",
                "s",
            ),
            DispersibleQuantity(
                "tracker_latency",
                "time until the star tracker's measurement arrives, rounded to whole control "
                "periods, at most star_tracker.latency_s",
                "s",
            ),
            DispersibleQuantity(
                "tracker_rate_limit",
                "magnitude of ω above which the star tracker is blind",
                "rad/s",
            ),
            DispersibleQuantity("tracker_outage_start", "begin of the star tracker's outage", "s"),
            DispersibleQuantity("tracker_outage", "length of the star tracker's outage", "s"),
            DispersibleQuantity(
                "failure_time",
                "time at which each [[failure]] strikes; those of thrusters come first, then those "
                "of wheels, of magnetorquers and of gimbals, here and below",
                "s",
            ),
            DispersibleQuantity(
                "failed_thruster",
                "number from 0, rounded, of the thruster that each [[failure]] of one strikes; "
                "a two-sided one counts as two, of which only what is stuck or leaks strikes one",
            ),
            DispersibleQuantity(
                "failed_wheel",
                "number from 0, rounded, of the wheel that each [[failure]] of a wheel strikes",
            ),
            DispersibleQuantity(
                "failed_magnetorquer",
                "number from 0, rounded, of the magnetorquer that each [[failure]] of one strikes",
            ),
            DispersibleQuantity(
                "failed_gimbal",
                "number from 0, rounded, of the control moment gyro that each [[failure]] of one "
                "strikes",
            ),
            DispersibleQuantity(
                "failure_kind",
                f"kind of each [[failure]], rounded: {_DRAWN_KINDS}",
            ),
            DispersibleQuantity(
                "failure_amount",
                "fraction (or delay or time constant, s; or factor or level, N m, of friction) of "
                "each [[failure]]",
            ),
            DispersibleQuantity("delay", "time that the controller takes to compute", "s"),
            DispersibleQuantity(
                "attitude",
                "initial attitude, a unit quaternion",
                excludes=("tilt", "tilt_direction", "turn"),
                random_attitude=True,
                turns=True,
                axis="quaternion_component",
            ),
            DispersibleQuantity("tilt", "initial |w|"),
            DispersibleQuantity("tilt_direction", "angle of the initial (w1, w2)", "rad"),
            DispersibleQuantity("turn", "initial z", "rad"),
            DispersibleQuantity(
                "attitude_error",
                "rotation vector, body axes, from the nominal initial attitude",
                "rad",
                turns=True,
                axis="body_axis",
            ),
            DispersibleQuantity(
                "omega",
                "initial angular velocity",
                "rad/s",
                excludes=("rate_error",),
                axis="body_axis",
            ),
            DispersibleQuantity(
                "wheel_momentum",
                "initial momentum of each wheel relative to the body",
                "N m s",
                axis="wheel",
            ),
            DispersibleQuantity(
                "rate_error",
                "initial (ω1, ω2) less the reference of the nominal law",
                "rad/s",
                axis="driven_axis",
            ),
        )
    }
)
"""By name, in the order in which they are applied."""

EXCLUSIVE = tuple((one.name, other) for one in DISPERSIBLE.values() for other in one.excludes)
"""Pairs of quantities that are not dispersed together."""
