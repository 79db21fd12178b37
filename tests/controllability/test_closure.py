"""The JAX margin against the exact vectors, LAPACK, finite differences; closed forms (25), (35)."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.linalg import svdvals

from jaxsat.controllability.closure import (
    controllability_margin,
    generating_vectors,
    generator_names,
    singular_values,
)
from jaxsat.controllability.decision import one_thruster_condition, two_thruster_condition
from jaxsat.controllability.layout import make_layout
from jaxsat.controllability.rank import analyse
from tests.controllability.oracles import symmetric_product

PAPER = np.array([449.5, 264.6, 312.5])


def random_layout(seed, count):
    rng = np.random.default_rng(seed)
    second = rng.uniform(0.05, 1.0, size=3)  # second moments of mass: any body
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    inertia = q @ np.diag(second.sum() - second) @ q.T
    return 0.5 * (inertia + inertia.T), rng.normal(size=(3, count))


@pytest.mark.slow
@given(st.integers(0, 10_000), st.integers(0, 4))
@settings(max_examples=15, deadline=None)
def test_rounded_and_exact_generating_vectors_agree(seed, count):
    inertia, axes = random_layout(seed, count)
    layout = make_layout(inertia, axes)
    np.testing.assert_allclose(
        generating_vectors(jnp.asarray(inertia), jnp.asarray(axes)), layout.vectors, atol=1e-12
    )
    assert len(generator_names(count)) == layout.vectors.shape[1]
    if count:
        margin = controllability_margin(jnp.asarray(inertia), jnp.asarray(axes))
        assert float(margin) == pytest.approx(analyse(inertia, axes).margin, rel=1e-9)


def test_vectors_are_the_brackets_they_are_named_after():
    """Each column is parallel to J⟨x:y⟩ made from the definition."""
    inertia, axes = map(jnp.asarray, random_layout(3, 2))
    v1, v2 = jnp.linalg.solve(inertia, axes).T

    @jax.jit
    def pair(x, y):
        return symmetric_product(inertia, x, y)

    h1, h2 = pair(v1, v1), pair(v2, v2)
    plain = [v1, v2, h1, pair(v1, v2), h2, pair(h1, v1), pair(h2, v2), pair(h1, h1), pair(h2, h2)]
    columns = np.asarray(jax.jit(generating_vectors)(inertia, axes)).T
    for column, vector in zip(columns, plain, strict=True):
        torque = np.asarray(inertia) @ np.asarray(vector)
        np.testing.assert_allclose(
            column / np.linalg.norm(column), torque / np.linalg.norm(torque), atol=1e-12
        )


@pytest.mark.slow
@pytest.mark.parametrize("scale", [1e-12, 1e-6, 1.0])
def test_jacobi_singular_values_equal_lapack(scale):
    rng = np.random.default_rng(1)
    for columns in (3, 4, 9):
        matrix = rng.normal(size=(3, columns))
        matrix[2] = matrix[0] + scale * matrix[2]
        np.testing.assert_allclose(
            singular_values(jnp.asarray(matrix)), svdvals(matrix), atol=4e-15
        )
    np.testing.assert_array_equal(singular_values(jnp.zeros((3, 4))), 0.0)
    assert np.all(
        np.isfinite(jax.jacfwd(controllability_margin)(jnp.diag(PAPER), jnp.eye(3)[:, :2]))
    )


@pytest.mark.slow
def test_margin_derivative_equals_finite_differences():
    inertia, axes = map(jnp.asarray, random_layout(9, 1))
    gradient = jax.grad(controllability_margin, argnums=1)(inertia, axes)
    for k in range(3):
        step = jnp.zeros((3, 1)).at[k, 0].set(1e-6)
        up, down = (controllability_margin(inertia, axes + s * step) for s in (1, -1))
        assert float(gradient[k, 0]) == pytest.approx(float(up - down) / 2e-6, rel=1e-5, abs=1e-8)


@pytest.mark.slow
def test_single_precision_margin_is_close():
    inertia, axes = random_layout(2, 2)
    double = controllability_margin(jnp.asarray(inertia), jnp.asarray(axes))
    single = controllability_margin(
        jnp.asarray(inertia, jnp.float32), jnp.asarray(axes, jnp.float32)
    )
    assert single.dtype == jnp.float32
    assert float(single) == pytest.approx(float(double), abs=1e-5)


def test_analysis_in_32_bit_mode_is_the_same():
    """`analyse` never touches JAX, so the mode does not matter."""
    near = [2.0 * (1 + 1e-9), 2.0, 3.0]
    axes = np.eye(3)[:, :2]
    with jax.enable_x64(False):
        result = analyse(near, axes)
    assert result.rank == 6
    assert result.margin == pytest.approx(5e-10, rel=1e-6)


@given(st.integers(0, 10_000))
@settings(max_examples=15, deadline=None)
def test_conditions_25_and_35_on_random_layouts(seed):
    inertia, axes = random_layout(seed, 2)
    for closed, layout in (
        (two_thruster_condition(inertia, axes), axes),
        (one_thruster_condition(inertia, axes[:, 0]), axes[:, :1]),
    ):
        assert closed.holds == analyse(inertia, layout).controllable
        # The pair found makes three independent vectors by the definition of (25) and (35).
        x, y = np.linalg.solve(inertia, closed.vectors[:, :2]).T
        w = closed.coefficients[0] * x + closed.coefficients[1] * y
        third = np.asarray(symmetric_product(*map(jnp.asarray, (inertia, w, w))))
        third = inertia @ third
        cosine = third @ closed.vectors[:, 2] / np.linalg.norm(third)
        assert abs(cosine) == pytest.approx(np.linalg.norm(closed.vectors[:, 2]), rel=1e-9)
        assert closed.margin > 0


def test_the_pair_found_is_the_best_determinant():
    inertia, axes = random_layout(4, 2)
    closed = two_thruster_condition(inertia, axes)
    inverse = np.linalg.inv(inertia)
    p, q = closed.vectors[:, 0], closed.vectors[:, 1]

    def determinant(a, b):
        w = a * p + b * q
        return abs(np.linalg.det(np.stack([p, q, np.cross(inverse @ w, w)], axis=1)))

    angles = np.linspace(0, np.pi, 2001)
    best = max(determinant(np.cos(a), np.sin(a)) for a in angles)
    assert determinant(*closed.coefficients) == pytest.approx(best, rel=1e-5)


def test_condition_25_for_principal_axes():
    """Diagonal J, thrusters along x and y: controllable if and only if J1 ≠ J2."""
    closed = two_thruster_condition(PAPER, np.eye(3)[:, :2])
    assert closed.holds
    np.testing.assert_allclose(np.abs(closed.coefficients), np.sqrt(0.5))
    assert not two_thruster_condition([5.0, 5.0, 7.0], np.eye(3)[:, :2]).holds
    assert two_thruster_condition([5.0 * (1 + 1e-15), 5.0, 7.0], np.eye(3)[:, :2]).holds
    assert two_thruster_condition([5.0, 5.0, 7.0], np.eye(3)[:, 1:]).holds


def test_condition_25_is_not_necessary_for_parallel_axes():
    axes = np.array([[1.0, -2.0], [2.0, -4.0], [3.0, -6.0]])
    assert not two_thruster_condition(PAPER, axes).holds
    assert one_thruster_condition(PAPER, axes[:, 0]).holds
    assert analyse(PAPER, axes).controllable


def test_condition_35_for_principal_axes_and_planes():
    assert not one_thruster_condition(PAPER, [1.0, 0.0, 0.0]).holds
    assert one_thruster_condition(PAPER, [1.0, 1.0, 0.0]).holds
    assert one_thruster_condition(PAPER, [1.0, 2.0, 3.0]).holds
    assert not one_thruster_condition([5.0, 5.0, 5.0], [1.0, 2.0, 3.0]).holds


def test_conditions_refuse_what_they_do_not_cover():
    with pytest.raises(ValueError, match="two columns"):
        two_thruster_condition(PAPER, np.eye(3))
    with pytest.raises(ValueError, match="not zero"):
        one_thruster_condition(PAPER, np.zeros(3))
