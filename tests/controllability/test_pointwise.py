"""The rank at one state, by arrays, against nested derivatives."""

from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.controllability.lie import (
    DriftField,
    bracket_words,
    control_fields,
    pack,
    rank_at_state,
    tangent_matrix,
)
from jaxsat.controllability.rank import analyse

from .fields import random_state
from .oracles import GibbsAlgebra


def rank(matrix):
    lengths = np.linalg.norm(matrix, axis=0)
    kept = matrix[:, lengths > 1e-9] / lengths[lengths > 1e-9]
    return int(np.sum(np.linalg.svd(kept, compute_uv=False) > 1e-8)) if kept.size else 0


LAYOUTS = [
    ((9.0, 5.0, 7.0), [[1, 0, 0]], 5),
    ((5.0, 5.0, 7.0), [[0, 0, 1]], 5),
    ((5.0, 5.0, 7.0), [[1, 0, 0], [0, 1, 0]], 4),
    ((9.0, 5.0, 7.0), [[1, 0, 0], [0, 1, 0]], 4),
]


@partial(jax.jit, static_argnames="depth")
def word_matrix(inertia, axes, torque, state, depth):
    drift = DriftField(inertia, disturbance=torque, orbit_rate=0.2)
    words = bracket_words(drift, control_fields(inertia, axes), depth)
    return tangent_matrix(tuple(words.values()), state)


@pytest.mark.slow
@pytest.mark.parametrize(("moments", "axes", "depth"), LAYOUTS)
@pytest.mark.parametrize("moving", [False, True])
@pytest.mark.parametrize("pushed", [False, True])
def test_rank_at_a_state_equals_nested_jvp_words(moments, axes, depth, moving, pushed):
    inertia = np.diag(moments)
    omega = np.array([0.6, -0.5, 0.8]) * moving
    torque = np.array([0.7, 0.4, -0.5]) * pushed
    axes = np.array(axes, float).T
    state = pack(random_state(3)[:9].reshape(3, 3), jnp.asarray(omega))
    values = word_matrix(*map(jnp.asarray, (inertia, axes, torque)), state, depth)
    accelerations = np.linalg.solve(inertia, axes)
    by_arrays = rank_at_state(inertia, accelerations, omega=omega, disturbance=torque, depth=depth)
    assert rank(np.asarray(values)) == by_arrays
    if not moving and not pushed:
        expected = analyse(inertia, axes).rank
        assert by_arrays == expected
        whole = [[int(entry) for entry in row] for row in inertia]
        assert GibbsAlgebra(whole, axes.T.astype(int).tolist()).closure_rank() == expected
