"""Builder of the fault-tolerant law from its table of a scenario, with a model of each actuator."""

import dataclasses
import math
from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple, TypeVar, cast

import jax
import numpy as np
from jaxtyping import Float

from jaxsat.control.controller import (
    LawContext,
    MagneticContext,
    ThrusterContext,
    UnsuitableModel,
    WheelContext,
)
from jaxsat.control.diagnosis.diagnosis import Diagnosis
from jaxsat.control.diagnosis.rod_fit import INTERVAL, RodFit, across
from jaxsat.control.diagnosis.thruster_filter import ThrusterFilter, samples_of_torque
from jaxsat.control.diagnosis.wheel_filter import WheelFilter
from jaxsat.control.drift_holds import coasting
from jaxsat.control.fault_tolerant import PARALLEL, FaultTolerant
from jaxsat.control.leaks import Leaks
from jaxsat.control.momentum_fit import MomentumFit
from jaxsat.control.presets import three_slew_settling
from jaxsat.control.pulse_rounding import PulseRounding
from jaxsat.control.quaternion_feedback import QuaternionFeedback
from jaxsat.control.reconfiguration import (
    FailedSet,
    Rank,
    Reconfiguration,
    failed_set,
    failed_sets,
    limit_about,
)
from jaxsat.control.settling_laws import settling_law
from jaxsat.control.supervisor import ThreeSlewSettling
from jaxsat.control.third_axis_band import ThirdAxisBand
from jaxsat.control.tolerant_actuators import AbstractTolerantActuators
from jaxsat.control.tolerant_magnetic import tolerant_magnetic
from jaxsat.control.tolerant_rods import MOST_RODS, TolerantRods
from jaxsat.control.tolerant_thrusters import SettlingLaws, TolerantThrusters
from jaxsat.control.tolerant_wheels import TolerantWheels
from jaxsat.control.two_wheels import TwoWheels
from jaxsat.core.allocation import torque_directions, unit_columns
from jaxsat.core.checks import as_array, as_float
from jaxsat.core.inertia import normal_axes
from jaxsat.spacecraft.environment.disturbances import GravityGradient
from jaxsat.spacecraft.wheels import Wheels

LEAST_NOISE = 1e-3
"""Least noise assumed for a noiseless sensor, over the change by the strongest actuator in a
period."""

LEAST_RATE_NOISE = 1e-3
"""Least noise of a rate assumed for the diagnosis of magnetorquers, over the orbital rate."""

MOMENTUM_UNKNOWN, MOMENTUM_NOISE = 1.0, 2e-4
"""Standard deviations of a total momentum before any sample and of one sample, as rates over the
natural frequency."""

ALONE_WALK, WALK = 0.02, 1e3
"""Random walk of the momentum between updates, over its noise: without external torques by design,
and with thrusters, magnetorquers or a turning frame."""


EVEN = 1e-9
"""Difference of the ratios of two wheels' limits that is treated as none, relative to the
largest."""

Tree = TypeVar("Tree")


class Steps(NamedTuple):
    """Largest change of rate (rad/s) by a minimum pulse, and noise (rad/s) of measured rates."""

    pulse: float
    noise: float


def build_fault_tolerant(values: Mapping[str, Any], context: LawContext) -> FaultTolerant:
    """Build the fault-tolerant law of a table, with a model of each kind of actuator.

    Raises `UnsuitableModel` where what works at the start cannot steer three axes.
    """
    actuators: list[AbstractTolerantActuators] = []
    settles, context = False, _without_idle_wheels(context)
    if context.thrusters is not None:
        thrusters = _tolerant_thrusters(values, context, context.thrusters)
        settles = _settles(thrusters, context.wheels)
        actuators.append(thrusters)
    if context.wheels is not None:
        actuators.append(_tolerant_wheels(values, context, context.wheels))
    return FaultTolerant(
        # The momenta of wheels are made up for with those of their rotors.
        healthy=QuaternionFeedback.from_table(values, context._replace(wheel_axes=None)),
        diagnosis=Diagnosis(
            values["cusum_reference"],
            values["cusum_threshold"],
            values["isolation_margin"],
            uncertainty=values["torque_uncertainty"],
        ),
        actuators=tuple(actuators),
        period=values["period_s"],
        rods=_tolerant_rods(values, context),
        magnetic=tolerant_magnetic(values, context, settles),
        band=_band(values["third_axis_band_rad"], context),
    )


