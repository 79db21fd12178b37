"""Equations (3)-(9) and the actuators, against linear algebra done elsewhere."""

import jax.numpy as jnp
import numpy as np
import pytest
import sympy
from hypothesis import assume, given
from hypothesis import strategies as st

from helpers.strategies import inertias, vectors
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.thrusters import Thrusters, one_thruster_coupling, two_thruster_coupling


def axes_of(*columns):
    return jnp.stack([jnp.array(c, float) / np.linalg.norm(c) for c in columns], axis=1)


@given(inertias())
def test_inverse_inertia_is_the_inverse(inertia):
    inverse = Spacecraft(inertia).inverse_inertia
    np.testing.assert_allclose(inverse, np.linalg.inv(inertia), rtol=0, atol=1e-12)


def test_moments_of_a_diagonal_inertia_are_those_given():
    craft = Spacecraft([449.5, 264.6, 312.5])
    np.testing.assert_array_equal(craft.moments, [449.5, 264.6, 312.5])


@pytest.mark.parametrize(
    ("inertia", "message"),
    [
        ([1.0, 2.0, -3.0], "positive definite"),
        ([1.0, 0.0, 3.0], "positive definite"),
        ([[1.0, 2.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]], "symmetric"),
        ([1.0, np.nan, 1.0], "finite"),
        ([[1.0, 0.0], [0.0, 1.0]], "three principal moments"),
    ],
)
def test_impossible_inertia_is_refused(inertia, message):
    with pytest.raises(ValueError, match=message):
        Spacecraft(inertia)


@given(vectors(3), vectors(3), vectors(3), vectors(3, 10.0))
def test_torque_is_the_sum_of_the_thrusters(a, b, c, thrust):
    """Equation (3), column by column."""
    assume(all(np.linalg.norm(v) > 1e-2 for v in (a, b, c)))
    torque = Thrusters(jnp.stack([jnp.array(a), jnp.array(b), jnp.array(c)], 1)).torque(
        jnp.array(thrust)
    )
    expected = sum(t * v / np.linalg.norm(v) for t, v in zip(thrust, (a, b, c), strict=True))
    np.testing.assert_allclose(torque, expected, atol=1e-12)


@given(vectors(3), vectors(3), vectors(2, 10.0))
def test_two_thrusters_make_the_coupled_third_torque(a, b, command):
    """(4) with thrusts that solve for (u1, u2) has the third component b1 u1 + b2 u2 of (5)."""
    assume(min(np.linalg.norm(a), np.linalg.norm(b)) > 1e-2)
    axes = axes_of(a, b)
    assume(abs(np.linalg.det(axes[:2])) > 1e-3)
    thrusters = Thrusters(axes)
    b1, b2 = two_thruster_coupling(thrusters)
    torque = thrusters.torque(jnp.array(np.linalg.solve(np.array(axes[:2]), command)))
    np.testing.assert_allclose(torque, [*command, b1 * command[0] + b2 * command[1]], atol=1e-9)
    np.testing.assert_allclose(Actuators.of(thrusters)(jnp.array(command)), torque, atol=1e-9)


def test_couplings_are_those_printed():
    """b and c as printed in (5) and (8), evaluated by SymPy from direction angles."""
    angles = [0.3, 1.4, 1.35, 1.2, 0.5, 1.3]
    a1, a2, a3, b1, b2, b3 = (sympy.cos(sympy.Float(x, 30)) for x in angles)
    divisor = a1 * b2 - a2 * b1
    printed = [(a3 * b2 - a2 * b3) / divisor, (a1 * b3 - a3 * b1) / divisor]
    axes = np.array([[a1, b1], [a2, b2], [a3, b3]], float)
    scaled = Thrusters(jnp.array(axes))
    lengths = np.linalg.norm(axes, axis=0)
    np.testing.assert_allclose(scaled.torque_axes, axes / lengths, rtol=1e-15)
    np.testing.assert_allclose(two_thruster_coupling(scaled), np.array(printed, float), rtol=1e-13)
    single = Thrusters(jnp.array(axes[:, :1]))
    np.testing.assert_allclose(
        one_thruster_coupling(single), np.array([a2 / a1, a3 / a1], float), rtol=1e-14
    )


def test_couplings_that_do_not_exist_are_said_to_be_missing():
    sound_but_unnormalisable = Thrusters(axes_of([1, 0, 0], [0, 0, 1]))
    with pytest.raises(ValueError, match="away from zero"):
        two_thruster_coupling(sound_but_unnormalisable)
    with pytest.raises(ValueError, match="away from zero"):
        one_thruster_coupling(Thrusters(axes_of([0, 1, 0])))
    with pytest.raises(ValueError, match="two thrusters"):
        two_thruster_coupling(Thrusters(jnp.eye(3)))
    with pytest.raises(ValueError, match="one thruster"):
        one_thruster_coupling(Thrusters(jnp.eye(3)))
    with pytest.raises(ValueError, match="body axes x and y"):
        Actuators.of(sound_but_unnormalisable)
    with pytest.raises(ValueError, match="body axes x and y"):
        Actuators.of(Thrusters(axes_of([1, 0, 0])))


def test_failures_select_columns():
    thrusters = Thrusters(axes_of([1, 0, 0], [0, 1, 0], [0, 0, 1], [1, 1, 1]))
    left = thrusters.without([2, 4])
    np.testing.assert_array_equal(left.torque_axes, thrusters.torque_axes[:, [0, 2]])
    assert left.count == 2
    with pytest.raises(ValueError, match="from 1 to 4"):
        thrusters.without([5])
    with pytest.raises(ValueError, match="zero column"):
        Thrusters(jnp.zeros((3, 1)))
    with pytest.raises(ValueError, match="shape"):
        Thrusters(jnp.eye(2))
    with pytest.raises(ValueError, match="finite"):
        Thrusters(jnp.full((3, 2), jnp.nan))


@given(vectors(2, 100.0), st.floats(0.5, 20))
def test_limits_clip_each_thruster(command, limit):
    torque = Actuators.of(Thrusters(jnp.eye(3)).without([3]), limit)(jnp.array(command))
    np.testing.assert_allclose(torque, [*np.clip(command, -limit, limit), 0], atol=1e-12)


def test_three_thrusters_make_the_command_without_a_third_torque():
    thrusters = Thrusters(axes_of([1, 0.2, 0.3], [0, 1, -0.4], [0.1, 0.3, 1]))
    torque = Actuators.of(thrusters)(jnp.array([1.5, -2.0]))
    np.testing.assert_allclose(torque, [1.5, -2.0, 0.0], atol=1e-14)
    with pytest.raises(ValueError, match="positive"):
        Actuators.of(thrusters, 0.0)
