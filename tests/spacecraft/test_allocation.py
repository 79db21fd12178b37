"""One allocation for wheels, thrusters and rods, against SciPy's programmes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

from helpers.thruster_layouts import allocated, pairs, thruster_set
from jaxsat.compiler import Mapped
from jaxsat.core.attitude import Quaternion
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.allocation import MomentumPrice, allocate, allocate_unloading
from jaxsat.spacecraft.bounded_least_squares import least_squares_within
from jaxsat.spacecraft.distribution import Direct, WheelsFirst
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.effector import Reach
from jaxsat.spacecraft.modulation import PulseWidth
from jaxsat.spacecraft.pulsed_thrusters import PulsedThrusters
from jaxsat.spacecraft.thrusters import Thrusters
from jaxsat.spacecraft.wheels import Wheels

AMOUNTS = (0.3, 0.9, 1.0, 1.5, 10.0)
"""Of the greatest torque in a direction: within, at and beyond what can be made."""


def mixed(rng, wheels, thrusters, rods):
    """Columns, bounds and prices: wheels of either sign, thrusters that push, rods across a field.

    Some have failed, some are stuck, and some do less one way than the other.
    """
    axes = rng.normal(size=(3, wheels)) * [[1.0], [1.0], [rng.choice([1.0, 1.0, 1e-3, 0.0])]]
    push = rng.normal(size=(3, (thrusters + 1) // 2)) * rng.uniform(0.3, 3)
    push = np.hstack([push, -push])[:, :thrusters] if rng.random() < 0.5 else push
    push = np.hstack([push, rng.normal(size=(3, thrusters - push.shape[1]))])
    across = np.cross(np.eye(3)[:rods], rng.normal(size=3)).T.reshape(3, rods)
    count = wheels + thrusters + rods
    two_sided = np.r_[np.ones(wheels), np.zeros(thrusters), np.ones(rods)]
    high = rng.choice([1.0, 1.0, 0.2, 3.0], size=count)
    low = -high * two_sided * rng.choice([1.0, 1.0, 0.3], size=count)
    dead, stuck = rng.random((2, count)) < 0.1
    high, low = np.where(dead, 0.0, high), np.where(dead, 0.0, low)
    level = low + (high - low) * rng.random(count)
    low, high = np.where(stuck, level, low), np.where(stuck, level, high)
    price = np.r_[np.zeros(wheels), rng.choice([1.0, 1.3, 2.0], size=thrusters), np.zeros(rods)]
    return np.hstack([axes, push, across]) / np.sqrt(3), low, high, price


def programme(columns, low, high, aim, torque, others=None):
    """The uses with the least `aim` that make a torque, with a fraction of `others` if given."""
    count = len(low)
    more = np.zeros((3, 1)) if others is None else -others[:, None]
    found = linprog(
        aim,
        A_eq=np.hstack([columns, more]),
        b_eq=torque,
        bounds=[*zip(low, high, strict=True), (0, 1 if others is not None else 0)],
        options={"primal_feasibility_tolerance": 1e-10, "dual_feasibility_tolerance": 1e-10},
    )
    assert found.status == 0, (found.message, count)
    return found


def part(columns, low, high, given, wanted):
    """The greatest part of a torque beside what is given, 1 at most."""
    aim = np.r_[np.zeros(len(low)), -1.0]
    return programme(columns, low, high, aim, given, wanted).x[-1]


def expected(columns, low, high, price, torque):
    """The torque that can be made, the least price of it, and uses of least squares."""
    idle = np.clip(0.0, low, high)
    stuck = columns @ idle
    opposed = -part(columns, low, high, stuck, -stuck) * stuck if stuck.any() else 0 * stuck
    rest = torque - stuck - opposed
    given = stuck + opposed
    made = given + part(columns, low, high, given, rest) * rest
    split = np.hstack([columns, -columns])
    bounds = (np.zeros(2 * len(low)), np.r_[high - idle, idle - low])
    aim = np.r_[price, price, 0.0]
    cost = programme(split, *bounds, aim, (made - stuck) * (1 - 1e-12)).fun
    return made, cost


def cases(rng, mix, number):
    while number:
        columns, low, high, price = mixed(rng, *mix)
        way = rng.normal(size=3)
        if rng.random() < 0.3:  # in reach of few devices
            way = columns @ rng.choice([0, 0, 0, 1, -1], size=len(low))
        reachable = linprog(
            np.r_[np.zeros(len(low)), -1.0],
            A_eq=np.hstack([columns, -way[:, None]]),
            b_eq=np.zeros(3),
            bounds=[*zip(low, high, strict=True), (0, 10)],
        )
        most = reachable.x[-1] if reachable.status == 0 else 0.0
        number -= 1
        yield columns, low, high, price, way * (most or 1.0) * rng.choice(AMOUNTS)


def test_rods_beside_wheels_make_all_that_they_can_together():
    """Rods as weak as 1e-5 of wheels, of which two may be parallel; all, or all but one, are at the
    bound to which a direction points, so that no other uses make their torque."""
    rng, count = np.random.default_rng(35), 300
    units, low, high, torque = [], [], [], []
    for _ in range(count):
        axes = rng.normal(size=(3, 4))
        axes[:, 1] = axes[:, 0] * rng.choice([1.0, -1.0]) if rng.random() < 0.7 else axes[:, 1]
        axes[:, 2:] *= rng.random() < 0.5  # two wheels alone
        columns = np.hstack([axes, np.cross(np.eye(3), rng.normal(size=3)).T])
        strength = np.r_[np.ones(4), np.full(3, 10 ** rng.uniform(-5, 0))]
        high.append(10 ** rng.uniform(-1, 1, 7) * strength)
        low.append(-high[-1] * np.where(rng.random(7) < 0.3, rng.random(7), 1.0))
        size = np.linalg.norm(columns, axis=0)
        units.append(columns / np.where(size > 0, size, 1.0))
        use = np.where(rng.normal(size=3) @ units[-1] > 0, high[-1], low[-1])
        between = rng.integers(7)
        use[between] = rng.uniform(low[-1][between], use[between])
        torque.append(units[-1] @ use)
    uses, _ = jax.vmap(lambda *x: least_squares_within(*x, 0 * x[3]))(
        *map(np.stack, (units, low, high, torque))
    )
    error = np.einsum("kij,kj->ki", units, uses) - torque
    np.testing.assert_array_less(
        np.linalg.norm(error, axis=1), 1e-6 * np.linalg.norm(torque, axis=1)
    )


MIXES = [(4, 0, 0), (3, 4, 0), (4, 8, 0), (2, 6, 0), (0, 8, 0), (3, 0, 3), (2, 4, 3)]


def check_uses(mix, number, seed):
    rng = np.random.default_rng([seed, *mix])
    given = list(cases(rng, mix, number))
    arrays = tuple(map(np.stack, zip(*given, strict=True)))
    scale = 10.0 ** rng.integers(-6, 7, size=number)
    arrays[0][:], arrays[4][:] = (np.einsum("k,k...->k...", scale, arrays[i]) for i in (0, 4))
    by_xla = jax.jit(jax.vmap(lambda *x: allocate(Reach(*x[:4]), x[4])))(*arrays)
    first = jax.tree.map(lambda x: x[0], arrays)
    by_ours = Mapped(lambda x, _: allocate(Reach(*x[:4]), x[4]).use, first)(arrays)
    np.testing.assert_allclose(by_ours, by_xla.use, rtol=0, atol=1e-6)
    lacking = 0
    for k, (columns, low, high, price, torque) in enumerate(given):
        use, made, unmade = (np.asarray(x)[k] for x in by_xla)
        made, unmade = made / scale[k], unmade / scale[k]
        assert np.all((use >= low) & (use <= high))
        size = max(np.abs(torque).max(), np.abs(columns @ high).max())
        np.testing.assert_allclose(made + unmade, torque, rtol=0, atol=1e-14 * size)
        np.testing.assert_allclose(columns @ use, made, rtol=0, atol=1e-6 * size)
        best, cost = expected(columns, low, high, price, torque)
        np.testing.assert_allclose(made, best, rtol=0, atol=1e-6 * size)
        spent = price @ np.abs(use - np.clip(0.0, low, high))
        assert spent == pytest.approx(cost, rel=1e-5, abs=1e-6)
        lacking += np.abs(unmade).max() > 1e-9
        check_shares(columns, low, high, price, use)
    assert 0 < lacking < number


def check_shares(columns, low, high, price, use):
    """Devices without a price make their torque with the least squares of use over limit.

    So say the conditions of Karush, Kuhn and Tucker: for some μ, with C the columns at the limits,
    the part of each limit is (Cᵀμ) of those between their bounds, and at a bound beyond that.
    """
    idle = np.clip(0.0, low, high)
    free = (price == 0) & (high > low)
    if not free.any():
        return
    limit = np.maximum(high - idle, idle - low)[free]
    part, rounding = (use - idle)[free] / limit, 1e-7
    rows = (columns[:, free] * limit).T
    upper = part < (high - idle)[free] / limit - rounding
    lower = part > (low - idle)[free] / limit + rounding
    found = linprog(
        np.zeros(3),
        A_ub=np.vstack([rows[upper], -rows[lower]]),
        b_ub=np.r_[part[upper], -part[lower]] + rounding,
        bounds=(None, None),
    )
    assert found.status == 0


@pytest.mark.slow
@pytest.mark.parametrize("mix", MIXES)
def test_uses_of_many_layouts_are_those_of_the_programmes(mix):
    check_uses(mix, 80, 8)


@pytest.mark.slow
@pytest.mark.parametrize("price", [None, [0.0, 0.0, 1.0, 0.0, 1.5, 0.0]])
def test_derivatives_are_those_of_differences_within_at_and_beyond_the_limits(price):
    rng = np.random.default_rng(44)
    columns = rng.normal(size=(3, 6))
    high = jnp.array([1.0, 0.5, 1.0, 0.2, 1.0, 0.0])
    reach = Reach(columns, -high, high, None if price is None else jnp.array(price))
    uses = jax.jit(lambda torque: allocate(reach, torque).use)
    slopes = [jax.jit(way(uses)) for way in (jax.jacfwd, jax.jacrev)]
    for amount in (1e-6, 0.1, 0.9, 1.1, 5.0):
        command, step = amount * np.array([0.5, -0.6, 0.4]), 1e-7
        sides = [np.asarray(uses(command + step * way)) for way in (*np.eye(3), *-np.eye(3))]
        differences = (np.stack(sides[:3], axis=1) - np.stack(sides[3:], axis=1)) / (2 * step)
        for slope in slopes:
            np.testing.assert_allclose(slope(command), differences, rtol=1e-6, atol=1e-6)


@pytest.mark.slow
def test_devices_without_bounds_share_what_is_left_at_a_bound():
    reach = Reach(np.eye(3)[:, [0, 0, 1, 2]], *jnp.array([[-0.1, *[-jnp.inf] * 3], [0.1] * 4]))
    reach = reach._replace(high=-reach.low)
    allocation = jax.jit(allocate)
    use, made, unmade = allocation(reach, jnp.array([0.5, 0.3, -0.2]))
    np.testing.assert_allclose(use, [0.1, 0.4, 0.3, -0.2], atol=1e-15)
    np.testing.assert_allclose(made, [0.5, 0.3, -0.2], atol=1e-15)
    assert not np.any(unmade)
    priced = reach._replace(price=jnp.array([0.0, 1.0, 0.0, 0.0]))
    np.testing.assert_allclose(allocation(priced, made).use, use, atol=1e-9)


def test_a_command_that_fits_is_shared_to_the_bit_as_without_limits():
    axes = np.array([[1, -1, -1, 1], [1, 1, -1, -1], [1, 1, 1, 1]]) / np.sqrt(3)
    command = jnp.array([0.03, -0.02, 0.01])
    free, bound = WheelsFirst.of(axes, 3), WheelsFirst.of(axes, 3, 0.1)
    free, bound = (jax.jit(lambda x, one=one: one.wheels(x))(command) for one in (free, bound))
    np.testing.assert_array_equal(free, bound)


@pytest.mark.parametrize("count", [3, 5])
def test_ideal_thrusters_under_three_torques_make_the_greatest_part_in_its_direction(count):
    axes = np.random.default_rng(5).normal(size=(3, count))
    axes /= np.linalg.norm(axes, axis=0)
    thrusters = jax.jit(Actuators.of(Thrusters(axes), 0.2, torques=3).__call__)
    command = np.array([1.0, -0.7, 0.4])
    limits = (np.full(count, -0.2), np.full(count, 0.2))
    most = part(axes, *limits, np.zeros(3), command)
    for amount in (0.5 * most, 2 * most):
        torque = thrusters(jnp.asarray(amount * command))
        np.testing.assert_allclose(torque, min(amount, most) * command, atol=1e-10)
    spare = min(1.0, 0.2 / np.abs(np.linalg.pinv(axes) @ command).max())
    assert most >= spare - 1e-12
    assert (most > spare + 1e-3) == (count == 5)


def test_momentum_that_thrusters_make_wheels_store_has_a_price():
    """With one to three wheels, of which some are full, against a linear programme with a variable
    for the use of each wheel beyond its share, by XLA and the compiled engine."""
    rng, count = np.random.default_rng(11), 60
    columns, price, high = rng.normal(size=(count, 3, 8)), rng.uniform(1, 2, (count, 8)), []
    price[:, :3] = 0.0
    for _ in range(count):
        full = rng.random(3) < 0.2
        high.append(np.r_[0.3 * (np.arange(3) < rng.integers(1, 4)) * ~full, np.ones(5)])
    high = np.array(high)
    low = -high * (np.arange(8) < 3)
    shares = np.zeros((count, 8, 3))
    for k in range(count):
        working = np.flatnonzero(high[k, :3])
        shares[k, working] = np.linalg.pinv(columns[k][:, working])
    momentum = np.zeros((count, 8))
    momentum[:, :3] = rng.choice([-1, 1], (count, 3)) * 10 ** rng.uniform(-2, 2, (count, 3))
    torque = np.einsum("kij,kj->ki", columns, rng.uniform(low, 0.5 * high))
    cases = (columns, low, high, price, torque, shares, momentum)

    def uses(x, _):
        return allocate(Reach(*x[:4]), x[4], momentum=MomentumPrice(*x[5:])).use

    by_xla = np.asarray(jax.jit(jax.vmap(lambda *x: uses(x, None)))(*cases))
    by_ours = Mapped(uses, jax.tree.map(lambda x: x[0], cases))(cases)
    np.testing.assert_allclose(by_ours, by_xla, rtol=0, atol=1e-7)
    saved = 0
    for k in range(count):
        own = np.clip(shares[k] @ torque[k], low[k], high[k])
        way = np.eye(8) * np.sign(momentum[k])[:, None]
        found = linprog(
            np.r_[price[k], np.abs(momentum[k])],
            A_ub=np.hstack([way, -np.eye(8)]),
            b_ub=way @ own,
            A_eq=np.hstack([columns[k], np.zeros((3, 8))]),
            b_eq=torque[k],
            bounds=[*zip(low[k], high[k], strict=True), *[(0, None)] * 8],
        )
        assert found.status == 0
        np.testing.assert_allclose(columns[k] @ by_xla[k], torque[k], rtol=0, atol=1e-8)
        assert np.all((by_xla[k] >= low[k]) & (by_xla[k] <= high[k]))
        beyond = np.maximum(way @ (by_xla[k] - own), 0.0)
        spent = price[k] @ by_xla[k] + np.abs(momentum[k]) @ beyond
        assert spent == pytest.approx(found.fun, rel=1e-4, abs=1e-5)
        cheapest = programme(columns[k], low[k], high[k], np.r_[price[k], 0.0], torque[k]).fun
        saved += price[k] @ by_xla[k] > cheapest + 1e-3
    assert saved > 10


def test_thrusters_that_unload_do_less_where_wheels_lack_torque():
    """SciPy says how much of a torque is made beside five thrusters' part, within all bounds."""
    rng = np.random.default_rng(5)
    both = jax.jit(lambda *x: allocate_unloading(x[0], x[1], x[2], jnp.arange(6) < 1))
    alone, less = jax.jit(allocate), 0
    for _ in range(40):
        columns, price = rng.normal(size=(3, 6)), np.r_[0.0, rng.uniform(1, 2, 5)]
        low, high = np.r_[-0.1, np.zeros(5)], np.r_[0.1, np.ones(5)]
        unloading = columns[:, 1:] @ rng.uniform(0, 0.5, 5)
        torque = columns @ rng.uniform(low, high)
        none = Reach(*map(jnp.asarray, (columns, low * 0, high * (high > 0.1), price)))
        first = alone(none, unloading).use
        given = columns @ first
        made = given + part(columns, low, high, given, torque - given) * (torque - given)
        reach = Reach(*map(jnp.asarray, (columns, low, high, price)))
        found = both(reach, torque, unloading)
        np.testing.assert_allclose(columns @ found.use, made, atol=1e-6)
        np.testing.assert_allclose(found.unmade, torque - made, atol=1e-6)
        assert np.all((found.use >= low - 1e-12) & (found.use <= high + 1e-12))
        less += np.any(found.use < first - 1e-6)
    assert less > 5