def _settles(thrusters: TolerantThrusters, wheels: WheelContext | None) -> bool:
    """Whether thrusters settle all axes at the start, alone or with the wheels that work."""
    tables = thrusters.reconfiguration
    if _no_wheel_works(wheels):
        return int(np.asarray(tables.rank)[0]) != Rank.LESS
    return _left_with(np.asarray(tables.torque), cast(WheelContext, wheels)) == Rank.THREE_AXES


def _left_with(torque: Float[np.ndarray, "3 m"], wheels: WheelContext) -> Rank:
    """Return what thrusters of these torques (N m) and the wheels that work make together."""
    axes = np.asarray(wheels.wheels.axes)[:, ~wheels.failed]
    return failed_set(np.concatenate([unit_columns(torque), axes, -axes], axis=1), ()).rank


def _no_wheel_works(wheels: WheelContext | None) -> bool:
    return wheels is None or bool(np.all(wheels.failed))


def _without_idle_wheels(context: LawContext) -> LawContext:
    """Return the context with a wheel without momentum given up that leaves thrusters a plane of
    torques.

    Thrusters then fly by two torques, to which one axis of wheels adds nothing.
    """
    wheels, thrusters = context.wheels, context.thrusters
    if wheels is None or thrusters is None or not wheels.still:
        return context
    torque = np.asarray(thrusters.model.torque)
    axes = np.asarray(wheels.wheels.axes)[:, ~wheels.failed]
    planar = failed_set(torque, ()).rank == Rank.PLANE
    if not planar or np.linalg.matrix_rank(axes, tol=PARALLEL) != 1:
        return context
    if _left_with(torque, wheels) == Rank.THREE_AXES:
        return context
    return context._replace(wheels=wheels._replace(failed=np.ones_like(wheels.failed)))


def _band(band: float | None, context: LawContext) -> ThirdAxisBand | None:
    """Return the band of the axis that no wheel drives; None without band, thrusters or wheels."""
    thrusters = context.thrusters
    if band is None or thrusters is None or context.wheels is None:
        return None
    cost, pulse = as_float(thrusters.cost), as_float(thrusters.pulse)
    return ThirdAxisBand(band, thrusters.model.torque, pulse, cost)


def _tolerant_rods(values: Mapping[str, Any], context: LawContext) -> TolerantRods | None:
    if context.magnetic is None:
        return None
    steering = context.magnetic.steering
    usable = np.any(np.asarray(steering.shares) != 0, axis=1)
    fit = _rod_fit(context, values["period_s"]) if len(usable) <= MOST_RODS else None
    return TolerantRods.of(steering, context.delay, fit)


def _rod_fit(context: LawContext, period: float) -> RodFit:
    """Build the filter of losses with the noise of the momentum of body and wheels."""
    steering, body = cast(MagneticContext, context.magnetic).steering, context.model.spacecraft
    model, rate = context.model, float(steering.field.circle.rate)
    if context.gravity_gradient:
        model = dataclasses.replace(model, disturbance=GravityGradient(rate))
    largest = float(np.linalg.eigvalsh(np.asarray(body.inertia))[-1])
    noise = largest * max(context.rate_noise, LEAST_RATE_NOISE * rate)
    if context.wheels is not None:
        noise = math.hypot(noise, np.linalg.norm(_momentum_noise(context.wheels, period)))
    turns = np.arange(8) * np.pi / 4
    fields = steering.field.sampled(turns / rate, turns[:, None])
    return RodFit(
        axes=steering.axes,
        across=across(np.asarray(steering.axes)),
        model=model,
        noise=noise,
        dipole=np.mean(np.asarray(steering.dipole_limit)),
        strength=np.sqrt(np.mean(np.sum(fields**2, axis=-1))),
        span=INTERVAL * 2 * np.pi / rate,
    )


