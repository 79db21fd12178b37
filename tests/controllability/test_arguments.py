"""What `analyse` takes, and what it refuses."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.controllability.rank import analyse


@pytest.mark.parametrize(
    ("inertia", "axes", "message"),
    [
        ([1.0, 2.0], np.eye(3), "shape"),
        ([1.0, 2.0, -3.0], np.eye(3), "positive definite"),
        (np.ones((3, 3)), np.eye(3), "positive definite"),
        ([[1, 0.5, 0], [0, 1, 0], [0, 0, 1]], np.eye(3), "symmetric"),
        ([1.0, 2.0, np.nan], np.eye(3), "finite"),
        ([1.0, 2.0, 2.5], np.eye(3)[:2], "shape"),
        ([1.0, 2.0, 2.5], [1.0, 0.0, 0.0], "shape"),
        ([1.0, 2.0, 2.5], np.full((3, 1), np.inf), "finite"),
    ],
)
def test_bad_arguments_are_refused(inertia, axes, message):
    with pytest.raises(ValueError, match=message):
        analyse(inertia, axes)


def test_bad_options_are_refused():
    with pytest.raises(ValueError, match="tolerance"):
        analyse([1, 2, 2.5], np.eye(3), tolerance=0.0)
    with pytest.raises(ValueError, match="disturbance"):
        analyse([1, 2, 2.5], np.eye(3), disturbance=[0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="labels"):
        analyse([1, 2, 2.5], np.eye(3), labels=("a",))
    with pytest.raises(TypeError, match="real numbers"):
        analyse([1, 2, 2.5], np.eye(3) * 1j)


def test_unphysical_moments_are_flagged_not_refused():
    assert not analyse([1.0, 2.0, 9.0], np.eye(3)).physical
    assert analyse([3.0, 4.0, 7.0], np.eye(3)).physical


def test_arrays_of_jax_and_small_floats_are_accepted():
    for dtype in (jnp.float64, jnp.float32, jnp.bfloat16):
        result = analyse(jnp.asarray([9, 5, 7], dtype), jnp.eye(3, dtype=dtype)[:, :2])
        assert (result.exact_rank, result.margin > 0.2) == (6, True)
        assert result.rank == 6 or (result.borderline and dtype == jnp.bfloat16)
        assert result.rounding >= 128 * float(jnp.finfo(dtype).eps)
    with pytest.raises(jax.errors.TracerArrayConversionError):
        jax.jit(lambda axes: analyse([9, 5, 7], axes).rank)(jnp.eye(3))


def test_tuples_lists_and_integers_are_accepted():
    for make in (tuple, list, np.array):
        result = analyse(
            make([9, 5, 7]), make([(1, 0), (0, 1), (0, 0)]), orbit_rate=0, labels=["a", "b"]
        )
        assert result.generators == ("a", "b", "[[f,a],b]")
