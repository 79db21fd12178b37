"""Distributions against SciPy's, and designs against what makes them designs."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy import stats
from scipy.spatial.transform import Rotation

from jaxsat.core import noise
from jaxsat.studies.designs import Independent, LatinHypercube, Sobol
from jaxsat.studies.distributions import Discrete, Normal, RandomAttitude, TruncatedNormal, Uniform

U = jnp.linspace(1e-6, 1 - 1e-6, 1001)
NAMES = {"inertia": 3, "turn": 1, "omega": 3}


def test_uniform():
    np.testing.assert_allclose(Uniform(-2.0, 3.0).quantile(U), stats.uniform(-2, 5).ppf(U))
    np.testing.assert_array_equal(
        Uniform([0.0, 1.0], [0.0, 3.0]).quantile(jnp.array([0.5] * 2)), [0, 2]
    )


def test_normal():
    expected = stats.norm(1.5, 0.2).ppf(U)
    np.testing.assert_allclose(Normal(1.5, 0.2).quantile(U), expected, rtol=1e-10)


@pytest.mark.parametrize(
    ("low", "high"), [(-1.0, 2.0), (5.0, 6.0), (-7.5, -6.0), (-40.0, 1.0), (0.0, 0.0)]
)
def test_truncated_normal(low, high):
    found = TruncatedNormal(0.5, 0.8, low, high).quantile(U)
    assert jnp.all((found >= low) & (found <= high))
    if low < high:
        expected = stats.truncnorm((low - 0.5) / 0.8, (high - 0.5) / 0.8, 0.5, 0.8).ppf(U)
        np.testing.assert_allclose(found, expected, atol=1e-8 * abs(high - low))


@pytest.mark.parametrize(
    ("low", "high"), [(36.9, 37.1), (37.5, 38), (50, 60), (50, 1e8), (5e8, 6e8)]
)
@pytest.mark.parametrize("side", [1, -1])
def test_truncated_normal_far_from_its_mean(low, high, side):
    """Draws gather at the bound nearer to the mean, within about 1 / low of it."""
    expected = stats.truncnorm(low, high).ppf(U if side > 0 else 1 - U)
    low, high = sorted((side * low, side * high))
    found = side * TruncatedNormal(0.0, 1.0, low, high).quantile(U)
    near = min(abs(low), abs(high))
    np.testing.assert_allclose(found - near, expected - near, rtol=1e-5, atol=1e-14 * near)


@pytest.mark.parametrize(("low", "high"), [(40, 1e9), (-1e8, -38)])
def test_the_ends_of_a_truncated_normal_far_from_its_mean_are_its_bounds(low, high):
    ends = TruncatedNormal(0.0, 1.0, low, high).quantile(jnp.array([0.0, 1.0]))
    np.testing.assert_allclose(ends, [low, high], rtol=1e-12)


def test_discrete():
    found = Discrete([1.0, 5.0, -2.0], [1.0, 2.0, 1.0]).quantile(U)
    values, counts = np.unique(found, return_counts=True)
    np.testing.assert_array_equal(values, [-2, 1, 5])
    np.testing.assert_allclose(counts, [250, 250, 501], atol=1)


def test_each_component_may_have_discrete_values_of_its_own():
    both = Discrete([[1.0, 5.0, -2.0], [7.0, 8.0, 7.0]], [[1.0, 2.0, 1.0], [3.0, 1.0, 0.0]])
    assert both.components() == 2
    alone = [Discrete([1.0, 5.0, -2.0], [1.0, 2.0, 1.0]), Discrete([7.0, 8.0], [3.0, 1.0])]
    u = jnp.stack([U, U[::-1]], axis=1)
    expected = np.stack([alone[0].quantile(u[:, 0]), alone[1].quantile(u[:, 1])], axis=1)
    np.testing.assert_array_equal(jax.vmap(both.quantile)(u), expected)


def test_random_attitudes_are_uniform_over_rotations():
    """Quaternion components have the variance 1/4 and E[q_i⁴] = 1/8; angles the density 1 - cos."""
    u = jnp.array(np.random.default_rng(0).random((4000, 3)))
    q = np.asarray(jax.vmap(RandomAttitude().quantile)(u))
    np.testing.assert_allclose(np.linalg.norm(q, axis=1), 1, rtol=1e-14)
    np.testing.assert_allclose((q**2).mean(axis=0), 0.25, atol=0.015)
    np.testing.assert_allclose((q**4).mean(axis=0), 0.125, atol=0.012)
    angles = Rotation.from_quat(np.roll(q, -1, axis=1)).magnitude()
    assert stats.kstest(angles, lambda t: (t - np.sin(t)) / np.pi).pvalue > 1e-3


@pytest.mark.parametrize(
    "wrong",
    [
        lambda: Uniform(1.0, 0.0),
        lambda: Uniform(0.0, np.inf),
        lambda: Normal(0.0, -1.0),
        lambda: TruncatedNormal(0.0, 0.0, -1.0, 1.0),
        lambda: TruncatedNormal(0.0, 1.0, 1.0, -1.0),
        lambda: Discrete([1.0, 2.0], [0.0, 0.0]),
        lambda: Discrete([[1.0, 2.0], [1.0, 2.0]], [[1.0, 2.0], [0.0, 0.0]]),
        lambda: Discrete([[1.0, 2.0], [1.0, 2.0]], [1.0, 2.0]),
        lambda: LatinHypercube(0, 0),
    ],
)
def test_impossible_distributions_are_refused(wrong):
    with pytest.raises(ValueError, match="Argument"):
        wrong()


@pytest.mark.parametrize("design", [Independent(5), Sobol(5), LatinHypercube(5, 64)])
def test_a_point_depends_on_its_number_alone(design):
    whole = design.points(np.arange(64), NAMES)
    assert whole.shape == (64, 7)
    assert np.all((whole > 0) & (whole < 1))
    order = np.random.default_rng(1).permutation(64)
    np.testing.assert_array_equal(design.points(order, NAMES), whole[order])
    for numbers in ([63], [0], [5, 6, 7, 20]):
        np.testing.assert_array_equal(design.points(np.array(numbers), NAMES), whole[numbers])
    other = type(design)(6, *([64] if isinstance(design, LatinHypercube) else []))
    assert not np.any(other.points(np.arange(64), NAMES) == whole)


@pytest.mark.parametrize("design", [Independent(5), LatinHypercube(5, 64)])
def test_every_name_draws_on_its_own(design):
    whole = design.points(np.arange(64), NAMES)
    alone = design.points(np.arange(64), {"omega": 3})
    np.testing.assert_array_equal(alone, whole[:, 4:])


def test_independent_draws_are_those_of_jax():
    """uniform(fold_in(fold_in(key(seed), case), name)), at the middle of its cell."""
    key = jax.random.fold_in(jax.random.fold_in(jax.random.key(5), 11), noise.name_number("turn"))
    expected = jax.random.uniform(key, (1,)) + 2.0**-53
    np.testing.assert_array_equal(Independent(5).points(np.array([11]), {"turn": 1})[0], expected)


@pytest.mark.parametrize("design", [Sobol(3), LatinHypercube(3, 64)])
def test_stratified_designs_put_one_point_in_each_slice(design):
    points = design.points(np.arange(64), NAMES)
    for column in points.T:
        np.testing.assert_array_equal(np.sort((column * 64).astype(int)), np.arange(64))


def test_sobol_integrates_better_than_independent_draws():
    def error(design):
        u = design.points(np.arange(1024), {"omega": 3})
        return abs(np.mean(np.prod(2 * u, axis=1)) - 1)

    assert np.mean([error(Sobol(s)) for s in range(8)]) < 0.2 * np.mean(
        [error(Independent(s)) for s in range(8)]
    )


def test_numbers_beyond_a_design_are_refused():
    for design, number in ((LatinHypercube(0, 4), 4), (Independent(0), -1), (Sobol(0), 2**30)):
        with pytest.raises(ValueError, match="Case numbers"):
            design.points(np.array([number]), NAMES)