def _tolerant_thrusters(
    values: Mapping[str, Any], context: LawContext, thrusters: ThrusterContext
) -> TolerantThrusters:
    """Build the thrusters with their tables of failed sets.

    A plane whose two torques cannot steer the third axis counts as less than a plane.
    """
    torque = np.asarray(thrusters.model.torque)
    effect = np.asarray(context.model.spacecraft.inverse_inertia) @ torque
    sizes = np.sqrt(np.sum(effect**2, axis=0))
    least = LEAST_NOISE * values["period_s"] * float(sizes.max())
    declared_noise = values["rate_noise_rad_s"]
    noise = max(thrusters.rate_noise, least) if declared_noise is None else declared_noise
    pulse = float(np.max(sizes * thrusters.pulse))
    sets, settling = failed_sets(torque), None
    wheels = None if context.wheels is None else context.wheels.wheels
    if _no_wheel_works(context.wheels):
        sets, settling = _settling(values, context, torque, sets, Steps(pulse, noise))
    if wheels is not None:
        noise = float(np.hypot(noise, _noise_by_wheels(context, values["period_s"])))
    samples = samples_of_torque(noise, values["period_s"], values["natural_frequency_rad_s"])
    return TolerantThrusters(
        filter=ThrusterFilter(context.model, thrusters.model, noise, wheels, samples),
        reconfiguration=Reconfiguration.of(torque, thrusters.cost, sets),
        rounding=PulseRounding(effect, thrusters.pulse),
        settling=settling,
    )


def _noise_by_wheels(context: LawContext, period: float) -> float:
    """Return the rate noise (rad/s) about any axis that noise of all tachometers amounts to."""
    wheels = cast(WheelContext, context.wheels)
    effect = np.asarray(context.model.spacecraft.inverse_inertia) @ np.asarray(wheels.wheels.axes)
    return float(np.sqrt(np.max(np.sum((effect * _momentum_noise(wheels, period)) ** 2, axis=1))))


def _momentum_noise(context: WheelContext, period: float) -> Float[np.ndarray, " m"]:
    """Return the standard deviation of each tachometer (N m s), at least that of `LEAST_NOISE`."""
    least = LEAST_NOISE * period * np.asarray(context.wheels.torque_limit)
    return np.maximum(context.momentum_noise, least)


def _tolerant_wheels(
    values: Mapping[str, Any], law: LawContext, context: WheelContext
) -> TolerantWheels:
    """Build the wheels with the noise of tachometers and of the rates that move their rotors."""
    wheels, noise = context.wheels, _momentum_noise(context, values["period_s"])
    if wheels.rotor_inertia is not None:  # of the part J_w a·ω of two samples
        noise = np.hypot(noise, np.sqrt(2) * np.asarray(wheels.rotor_inertia) * context.rate_noise)
    return TolerantWheels(
        filter=WheelFilter(wheels, as_array(noise)),
        two_wheels=TwoWheels(law.model),
        fit=_momentum_fit(values, law),
        failed_at_start=as_array(np.asarray(context.failed)),
        delay=law.delay,
        uneven=_uneven(wheels),
    )


def _uneven(wheels: Wheels) -> bool:
    """Whether momentum limits of wheels are not in proportion to their torque limits."""
    if wheels.momentum_limit is None or not np.all(np.isfinite(wheels.momentum_limit)):
        return False
    ratios = np.asarray(wheels.momentum_limit) / np.asarray(wheels.torque_limit)
    return bool(np.ptp(ratios) > EVEN * ratios.max())