def test_thrusters_oppose_what_acts_steadily_before_they_unload():
    """Of three torques that are too much for five thrusters, and for a wheel beside them, each
    part that is made is the greatest one beside those before it by SciPy."""
    rng = np.random.default_rng(6)
    both, less = jax.jit(lambda *x: allocate_unloading(*x[:3], jnp.arange(6) < 1, x[3])), 0
    for _ in range(40):
        columns, price = rng.normal(size=(3, 6)), np.r_[0.0, rng.uniform(1, 2, 5)]
        low, high = np.r_[-0.1, np.zeros(5)], np.r_[0.1, np.ones(5)]
        steady = columns[:, 1:] @ rng.uniform(0, 1, 5)
        unloading, torque = 0.5 * rng.normal(size=3), steady + 0.1 * rng.normal(size=3)
        alone = (columns, 0 * low, high * (high > 0.1))
        more = part(*alone, steady, unloading)
        first = steady + more * unloading
        made = first + part(columns, low, high, first, torque - first) * (torque - first)
        reach = Reach(*map(jnp.asarray, (columns, low, high, price)))
        found = both(reach, torque, unloading, steady)
        np.testing.assert_allclose(columns @ found.use, made, atol=1e-6)
        np.testing.assert_allclose(found.unmade, torque - made, atol=1e-6)
        less += more < 1
    assert 5 < less < 35


