"""What the laws that settle declare, and how they are built with the gains tuned for a limit."""

from collections.abc import Callable, Mapping
from operator import attrgetter
from typing import Any, TypeVar

import equinox as eqx
import numpy as np

from jaxsat.checks import as_float
from jaxsat.control.declaration import LawContext, LawDeclaration, UnsuitableModel
from jaxsat.control.fine import OscillatorySettling
from jaxsat.control.presets import (
    TUNED_LIMITS,
    TUNED_PERIOD,
    equivalent_limit,
    oscillatory_settling,
    ripple_filter,
    three_slew_settling,
)
from jaxsat.control.supervisor import ThreeSlewSettling
from jaxsat.declaration import number, switch
from jaxsat.ranges import SECONDS


def tuned_limits(moments: tuple[float, ...]) -> tuple[float, ...]:
    """The torque limits (N m) that the gains are tuned for, for a body of these moments (kg m²)."""
    scale = equivalent_limit(moments, 1.0)
    return tuple(one / scale for one in TUNED_LIMITS)


_COMMON_KEYS = (
    switch(
        "observe_ripple", "Whether the ripple of d3 is observed and left out of the feedback", True
    ),
    number(
        "ripple_frequency_rad_s",
        "Frequency of d3 that the controller believes; left out, that of the disturbance",
        "rad/s",
        above=0,
        default=None,
    ),
    number(
        "ripple_amplitude_N_m",
        "Amplitude of d3 that the controller expects; left out, that of the disturbance",
        "N m",
        at_least=0,
        default=None,
    ),
    switch(
        "estimate_axes", "Whether leaning thruster axes and the inertia ratio are estimated", True
    ),
    number(
        "period_s",
        "Time between two runs of the controller; the gains are tuned for 0.1",
        "s",
        at_least=SECONDS.low,
        at_most=SECONDS.high,
        default=TUNED_PERIOD,
    ),
)


def _gain(name: str, meaning: str, unit: str, place: str):
    place = f"fine.oscillator.{place}"
    return number(name, meaning, unit, above=0, default=None, tunable=place)


OSCILLATORY = LawDeclaration(
    summary="oscillate about the driven axes until all is small, then regulate.\n\n"
    "Gains that are left out are those tuned for torque limits of 1, 5 and 20 N m, interpolated in "
    "between",
    keys=(
        _gain("frequency_rad_s", "Frequency ν of the oscillation", "rad/s", "frequency"),
        _gain("tilt_gain", "Gain k on the tilt", "1/s", "tilt_gain"),
        _gain("rate_gain", "Gain kω on the rate errors", "1/s", "rate_gain"),
        _gain(
            "largest_amplitude_rad_s",
            "Largest amplitude ρm of the oscillation",
            "rad/s",
            "largest_amplitude",
        ),
        _gain("ratio", "How the oscillation is shared out, r", "1", "ratio"),
        _gain("k3", "Gain of the slow motion about the third axis", "1/s", "demand.k3"),
        _gain("damping", "Damping ratio ζ of that motion", "1", "demand.damping"),
        *_COMMON_KEYS,
    ),
    needs_torque_limit=True,
    needs_unequal_moments=True,
    tuned_limits=tuned_limits,
)

THREE_SLEW = LawDeclaration(
    summary="stop, three slews about the driven axes, oscillate, regulate.\n\n"
    "The gains are tuned for torque limits of 1, 5 and 20 N m and interpolated in between",
    keys=_COMMON_KEYS,
    needs_torque_limit=True,
    needs_unequal_moments=True,
    tuned_limits=tuned_limits,
)


def build_oscillatory(values: Mapping[str, Any], context: LawContext) -> OscillatorySettling:
    """The oscillatory law of a table; raises `UnsuitableModel` where it cannot hold an attitude."""
    law = _built(oscillatory_settling, values, context)
    for key, place in OSCILLATORY.tunable.items():
        if values[key] is not None:
            law = eqx.tree_at(attrgetter(place), law, as_float(values[key]))
    return law


def build_three_slew(values: Mapping[str, Any], context: LawContext) -> ThreeSlewSettling:
    """The law of three slews of a table; raises as `build_oscillatory` does."""
    return _built(three_slew_settling, values, context)


Made = TypeVar("Made", OscillatorySettling, ThreeSlewSettling)


def _built(make: Callable[..., Made], values: Mapping[str, Any], context: LawContext) -> Made:
    model = context.model
    amplitude, frequency = values["ripple_amplitude_N_m"], values["ripple_frequency_rad_s"]
    ripple = ripple_filter(
        model,
        context.disturbance_amplitude[2] if amplitude is None else amplitude,
        context.disturbance_frequency[2] if frequency is None else frequency,
    )
    try:
        return make(
            model,
            context.torque_limit,
            observe=values["observe_ripple"],
            estimate=values["estimate_axes"],
            period=values["period_s"],
            ripple=ripple,
        )
    except ValueError as error:
        first, second, _ = np.asarray(model.spacecraft.moments)
        rate = float(model.orbit.rate)
        raise UnsuitableModel(
            "inertia" if rate > 0 else "orbit_rate",
            "can hold the attitude, which it does by J1 apart from J2 and an orbit rate above 0, "
            f"got J1 = {first:.6g} and J2 = {second:.6g} kg m², "
            f"{rate:.6g} rad/s ({str(error).rstrip('.')})",
        ) from error