def _momentum_fit(values: Mapping[str, Any], law: LawContext) -> MomentumFit:
    """Build the momentum filter: a slow random walk where wheels alone act in inertial axes."""
    frequency = values["natural_frequency_rad_s"]
    unknown, noise = MOMENTUM_UNKNOWN * frequency, MOMENTUM_NOISE * frequency
    inertial = not np.any(np.asarray(law.model.orbit.rate))
    alone = inertial and law.thrusters is None and law.magnetic is None
    return MomentumFit(
        law.model.spacecraft, unknown, noise, noise * (ALONE_WALK if alone else WALK)
    )


def _settling(
    values: Mapping[str, Any],
    context: LawContext,
    torque: Float[np.ndarray, "3 m"],
    sets: tuple[FailedSet, ...],
    steps: Steps,
) -> tuple[tuple[FailedSet, ...], SettlingLaws | None]:
    """Return the sets, and the laws of those that leave a plane; None where no set does.

    Raises `UnsuitableModel` where a plane that is left from the start cannot be steered, and no
    magnetorquers are beside it.
    """
    laws: list[tuple[ThreeSlewSettling, np.ndarray, Leaks]] = []
    of_set, final_sets = [], []
    for one in sets:
        place = 0
        if one.directions is not None:
            axes = _plane_axes(context, one.directions)
            limit = limit_about(np.delete(torque, one.failed, axis=1), axes)
            try:
                laws.append(_law(values, context, axes, limit, steps, torque, one.failed))
                place = len(laws) - 1
            except UnsuitableModel:
                if not one.failed and context.magnetic is None:
                    raise
                one = one._replace(rank=Rank.LESS, directions=None)
        final_sets.append(one)
        of_set.append(place)
    if not laws:
        return tuple(final_sets), None
    stacked = _stacked(law for law, _, _ in laws)
    directions = np.stack([directions for _, directions, _ in laws])
    leaks = _stacked(leaks for _, _, leaks in laws)
    return tuple(final_sets), SettlingLaws(stacked, as_array(np.array(of_set)), directions, leaks)


def _stacked(trees: Iterable[Tree]) -> Tree:
    """Stack trees of one structure along a new leading axis; arrays stacked several times are
    shared, so that flight code holds them once."""
    arrays: dict[tuple[int, ...], Any] = {}

    def one(*leaves: Any) -> Any:
        key = tuple(map(id, leaves))
        return arrays[key] if key in arrays else arrays.setdefault(key, as_array(np.stack(leaves)))

    return jax.tree.map(one, *trees)


def _plane_axes(
    context: LawContext, directions: Float[np.ndarray, "3 2"]
) -> Float[np.ndarray, "3 2"]:
    axes, _ = normal_axes(np.asarray(context.model.spacecraft.inertia), directions)
    return axes[:2].T


def _law(
    values: Mapping[str, Any],
    context: LawContext,
    axes: np.ndarray,
    limit: float,
    steps: Steps,
    torque: Float[np.ndarray, "3 m"],
    failed: tuple[int, ...],
) -> tuple[ThreeSlewSettling, np.ndarray, Leaks]:
    """Return the law of three slews in a plane, its torque directions and leaks; raises as
    `build_three_slew`."""
    table = {
        "period_s": values["period_s"],
        "observe_ripple": True,
        "estimate_axes": True,
        "ripple_amplitude_N_m": None,
        "ripple_frequency_rad_s": None,
    }
    own = context._replace(torque_axes=axes, torque_limit=limit)
    law = coasting(settling_law(three_slew_settling, table, own), steps.pulse, steps.noise)
    least = np.asarray(cast(ThrusterContext, context.thrusters).pulse)
    leaks, law = Leaks.of(law, torque, failed, least)
    return law, torque_directions(axes), leaks
