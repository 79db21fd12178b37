"""Cautions about a scenario outside the verified domain of its law."""

import math
from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from jaxsat.core.allocation import torque_directions, usable_share
from jaxsat.core.declaration.domain import NUMBERS
from jaxsat.core.inertia import normal_axes
from jaxsat.core.ranges import SETTLED_RATE
from jaxsat.scenario.derived import believed_axes, torque_limit
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.holding import nearest_held, rest_drift
from jaxsat.scenario.parts.wheels import free_inertia
from jaxsat.scenario.schema import Scenario

OSCILLATION_SHARE = 0.5
"""Of the drift that sines of the tolerated rate stop: as much as the laws do stop at the target."""

MARGIN = 0.01
"""Relative excess of a number over the verified range up to which it is not reported."""


def domain_cautions(scenario: Scenario) -> Iterator[Issue]:
    """Yield a caution for each dimensionless number outside the verified range of the law."""
    declaration = scenario.law.declaration
    if not declaration.domain:
        return
    numbers = dimensionless_numbers(scenario)
    for sweep in declaration.domain:
        value, (low, high) = numbers.get(sweep.number), sweep.verified
        if value is None or low * (1 - MARGIN) <= value <= high * (1 + MARGIN):
            continue
        meaning, key = NUMBERS[sweep.number]
        measurement = sweep.beyond(value)
        evidence = "beyond it nothing was measured"
        if measurement is not None:
            evidence = f"at {measurement[0]:.3g} {measurement[1]:.0%} of the hard cases settled"
        yield Issue(
            tuple(key.split(".")),
            f"should give {meaning} from {low:.3g} to {high:.3g}, where the law "
            f'"{scenario.control.law}" was verified: {evidence}, got {value:.3g}',
            (("control", "law"), ("spacecraft",)),
        )


def dimensionless_numbers(scenario: Scenario) -> dict[str, float]:
    """Values of `NUMBERS` for a scenario with two torques, by the law's model of the plant."""
    inertia, frame, (first, second, third) = believed_normal_form(scenario)
    axes = believed_axes(scenario)
    across = frame[:2] @ inertia @ frame[2]
    mean = math.sqrt(first * second)
    numbers = {
        "coupling": (first - second) / third,
        "moment_ratio": mean / third,
        "lean": float(np.hypot(*across)) / third,
    }
    if axes.shape[1] == 2:
        numbers["axes_angle"] = math.acos(min(1.0, abs(float(axes[:, 0] @ axes[:, 1]))))
    torque = torque_limit(scenario)
    numbers["disturbance_rate"] = _disturbance_rate(scenario, inertia) / SETTLED_RATE
    if torque is not None:
        limit = torque * usable_share(axes, frame[:2])
        numbers |= _timed_numbers(scenario, frame[2], math.sqrt(mean / limit), limit)
    return numbers


def _disturbance_rate(scenario: Scenario, inertia: Float[np.ndarray, "3 3"]) -> float:
    """|J⁻¹ (a1 / Ω1, a2 / Ω2, a3 / Ω3)| of a_i sin(Ω_i t), rad/s; terms with Ω = 0 are omitted."""
    amplitude, frequency = scenario.disturbance.amplitude_N_m, scenario.disturbance.frequency_rad_s
    impulses = [a / w if w else 0.0 for a, w in zip(amplitude, frequency, strict=True)]
    return float(np.linalg.norm(np.linalg.solve(inertia, impulses)))


def _timed_numbers(
    scenario: Scenario, normal: Float[np.ndarray, "3"], unit: float, limit: float
) -> dict[str, float]:
    """Dimensionless numbers that involve the time unit τ (s) and the torque limit (N m)."""
    table = scenario.disturbance
    numbers = {
        "orbit_rate": abs(scenario.orbit.rate()) * unit,
        "disturbance": float(np.linalg.norm(table.amplitude_N_m)) / limit,
        "constant_disturbance": abs(float(normal @ np.array(table.constant_N_m))) / limit,
    }
    period = getattr(scenario.control, "period_s", None)
    if period is not None:
        numbers["period"] = period / unit
    if scenario.sampling is not None:
        numbers["rate_noise"] = scenario.sampling.rate_noise_rad_s * unit
        numbers["attitude_noise"] = scenario.sampling.attitude_noise_rad
    return numbers


def held_turn(
    scenario: Scenario, inertia: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "3"] | None:
    """Smallest rotation vector (rad) from the target to an attitude that a body (kg m²) with two
    torques can hold, None without one: zeros where an oscillation stops the drift at the target."""
    rate, gradient = scenario.orbit.rate(), scenario.disturbance.gravity_gradient
    directions = torque_directions(believed_axes(scenario))
    tolerances = (0.0, 0.0, scenario.settled.rate_rad_s)
    rest = rest_drift(inertia, directions, rate, gradient, tolerances)
    if abs(rest.drift) <= OSCILLATION_SHARE * rest.oscillation:
        return np.zeros(3)
    return nearest_held(inertia, np.cross(*directions.T), gradient)


def believed_normal_form(scenario: Scenario):
    """Inertia of the law's model, its axes x, y, n in rows, and S1, S2, n·Jn, kg m²."""
    model = getattr(scenario.control, "model", None)
    moments = getattr(model, "inertia_kg_m2", None) or scenario.spacecraft.inertia_kg_m2
    inertia = free_inertia(moments, scenario.wheel)
    return inertia, *normal_axes(inertia, torque_directions(believed_axes(scenario)))
