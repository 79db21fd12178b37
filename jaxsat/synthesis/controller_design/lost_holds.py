"""Drift in orbit by errors of the body, and whether laws for two torques can balance it."""

import math
from collections.abc import Iterator

import numpy as np
from jaxtyping import Float

from jaxsat.core.allocation import torque_directions
from jaxsat.core.ranges import SETTLED_W
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.plant import orbit_rate
from jaxsat.scenario.derived import believed_axes
from jaxsat.scenario.dispersion_tables import DistributionTable
from jaxsat.scenario.domain import dimensionless_numbers
from jaxsat.scenario.holding import RestDrift, rest_drift
from jaxsat.scenario.quantities import inertia_matrix

STEP = 1e-3
"""Step of differences, relative to a moment or in rad."""

LARGE = 2.576
"""Standard deviations within which 99 % of a normal distribution lie."""


def lost_holds(scenario: Scenario) -> str | None:
    """Return sentences if over 1 % of the dispersed bodies drift beyond balance, else None. Drift
    is taken as normal, and the limit as that of the nominal body."""
    if orbit_rate(scenario) == 0 or scenario.dispersion is None:
        return None
    nominal, spread = _nominal_drift(scenario), drift_spread(scenario)
    left = nominal.balanced - abs(nominal.drift)
    if spread == 0 or left >= LARGE * spread:
        return None
    c = dimensionless_numbers(scenario)["coupling"]
    return (
        f"In orbit with c = {c:.2g}, errors of inertia and axes leave a drift about the unactuated "
        f"axis of {spread:.1e} rad/s² (standard deviation). Attitudes within the tolerances "
        f"balance {nominal.attitude:.1e} rad/s² and oscillations of the tolerated rate "
        f"{nominal.oscillation:.1e}, together {left / spread:.2g} standard deviations. No law "
        "of jaxsat holds a body beyond that for ever: a hold ends after some time and begins "
        "again, so fewer than 99 % of the cases may settle, however long the run. A better known "
        "inertia helps."
    )


def holds_last(scenario: Scenario) -> bool:
    """Whether oscillations of the tolerated rate balance the drift of 99 % of the dispersed bodies,
    if it is normal, so that no balancing attitude is needed."""
    if orbit_rate(scenario) == 0:
        return True
    nominal, spread = _nominal_drift(scenario), drift_spread(scenario)
    return abs(nominal.drift) + LARGE * spread <= nominal.oscillation


def _nominal_drift(scenario: Scenario) -> RestDrift:
    return _drift(scenario, _inertia(scenario), believed_axes(scenario))


def drift_spread(scenario: Scenario) -> float:
    """Return the standard deviation (rad/s²) of the drift at rest over errors of inertia and axes.

    It is linear in their independent components: the root of the sum of squares.
    """
    inertia, axes = _inertia(scenario), believed_axes(scenario)
    changes = _changes(scenario, inertia, axes)
    return math.sqrt(
        sum(
            (sigma * (_drift(scenario, *ahead).drift - _drift(scenario, *behind).drift)) ** 2
            for sigma, ahead, behind in changes
        )
    ) / (2 * STEP)


Body = tuple[Float[np.ndarray, "3 3"], Float[np.ndarray, "3 2"]]


def _changes(
    scenario: Scenario, inertia: Float[np.ndarray, "3 3"], axes: Float[np.ndarray, "3 2"]
) -> Iterator[tuple[float, Body, Body]]:
    """Yield each component's standard deviation, and the body at plus and minus `STEP` of it."""
    table, unit = scenario.dispersion, np.eye(3)
    if table is None:
        return
    for i, sigma in enumerate(_deviations(table.inertia, 3)):
        bodies = []
        for step in (STEP, -STEP):
            root = np.sqrt(1 + step * unit[i])
            bodies.append((inertia * np.outer(root, root), axes))
        yield sigma, *bodies
    pairs = ((0, 1), (0, 2), (1, 2))
    for (i, j), sigma in zip(pairs, _deviations(table.products_of_inertia, 3), strict=True):
        more = (
            STEP
            * np.diag(inertia).min()
            * (np.outer(unit[i], unit[j]) + np.outer(unit[j], unit[i]))
        )
        yield sigma, (inertia + more, axes), (inertia - more, axes)
    directions = torque_directions(axes)
    normal = np.cross(directions[:, 0], directions[:, 1])
    for k, sigma in enumerate(_deviations(table.misalignment_rad, 2)):
        more = STEP * np.outer(normal, unit[k, :2])
        yield sigma, (inertia, axes + more), (inertia, axes - more)


def _deviations(table: DistributionTable | None, count: int) -> Float[np.ndarray, " n"]:
    """Return standard deviations of the first `count` components; zeros without a distribution."""
    if table is None:
        return np.zeros(count)
    if table.distribution == "discrete":
        values, weights = np.array(table.values), np.array(table.weights, float)
        mean = np.average(values, weights=weights)
        sigma = math.sqrt(np.average((values - mean) ** 2, weights=weights))
    elif table.distribution == "uniform":
        sigma = (np.array(table.high) - np.array(table.low)) / math.sqrt(12)
    else:
        sigma = np.array(table.sigma)
    sigma = np.asarray(sigma, float)
    return np.broadcast_to(sigma if sigma.ndim == 0 else sigma[:count], count)


def _inertia(scenario: Scenario) -> Float[np.ndarray, "3 3"]:
    return inertia_matrix(scenario.spacecraft.inertia_kg_m2)


def _drift(
    scenario: Scenario, inertia: Float[np.ndarray, "3 3"], axes: Float[np.ndarray, "3 2"]
) -> RestDrift:
    settled = scenario.settled
    tilt = 2 * math.atan(SETTLED_W) if settled.tilt_rad is None else settled.tilt_rad
    return rest_drift(
        inertia,
        torque_directions(axes),
        orbit_rate(scenario),
        scenario.disturbance.gravity_gradient,
        (tilt, settled.turn_rad, settled.rate_rad_s),
    )
