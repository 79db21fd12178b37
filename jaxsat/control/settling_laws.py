"""How the laws that settle are built of a table, with the gains tuned for a limit."""

from collections.abc import Callable, Mapping
from operator import attrgetter
from typing import Any, TypeVar, cast

import equinox as eqx
import numpy as np

from jaxsat.checks import as_float
from jaxsat.control.context import LawContext, UnsuitableModel
from jaxsat.control.fine import OscillatorySettling
from jaxsat.control.presets import oscillatory_settling, ripple_filter, three_slew_settling
from jaxsat.control.supervisor import ThreeSlewSettling
from jaxsat.declaration.settling import OSCILLATORY


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
    model, limit = context.model, cast(float, context.torque_limit)
    amplitude, frequency = values["ripple_amplitude_N_m"], values["ripple_frequency_rad_s"]
    ripple = ripple_filter(
        model,
        limit,
        context.disturbance_amplitude[2] if amplitude is None else amplitude,
        context.disturbance_frequency[2] if frequency is None else frequency,
        values["period_s"],
    )
    try:
        return make(
            model,
            limit,
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
