"""Thrusters beside wheels, held against a linear programme and the balance of momentum."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.spacecraft.effector import Reach
from jaxsat.spacecraft.relief import Relief
from jaxsat.store.dataset import trajectory_dataset

AXES = np.array([[1, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1]]).T / np.sqrt(2)


def relief(rng, thrusters=8):
    """A body with four wheels, and thrusters whose torques and prices are drawn."""
    torque, price = rng.normal(size=(3, thrusters // 2)), rng.uniform(0.5, 2.0, thrusters)
    torque = np.hstack([torque, -torque])
    reach = Reach(*map(jnp.asarray, (torque, np.zeros(thrusters), np.ones(thrusters), price)))
    shares = np.linalg.pinv(AXES)
    return Relief(reach, AXES, shares, 0.2 * np.ones(4), 10 * np.ones(4), np.eye(3), 0.5)


allocate = eqx.filter_jit(Relief.allocate)


@pytest.mark.parametrize("seed", range(6))
def test_thrusters_make_what_wheels_lack_at_the_least_price(seed):
    """The price is that of a linear programme, in which wheels are free."""
    rng = np.random.default_rng(seed)
    parts, momentum = relief(rng), rng.uniform(-10, 10, 4)
    momentum[0] = 10.0  # it can make no more torque of that sign
    command = rng.uniform(-0.5, 0.5, 3)
    numbers = map(jnp.asarray, (command, np.zeros(3), momentum))
    wheels, jets, unmade = allocate(parts, *numbers)
    low = -np.minimum(0.2, (10 - momentum) / 0.5)
    high = np.minimum(0.2, (10 + momentum) / 0.5)
    columns = np.hstack([AXES, parts.thrusters.columns])
    least = linprog(
        [0] * 4 + [*parts.thrusters.price],
        A_eq=columns,
        b_eq=command,
        bounds=[*zip(low, high, strict=True), *[(0, 1)] * 8],
    )
    assert least.status == 0
    np.testing.assert_allclose(AXES @ wheels + jets, command, atol=1e-9)
    np.testing.assert_allclose(unmade, 0, atol=1e-9)
    assert np.all((wheels >= low - 1e-12) & (wheels <= high + 1e-12))
    paid = linprog(
        parts.thrusters.price, A_eq=parts.thrusters.columns, b_eq=jets, bounds=[(0, 1)] * 8
    )
    assert paid.fun == pytest.approx(least.fun, rel=1e-6, abs=1e-7)


def test_momentum_is_taken_out_beyond_the_dead_band_and_without_turning_the_body():
    parts = relief(np.random.default_rng(1))
    still, held = jnp.zeros(3), AXES.T @ np.array([0, 0, 1.0])
    within, beyond = (jnp.asarray(share * 10 * held / held.max()) for share in (0.69, 0.9))
    np.testing.assert_array_equal(parts.unloading(still, within), 0)
    # What body and wheels hold together counts: a slew that gives it back wastes no propellant.
    slew = jnp.asarray(-AXES @ (beyond - within))
    np.testing.assert_array_equal(parts.unloading(slew, beyond), 0)
    unloading = parts.unloading(still, beyond)
    assert unloading @ (AXES @ beyond) < 0
    wheels, jets, unmade = allocate(parts, still, unloading, beyond)
    np.testing.assert_allclose(jets, unloading, atol=1e-9)
    np.testing.assert_allclose(AXES @ wheels + jets, 0, atol=1e-9)
    np.testing.assert_allclose(unmade, 0, atol=1e-9)
    assert np.all(wheels * beyond > 0)  # so each wheel slows down


JET = "{position_m=%s, direction=%s, force_N=0.05, min_on_time_s=0.02, specific_impulse_s=200}"
JETS = [
    JET % (np.eye(3)[axis - 2].tolist(), (side * np.eye(3)[axis - 1]).tolist())
    for axis in range(3)
    for side in (1, -1)
]


@pytest.mark.slow
def test_wheels_that_a_constant_torque_fills_are_unloaded_by_thrusters():
    """What thrusters give is the torque's impulse less what wheels hold at the end."""
    duration, pushed = 5000, 0.008
    changes = (
        f"thruster=[{', '.join(JETS)}]",
        f"disturbance.constant_N_m={[0.0, -pushed, 0.0]}",
        "failure=[]",
        "control.law='quaternion-feedback'",
        "initial.omega_rad_s=[0,0,0]",
        "initial.quaternion=[1,0,0,0]",
        f"simulation.duration_s={duration}",
        "simulation.save_every_s=10",
    )
    data = trajectory_dataset(build(load("wheels-fail", changes)).simulate())
    momentum = data["wheel_momentum"].values
    assert np.all(np.abs(momentum) < 0.8 * 20)
    assert np.linalg.norm(data["torque_unmade"], axis=1).max() < 1e-9
    given = float(data["propellant"][-1]) * 200 * 9.80665  # thrusters have arms of 1 m
    held = AXES @ momentum[-1]
    assert given == pytest.approx(pushed * duration + held[1], rel=0.03)
    assert held[1] < -20
