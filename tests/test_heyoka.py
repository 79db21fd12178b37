"""heyoka's equations of the benchmarks against those in JAX, where heyoka is installed."""

import functools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

pytest.importorskip("heyoka")

import heyoka_gradients
from contenders import heyoka_taylor
from contenders.heyoka_taylor import equations, pieces, steering_of
from contenders.work import A, rate
from engines import made_study

KINDS = {
    "smooth": heyoka_taylor.smooth,
    "selected": heyoka_taylor.selected,
    "in_pieces": heyoka_taylor.in_pieces,
}


@pytest.mark.parametrize("kind", KINDS)
def test_right_hand_side(kind):
    """At states on both sides of both corners."""
    import heyoka as hy

    draw = np.random.default_rng(1)
    states = draw.uniform(-1, 1, (10, 40))
    states[2] *= 0.2
    torque = draw.uniform(0.1, 1, (6, 40))
    steering = steering_of(states)
    beyond = np.abs(steering) > A
    assert beyond.any(axis=1).all()
    assert not beyond.all(axis=1).any()

    found = equations(KINDS[kind])
    function = hy.cfunc([slope for _, slope in found.system], [name for name, _ in found.system])
    parameters = np.concatenate([torque, pieces(steering, beyond)])
    times = draw.uniform(0, 100, 40)
    told = function(states, pars=parameters[: function.nparams], time=times)

    ours = jax.jit(jax.vmap(functools.partial(rate, smooth=kind == "smooth")))
    want = ours(times, jnp.asarray(states.T), *(torque[i : i + 2].T for i in (0, 2, 4)))
    np.testing.assert_allclose(told.T, want, rtol=1e-11, atol=1e-12)


@pytest.mark.slow
def test_gradients_agree_with_variational_equations():
    """Both contenders against DOP853, and that against central differences."""
    study = made_study(3, 20.0, "smooth")
    true = heyoka_gradients.truth(study, 3)
    differences = heyoka_gradients.by_differences(study)
    assert heyoka_gradients.errors(differences[None], true[:1])[0] < 1e-7
    for contender in heyoka_gradients.CONTENDERS:
        found = np.asarray(contender.prepare(study, 3, 1e-10)())
        assert heyoka_gradients.errors(found, true).max() < 1e-8