def test_ideal_thrusters_under_two_torques_are_clipped_one_by_one():
    thrusters = Actuators.of(Thrusters(np.eye(3)[:, :2]), 0.2)
    np.testing.assert_array_equal(thrusters(jnp.array([0.5, 0.1])), [0.2, 0.1, 0.0])


@pytest.mark.slow
def test_what_is_not_made_is_told_of_every_kind():
    """Command = torque + what is not made; nothing, exactly, within the limits."""
    axes = np.array([[1, -1, -1, 1], [1, 1, -1, -1], [1, 1, 1, 1]]) / np.sqrt(3)
    ideal = Actuators.of(Thrusters(np.eye(3)), 0.2, torques=3)
    clipped = Actuators.of(Thrusters(np.eye(3)[:, :2]), 0.2)
    push = pairs((0.1, 0.15, 0.2))
    pulsed = PulsedThrusters(thruster_set(push), allocated(push), PulseWidth())
    two, many = Wheels(np.eye(3)[:, :2]), Wheels(axes)
    mixed = WheelsFirst.of(two.axes, 3, 0.1, others=True)
    small, large = np.array([0.02, -0.03, 0.01]), np.array([0.9, -0.7, 0.4])
    told = PlantState(Quaternion([1.0, 0, 0, 0]), np.zeros(3))

    def torque(one, use):
        if isinstance(one, Wheels):
            return one.axes @ use
        return push @ one.duties(use) if one is pulsed else one(use)

    for distribution, *effectors in (
        (Direct(), ideal),
        (WheelsFirst.of(axes, 3, 0.1), many),
        (mixed, ideal, two),
        (mixed, two),
        (Direct(), clipped),
        (Direct(), pulsed),
    ):
        count = 2 if clipped in effectors else 3

        @jax.jit
        def torques(given, distribution=distribution, effectors=tuple(effectors)):
            """What all make and what is not made."""
            shares = distribution(jnp.zeros(()), told, given, effectors)
            made = sum(torque(one, use) for one, use in zip(effectors, shares.uses, strict=True))
            return made, shares.torque_unmade(effectors)

        for command in (small, large):
            made, unmade = map(np.asarray, torques(command[:count]))
            whole = np.pad(command[:count], (0, 3 - count))
            np.testing.assert_allclose(made + unmade, whole, atol=1e-14)
            assert unmade.any() == (command is large or (len(effectors) == 1 and two in effectors))


def test_devices_just_at_their_bounds_have_the_derivative_of_both_sides():
    """The largest torque about x, turned: the wheels at their bounds stay, the others make up."""
    axes = np.array([[1.0, 0, -1, 0], [0, 1, 0, -1], [1, 1, 1, 1]]) / np.sqrt(2)
    reach = Reach(jnp.asarray(axes), -jnp.ones(4), jnp.ones(4))
    allocation = jax.jit(lambda torque: allocate(reach, torque))
    largest = allocation(jnp.array([9.0, 0.0, 0.0])).torque[0]

    def use(angle):
        return allocation(largest * jnp.array([1.0, angle, 0.3 * angle])).use

    width = 1e-6
    right, left = (use(width) - use(0.0)) / width, (use(0.0) - use(-width)) / width
    np.testing.assert_allclose(right, left, atol=1e-8)
    np.testing.assert_allclose(jax.jit(jax.jacfwd(use))(0.0), right, atol=1e-8)
