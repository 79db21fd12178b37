"""Wheels that coast, with and without momentum, against exact brackets and attitudes by SciPy."""

from fractions import Fraction

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation
from sympy import Matrix

from controllability.oracles import GibbsAlgebra
from jaxsat.controllability.actuators import actuator_set
from jaxsat.controllability.judging import judge, judge_once_stopped

RNG = np.random.default_rng(11)
STILL = [0, 0, 0]


def bodies(count):
    """Inertias of small whole numbers, three axes that span space, and a momentum."""
    for _ in range(count):
        products = np.triu(RNG.integers(-1, 2, (3, 3)), 1)
        inertia = np.diag(RNG.permutation([9, 5, 7])) + products + products.T
        axes = RNG.integers(-3, 4, (3, 3))
        while abs(np.linalg.det(axes)) < 0.5:
            axes = RNG.integers(-3, 4, (3, 3))
        yield inertia, axes, RNG.permutation([1, 2, -3])


BODIES = list(bodies(4))


def vehicle(thrusters, wheels, momentum, coasting, two_sided=True):
    """What is left beside three wheels along body axes whose motors are dead."""
    everything = actuator_set(
        np.array(thrusters, float).reshape(-1, 3).T,
        two_sided=two_sided,
        wheel_axes=np.hstack([np.array(wheels, float).reshape(-1, 3).T, np.eye(3)]),
        momentum=momentum,
        stored=[*np.zeros(len(wheels)), *coasting],
    )
    return everything.only(range(len(thrusters) + len(wheels)))


def state_with(inertia, wheels, momentum, coasting):
    """Gibbs vector, ω and h of a total momentum in body axes, in no special position."""
    gibbs = [Fraction(1, 3), Fraction(-1, 2), Fraction(2, 5)]
    stored = [Fraction(2, 3), Fraction(-1, 2), Fraction(5, 7)][: len(wheels)]
    rest = [
        int(momentum[i])
        - int(coasting[i])
        - sum(h * int(a[i]) for h, a in zip(stored, wheels, strict=True))
        for i in range(3)
    ]
    omega = Matrix(inertia.tolist()).LUsolve(Matrix(rest))
    return [*gibbs, *[Fraction(int(x.p), int(x.q)) for x in omega], *stored]


@pytest.mark.slow
@pytest.mark.parametrize("count", [1, 2, 3])
@pytest.mark.parametrize("spun", [False, True])
@pytest.mark.parametrize("coasts", [False, True])
def test_the_rank_of_wheels_on_their_level_set_is_that_of_exact_brackets(count, spun, coasts):
    for inertia, axes, momentum in BODIES:
        wheels = axes[:count].tolist()
        total = momentum if spun else STILL
        coasting = [2, -1, 1] if coasts else STILL
        found = judge(inertia, vehicle([], wheels, total, coasting))
        algebra = GibbsAlgebra(inertia.tolist(), [], wheels, coasting)
        state = state_with(inertia, wheels, total, coasting)
        assert found.level_set is not None
        assert algebra.rank_at(state, 6 - count) == found.rank == found.level_set.rank
        assert found.dimension == 3 + count


@pytest.mark.slow
def test_by_drift_is_rank_6_exactly_and_a_drift_that_returns():
    """Volume and energy are kept whatever coasts; the rank that is told is reached."""
    for number, (inertia, axes, coasting) in enumerate(BODIES):
        torques = axes[: 1 + number % 2].tolist()
        found = judge(inertia, vehicle(torques, [], coasting, coasting))
        stopped = judge_once_stopped(found)
        assert stopped is not None
        algebra = GibbsAlgebra(inertia.tolist(), torques, [], coasting)
        assert GibbsAlgebra(inertia.tolist(), torques).closure_rank() == stopped.rank
        assert algebra.closure_rank() >= found.rank == 6
        assert found.verdict == "by drift"
        assert stopped.verdict == ("by drift" if len(torques) == 1 else "controllable")
        gibbs, omega = algebra.symbols[:3], algebra.symbols[3:]
        along = sum(r * w for r, w in zip(gibbs, omega, strict=True))
        assert algebra.divergence() == 2 * along  # of Haar measure, (1 + ρ²)⁻² dρ, none
        momentum = [sum(int(j) * w for j, w in zip(row, omega, strict=True)) for row in inertia]
        assert sum(h * w for h, w in zip(momentum, algebra.drift[3:], strict=True)) == 0


