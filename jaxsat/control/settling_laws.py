"""Builders of the settling laws from their tables of a scenario."""

from collections.abc import Callable, Mapping
from operator import attrgetter
from typing import Any, TypeVar, cast

import equinox as eqx
import numpy as np
from jaxtyping import Float

from jaxsat.control.controller import LawContext, UnsuitableModel
from jaxsat.control.drift_holds import balancing
from jaxsat.control.fine import OscillatorySettling
from jaxsat.control.normal_form import NormalForm
from jaxsat.control.presets import oscillatory_settling, ripple_filter, three_slew_settling
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.control.supervisor import ThreeSlewSettling
from jaxsat.core.allocation import torque_directions, usable_share
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.law import LawDeclaration
from jaxsat.core.declaration.settling import HOLDING_AMPLITUDE, OSCILLATORY, PLANNED, THREE_SLEW


def build_oscillatory(values: Mapping[str, Any], context: LawContext) -> OscillatorySettling:
    """Build the oscillatory law; raises `UnsuitableModel` where it cannot steer three axes."""
    return _with_gains(settling_law(oscillatory_settling, values, context), OSCILLATORY, values)


def build_three_slew(values: Mapping[str, Any], context: LawContext) -> ThreeSlewSettling:
    """Build the law of three slews; raises as `build_oscillatory` does."""
    law = _with_gains(settling_law(three_slew_settling, values, context), THREE_SLEW, values)
    return balancing(law, context.rate_noise)


def build_planned(values: Mapping[str, Any], context: LawContext) -> AbstractSampledController:
    """Build the planning law; raises as `build_oscillatory` does."""
    from jaxsat.control.planned import planned_settling  # the other laws have no use for plans

    settling = settling_law(three_slew_settling, values, context)
    return _with_gains(planned_settling(settling), PLANNED, values)


def _ripple_about(normal: Float[np.ndarray, "3"], context: LawContext) -> tuple[float, float]:
    """Return amplitude (N m) and frequency (rad/s) of the torque with the most ripple about n."""
    amplitudes = np.abs(normal * np.array(context.disturbance_amplitude)).tolist()
    frequencies = context.disturbance_frequency
    sizes = [a / abs(f) if f else 0.0 for a, f in zip(amplitudes, frequencies, strict=True)]
    most = max(range(3), key=lambda axis: (sizes[axis], abs(normal[axis])))
    return amplitudes[most], frequencies[most]


Settling = TypeVar("Settling", bound=AbstractSampledController)


def _with_gains(law: Settling, declaration: LawDeclaration, values: Mapping[str, Any]) -> Settling:
    for key, place in declaration.tunable.items():
        if values.get(key) is not None:
            law = eqx.tree_at(attrgetter(place), law, as_float(values[key]))
    return law


def settling_law(
    make: Callable[..., Settling], values: Mapping[str, Any], context: LawContext
) -> Settling:
    """Build a settling law by `make`; raises as `build_oscillatory` does."""
    model, axes = context.model, context.torque_axes
    directions = torque_directions(axes)
    form = NormalForm.of(model, directions)
    limit = cast(float, context.torque_limit) * usable_share(axes, np.asarray(form.axes)[:2])
    amplitude, frequency = _ripple_about(np.asarray(form.axes)[2], context)
    own_amplitude = values["ripple_amplitude_N_m"]
    own_frequency = values["ripple_frequency_rad_s"]
    try:
        ripple = ripple_filter(
            form,
            limit,
            amplitude if own_amplitude is None else own_amplitude,
            frequency if own_frequency is None else own_frequency,
            values["period_s"],
        )
        return make(
            model,
            limit,
            observe=values["observe_ripple"],
            estimate=values["estimate_axes"],
            period=values["period_s"],
            ripple=ripple,
            directions=directions,
            holding_amplitude=values.get(HOLDING_AMPLITUDE),
            gravity_gradient=context.gravity_gradient,
        )
    except ValueError as error:
        first, second, _ = np.asarray(form.moments)
        raise UnsuitableModel(
            "inertia",
            "can steer the axis without a torque, which it does by different moments of inertia "
            "about the two others (S1 and S2 of the normal form), "
            f"got S1 = {first:.6g} and S2 = {second:.6g} kg m²",
        ) from error
