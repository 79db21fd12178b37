"""The verdict on gyros: published facts of the pyramid, and brackets of how they fly."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.controllability.gyros import GyroCluster

SKEW = np.radians(54.73)


def pyramid(angle=(0, 0, 0, 0), momentum=2.0):
    """Four gyros on the faces of a pyramid (Wie, Space Vehicle Dynamics and Control, 7.4)."""
    turns = np.arange(4) * np.pi / 2
    outward = np.stack([np.cos(turns), np.sin(turns), 0 * turns])
    gimbals = np.sin(SKEW) * outward + np.cos(SKEW) * np.eye(3)[:, 2:]
    spins = np.cross(np.eye(3)[2], outward, axisb=0).T
    each = np.ones(4)
    return GyroCluster(gimbals, spins, momentum * each, each, np.radians(angle), np.ones(4, bool))


def test_the_pyramid_has_its_published_torques_and_envelope():
    """Columns (-cβ 0 cβ 0; 0 -cβ 0 cβ; sβ sβ sβ sβ), 2 + 2 cβ about x and y, 4 sβ about z."""
    one, c, s = pyramid(), np.cos(SKEW), np.sin(SKEW)
    expected = [[-c, 0, c, 0], [0, -c, 0, c], [s, s, s, s]]
    np.testing.assert_allclose(-one.columns(np.zeros(4)) / 2, expected, atol=1e-15)
    gathered = [one.envelope(axis) for axis in np.eye(3)]
    np.testing.assert_allclose(gathered, [4 + 4 * c, 4 + 4 * c, 8 * s], rtol=1e-15)
    assert "4 of 4 gimbals make three torques" in one.verdict()
    assert one.torques_now == one.torques == 3


@pytest.mark.parametrize("angle", [(-90, 0, 90, 0), (90, 180, -90, 0), (90, 90, 90, 90)])
def test_singular_angles_are_told_from_a_set_without_three_torques(angle):
    """An elliptic, a hyperbolic and a saturated singularity of the pyramid."""
    one = pyramid(angle)
    assert one.torques == 3
    assert one.torques_now == 2
    assert one.reserve == 0
    assert "singular at their angles at the start" in one.verdict()


def test_what_locked_gimbals_leave_of_the_pyramid():
    """One leaves three torques, two leave two, of which only drift makes three axes."""
    one = pyramid()
    assert all(one.locked([place]).torques == 3 for place in range(4))
    assert all(one.locked(pair).torques == 2 for pair in itertools.combinations(range(4), 2))
    lines = one.lines()
    assert "one gimbal locked: 4 of 4 cases leave three torques" in lines[1]
    assert "two gimbals locked: 0 of 6 cases leave three torques; the others are" in lines[2]
    assert one.locked([0, 1]).verdict().startswith("Controllable by drift: 2 of 4")
    assert one.locked(range(4)).verdict() == "Not controllable: all gimbals are locked."


def bracket(first, second):
    """[f, g] of two vector fields of one array."""

    def field(x):
        return jax.jvp(second, (x,), (first(x),))[1] - jax.jvp(first, (x,), (second(x),))[1]

    return field


@pytest.mark.slow
def test_brackets_of_one_gimbal_turn_the_body_about_every_axis_at_any_state():
    """On rotations and one angle: of rank 4, which with a drift that returns is all of them."""
    inverse = np.linalg.inv(np.array([[3.0, 0.2, 0.1], [0.2, 2.0, -0.3], [0.1, -0.3, 4.0]]))
    total = np.array([0.4, -0.2, 0.7])

    def drift(x):
        turned = x[:9].reshape(3, 3)
        stored = 2 * jnp.array([jnp.cos(x[9]), jnp.sin(x[9]), 0.0])
        omega = inverse @ (turned.T @ total - stored)
        return jnp.append((turned @ jnp.cross(jnp.eye(3), omega)).ravel(), 0.0)

    def rate(x):
        return jnp.zeros_like(x).at[9].set(1.0)

    once = bracket(rate, drift)
    twice = bracket(rate, once)
    fields = (rate, once, twice, bracket(once, twice))
    rng = np.random.default_rng(3)
    for _ in range(5):
        turned = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        state = jnp.asarray(np.append(turned * np.linalg.det(turned), rng.normal()))
        vectors = np.stack([one(state) for one in fields])
        assert np.linalg.svd(vectors, compute_uv=False)[3] > 1e-3