@pytest.mark.slow
def test_what_coasts_may_add_to_a_rank_of_5():
    """Two equal moments and torques across the axis of symmetry: nothing is promised."""
    inertia, torques, coasting = np.diag([4, 4, 2]), [[1, 0, 0], [0, 1, 0]], [1, 2, 2]
    found = judge(inertia, vehicle(torques, [], coasting, coasting))
    assert (found.rank, found.verdict) == (5, "not decided")
    assert GibbsAlgebra(inertia.tolist(), torques).closure_rank() == 5
    assert GibbsAlgebra(inertia.tolist(), torques, [], coasting).closure_rank() == 6


@pytest.mark.slow
def test_a_wheel_and_thrusters_beside_one_that_coasts():
    """What brackets reach of attitude and rate is no less than is told."""
    for inertia, axes, coasting in BODIES:
        found = judge(inertia, vehicle(axes[:1].tolist(), axes[1:2].tolist(), coasting, coasting))
        algebra = GibbsAlgebra(inertia.tolist(), axes[:1].tolist(), axes[1:2].tolist(), coasting)
        assert algebra.rank_at([Fraction(0)] * 7, 4) - 1 >= found.rank  # with the momentum h


def nearest_rest(wheels, momentum, coasting):
    """How near CH - β comes to the wheels' axes over all attitudes C, N m s."""
    axes = np.array(wheels, float).T
    across = np.eye(3) - axes @ np.linalg.pinv(axes)

    def left(turn):
        return across @ (Rotation.from_rotvec(turn).apply(momentum) - coasting)

    starts = RNG.normal(size=(20, 3))
    return min(np.linalg.norm(least_squares(left, one, xtol=1e-15).fun) for one in starts)


@pytest.mark.slow
def test_rest_is_possible_where_it_is_told():
    told = set()
    for size in (0.0, 0.1, 0.5, 2.0):
        for _, axes, momentum in BODIES:
            wheels, coasting = axes[:2].tolist(), axes[2] * size
            found = judge(np.diag([9, 5, 7]), vehicle([], wheels, momentum, coasting))
            assert found.level_set is not None
            gap = nearest_rest(wheels, momentum, coasting)
            assert found.level_set.rests == (gap < 1e-6), (size, gap)
            assert found.verdict == ("some attitudes" if gap < 1e-6 else "uncontrollable")
            told.add(found.verdict)
    assert len(told) == 2


def test_friction_stops_a_wheel_and_leaves_the_total_momentum():
    """What `once_stopped` is of: β goes to zero, and Jω + Ah of all stays in inertial axes."""
    inertia = BODIES[0][0]
    stored, axis = 0.7, np.array([1.0, 2.0, 2.0]) / 3

    def rate(t, y):
        c, omega, h = y[:9].reshape(3, 3), y[9:12], y[12]
        x, y, z = omega
        cross = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
        total = inertia @ omega + axis * h
        spin = np.linalg.solve(inertia, axis * 0.3 * h - np.cross(omega, total))
        return np.concatenate([(-cross @ c).ravel(), spin, [-0.3 * h]])

    start = np.concatenate([np.eye(3).ravel(), [0.1, -0.2, 0.05], [stored]])
    run = solve_ivp(rate, (0, 100), start, "DOP853", rtol=1e-10, atol=1e-13)
    end = run.y[:, -1]
    assert abs(end[12]) < 1e-12 * stored
    total = inertia @ start[9:12] + axis * stored
    now = end[:9].reshape(3, 3).T @ (inertia @ end[9:12])
    np.testing.assert_allclose(now, total, atol=1e-7)
    everything = actuator_set(
        np.eye(3)[:, :2], two_sided=True, wheel_axes=axis[:, None], momentum=total, stored=[stored]
    )
    left = everything.only([0, 1])
    np.testing.assert_allclose(left.coasting, axis * stored, rtol=1e-15)
    np.testing.assert_array_equal(left.once_stopped.momentum, total)
    np.testing.assert_array_equal(left.once_stopped.coasting, STILL)
    stopped = judge_once_stopped(judge(inertia, left))
    assert stopped is not None
    assert stopped.verdict == judge(inertia, left.once_stopped).verdict == "controllable"
