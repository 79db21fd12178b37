"""Plans that end within tolerances: their barriers against finite differences and dense systems."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from control.planning.spacecraft import PAPER, flown, planner, turned_about_x
from jaxsat.control.planning.barriers import (
    BALLS,
    TO_BOUNDARY,
    EndTerms,
    barrier,
    inside,
    longest_place_step,
    slacks,
)
from jaxsat.control.planning.planner import PlanStatus
from jaxsat.control.planning.riccati import ARRIVAL_WEIGHT, _arrival_terms, _place_change
from jaxsat.core.tolerances import Tolerances

RANDOM = np.random.default_rng(4)
PLACE = np.array([0.3, -0.6, 0.8, 0.1, 0.2, -0.7])
MU = jnp.array(0.02)


def terms(radii=(0.1, 0.05, 0.008)):
    place = jnp.asarray(PLACE)
    return EndTerms.of(place, MU / slacks(place), jnp.asarray(radii), MU)


def test_terms_are_derivatives_of_the_barrier():
    """On the central path, by central differences."""
    found, step = terms(), 1e-4
    units = step * np.eye(6)
    cost = lambda place: float(barrier(jnp.asarray(place), MU))  # noqa: E731
    gradient = [(cost(PLACE + unit) - cost(PLACE - unit)) / (2 * step) for unit in units]
    hessian = [
        [
            (cost(PLACE + a + b) - cost(PLACE + a - b) - cost(PLACE - a + b) + cost(PLACE - a - b))
            / (4 * step**2)
            for a in units
        ]
        for b in units
    ]
    np.testing.assert_allclose(found.gradient, gradient, atol=1e-6)
    np.testing.assert_allclose(found.hessian, hessian, atol=1e-5)


@pytest.mark.parametrize("radii", [(0.1, 0.05, 0.008), (1e-6, 2.0, 1e-4)])
def test_elimination_of_the_place(radii):
    """Stationary in e: λ (m - R e) + W |m - R e|² / 2 and barrier, where it misses by m."""
    of_end, missed, known = terms(radii), RANDOM.normal(size=6), RANDOM.normal(size=6)
    weight, multipliers = _arrival_terms(jnp.asarray(known), of_end)
    change = np.asarray(_place_change(jnp.asarray(known), jnp.asarray(missed), of_end))
    size = np.diag(BALLS @ np.array(radii))
    kkt = np.block(
        [[np.asarray(of_end.hessian), -size], [size, np.eye(6) / ARRIVAL_WEIGHT]]
    )  # of e and the new multipliers λ + W (m - R e)
    right = np.concatenate([-np.asarray(of_end.gradient), missed + known / ARRIVAL_WEIGHT])
    exact = np.linalg.solve(kkt, right)
    np.testing.assert_allclose(change, exact[:6], rtol=1e-6, atol=1e-9)
    np.testing.assert_allclose(multipliers + weight @ missed, exact[6:], rtol=1e-6, atol=1e-8)


def test_a_step_leaves_a_share_of_every_slack():
    place = jnp.asarray(PLACE)
    for change in RANDOM.normal(size=(20, 6)):
        step = float(longest_place_step(place, jnp.asarray(change)))
        left = np.asarray(slacks(place + step * change) / slacks(place))
        assert left.min() >= (1 - TO_BOUNDARY) * (1 - 1e-9)
        assert step == 1.0 or left.min() == pytest.approx(1 - TO_BOUNDARY)
    assert longest_place_step(place, jnp.zeros(6)) == 1.0


def test_what_is_outside_is_drawn_inside():
    place = np.asarray(inside(jnp.array([3.0, 4.0, -0.5, 0.0, 0.0, 0.0])))
    np.testing.assert_allclose(place, [0.54, 0.72, -0.5, 0, 0, 0])


@pytest.mark.slow
def test_a_turn_until_settled():
    """Full thrust and full brake down to the tilt and the rate allowed; see tests of bounds."""
    tilt, rate, angle, limit = 0.05, 0.004, 0.5, 5.0
    made = planner(tolerances=Tolerances(np.tan(tilt / 2), 0.02, rate))
    start = turned_about_x(angle, 0.0)
    plan = eqx.filter_jit(made.quickest)(jnp.array(0.0), start)
    acceleration = limit / PAPER[0, 0]
    speeding = np.sqrt((angle - tilt + rate**2 / (2 * acceleration)) / acceleration)
    exact = 2 * speeding - rate / acceleration
    assert plan.status == PlanStatus.SOLVED
    assert plan.duration == pytest.approx(exact, rel=3e-3)
    end = flown(made, start, plan)
    assert end.tilt == pytest.approx(tilt, rel=0.01)
    assert end.rate == pytest.approx(rate, rel=0.01)
    assert abs(end.turn) < 0.02
