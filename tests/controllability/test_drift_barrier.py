"""One-signed torques and the drift: no barrier is crossed, and without one all is reached."""

import jax.numpy as jnp
import numpy as np
import pytest
import sympy

from controllability.fields import fields, random_state
from jaxsat.controllability.barrier import momentum_barrier, separatrix_normals
from jaxsat.controllability.cone import torque_cone
from jaxsat.controllability.lie import lie_bracket

MOMENTS = [(449.5, 264.6, 312.5), (1.0, 2.0, 2.9), (5.0, 5.0, 7.0), (9.0, 6.0, 6.0)]
TOLERANCE = 1e-6


def barrier_of(inertia, columns):
    cone = torque_cone(columns, np.zeros(columns.shape[1], bool))
    return momentum_barrier(inertia, cone, TOLERANCE)


def test_the_drift_keeps_the_side_of_a_separatrix_plane_in_symbols():
    j1, j2, j3 = sympy.symbols("J1:4", positive=True)
    h = sympy.Matrix(sympy.symbols("H1:4"))
    flow = h.cross(sympy.Matrix([h[0] / j1, h[1] / j2, h[2] / j3]))
    # Squares of the entries of m; d(m·H)/dt is m·H times a function of H2 alone.
    a, b = sympy.symbols("a b", positive=True)
    on_plane = {h[2]: -a * h[0] / b}
    rate = (a * flow[0] + b * flow[2]).subs(on_plane)
    squares = {a: sympy.sqrt((j1 - j2) / j1), b: sympy.sqrt((j2 - j3) / j3)}
    assert sympy.simplify(rate.subs(squares)) == 0
    assert sympy.simplify((a * flow[0] + b * flow[2]).subs(squares)) != 0


@pytest.mark.parametrize("moments", MOMENTS)
def test_normals_are_the_planes_of_the_formula(moments):
    rng = np.random.default_rng(1)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    inertia = rotation @ np.diag(moments) @ rotation.T
    normals, middle = separatrix_normals(inertia)
    for normal in normals:
        across = np.cross(normal, middle)
        for angle in np.linspace(0, 6, 13):
            momentum = np.cos(angle) * middle + np.sin(angle) * across
            flow = np.cross(momentum, np.linalg.solve(inertia, momentum))
            assert abs(normal @ flow) < 1e-12
    assert separatrix_normals(4.0 * np.eye(3)) is None


def advance(momenta, inverse, step, count):
    """Free motion of momenta (n, 3) by steps (n, 1) of the classical Runge-Kutta method."""

    def flow(h):
        return np.cross(h, h @ inverse)

    for _ in range(count):
        k1 = flow(momenta)
        k2 = flow(momenta + 0.5 * step * k1)
        k3 = flow(momenta + 0.5 * step * k2)
        k4 = flow(momenta + step * k3)
        momenta = momenta + step / 6 * (k1 + 2 * k2 + 2 * k3 + k4)
    return momenta


def reached(inertia, columns, *, starts, rounds, seed=0):
    """Directions of momentum, of 400, that random pushes and drifts reach from rest."""
    rng = np.random.default_rng(seed)
    inverse = np.linalg.inv(inertia) * np.trace(inertia) / 3
    pushes = (columns / np.linalg.norm(columns, axis=0)).T
    turn, height = np.pi * (3 - np.sqrt(5)) * np.arange(400), 1 - (2 * np.arange(400) + 1) / 400
    around = np.sqrt(1 - height**2)
    grid = np.stack([around * np.cos(turn), around * np.sin(turn), height], axis=1)
    cells, momenta = {}, pushes
    for _ in range(rounds):
        cells.update(zip(np.argmax(momenta @ grid.T, axis=1), momenta, strict=True))
        known = np.array(list(cells.values()))
        momenta = known[rng.integers(len(known), size=starts)]
        momenta = advance(momenta, inverse, rng.uniform(0, 0.3, (starts, 1)), rng.integers(25))
        size = (rng.random((starts, 1)) < 0.8) * 10 ** rng.uniform(-2, 1.2, (starts, 1))
        momenta = momenta + size * pushes[rng.integers(len(pushes), size=starts)]
        momenta = momenta / np.linalg.norm(momenta, axis=1, keepdims=True)
    return np.array(list(cells.values()))


def random_case(seed):
    rng = np.random.default_rng(seed)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    inertia = rotation @ np.diag(1 - rng.dirichlet([1.5, 1.5, 1.5])) @ rotation.T
    columns = rng.normal(size=(3, rng.integers(2, 5)))
    return inertia, columns * np.sign(columns[2])  # all on one side: never a subspace


@pytest.mark.parametrize("seed", range(8))
def test_no_barrier_is_ever_crossed(seed):
    found = 0
    for case in range(10 * seed, 10 * seed + 10):
        inertia, columns = random_case(case)
        barrier = barrier_of(inertia, columns)
        if barrier is not None:
            momenta = reached(inertia, columns, starts=100, rounds=15)
            assert np.min(momenta @ barrier) > -2e-4  # the integration's error
            found += 1
    assert found


@pytest.mark.slow
@pytest.mark.parametrize("seed", range(12))
def test_without_a_barrier_every_direction_of_momentum_is_reached(seed):
    inertia, columns = random_case(seed)
    directions = len(reached(inertia, columns, starts=1000, rounds=150))
    assert (directions > 396) == (barrier_of(inertia, columns) is None)


def test_what_one_signed_torques_do_about_principal_axes():
    paper = np.diag([449.5, 264.6, 312.5])
    for columns in (np.eye(3), np.eye(3)[:, :2], np.array([[1.0], [2], [3]])):
        assert barrier_of(paper, columns) is not None
    # Only +z of the middle axis, but both signs about the others: the drift brings it back.
    canted = np.array([[1, 0, 1], [-1, 0, 1], [0, 1, 1], [0, -1, 1]], float).T
    assert barrier_of(paper, canted) is None
    assert barrier_of(np.diag([264.6, 312.5, 449.5]), canted) is not None
    # A sphere keeps its momentum, so nothing less than all directions is enough.
    assert barrier_of(np.eye(3), canted) @ [0, 0, 1] == pytest.approx(1)
    assert barrier_of(np.eye(3), np.concatenate([canted, [[0], [0], [-1]]], axis=1)) is None


def test_the_one_signed_family_generates_the_same_brackets():
    drift, *controls = fields()
    state = random_state(3)

    def with_drift(control):
        return lambda point: drift(point) + control(point)

    pushed = [with_drift(control) for control in controls]
    first = [lie_bracket(drift, control)(state) for control in controls]
    np.testing.assert_allclose([lie_bracket(drift, push)(state) for push in pushed], first)
    # [f + g1, f + g2] = [f, g2] − [f, g1], constant fields commuting.
    between = lie_bracket(*pushed)(state)
    np.testing.assert_allclose(between, first[1] - first[0], atol=1e-12)
    assert jnp.linalg.matrix_rank(jnp.stack([between, *first])) == 2
