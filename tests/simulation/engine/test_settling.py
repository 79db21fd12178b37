"""Since when a case is settled, judged on a step, against many instants of it."""

from types import SimpleNamespace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.core.tolerances import SettlingTracker
from jaxsat.simulation.engine import instants
from jaxsat.simulation.engine.flat_ode import DenseStep, FlatODE

LENGTH, STEPS = 3.0, 12
PARTS = 4


class KnownODE(FlatODE):
    """A flat state that its `loop` tells at all times, of which two entries are the excess."""

    def interpolated(self, step, fraction):
        return self.loop(step.begin + fraction * step.length)


def judged(state, begin, tracker, needed=True) -> SettlingTracker:
    """After one step from `begin`."""
    ode = KnownODE(None, state, SimpleNamespace(event_checks=PARTS), None)
    zero, none = jnp.zeros(()), jnp.zeros((1, 1))
    step = DenseStep(begin, zero + LENGTH, none[0], none, none, zero, none[0] > 0)
    at_end = state(begin + LENGTH)
    return instants.settled_along_step(ode, step, zero + 1, tracker, at_end, jnp.array(needed))


def tracked(state) -> SettlingTracker:
    """After `STEPS` steps."""
    zero = jnp.zeros(())
    first = SettlingTracker.initial(zero, 2)._replace(excess=state(zero))
    begins = LENGTH * jnp.arange(STEPS)
    return jax.lax.scan(lambda at, begin: (judged(state, begin, at), None), first, begins)[0]


@pytest.fixture
def excess_is_the_state(monkeypatch):
    monkeypatch.setattr(instants, "excess_at", lambda ode, t, flat: flat)


@pytest.mark.parametrize("period", [2.0, 2.7, 4.0, 10.0])
def test_oscillations_settle_when_a_quarter_of_a_step_was_last_outside(excess_is_the_state, period):
    """Decaying ones with periods of two steps and more, and the decay of another condition."""
    quarters = LENGTH / PARTS * np.arange(STEPS * PARTS + 1)

    @jax.jit
    @jax.vmap
    def both(phase, size, decay):
        def state(t):
            wave = size * jnp.exp(-decay * t) * jnp.cos(2 * jnp.pi * t / (period * LENGTH) + phase)
            return jnp.stack([jnp.abs(wave) - 1, 2 * jnp.exp(-3 * decay * t) - 1])

        return tracked(state).start, jnp.max(jax.vmap(state)(quarters), axis=1)

    rng = np.random.default_rng(int(10 * period))
    drawn = rng.uniform([0, 1, 0.02], [7, 20, 0.2], (1000, 3)).T
    found, worst = map(np.asarray, both(*drawn))
    last = np.array([np.flatnonzero(row >= 0).max(initial=0) for row in worst])
    inside = worst[:, -1] < 0
    assert 0.3 < inside.mean() < 1
    assert np.all(np.isinf(found[~inside]))
    late = found[inside] - quarters[last[inside]]
    assert np.all((late >= 0) & (late <= LENGTH / PARTS))


def test_an_excursion_within_one_step_is_seen(excess_is_the_state):
    """Inside at both ends and far enough inside in the middle, outside in between."""

    def state(t):
        bump = 1.2 * jnp.exp(-(((t - 7.0) / 0.6) ** 2))  # in the step from 6 to 9 s
        return jnp.stack([bump - 1, jnp.full_like(t, -1.0)])

    root = 7.0 + 0.6 * np.sqrt(np.log(1.2))
    assert tracked(state).start == pytest.approx(root, abs=1e-4)


def test_a_step_that_stays_inside_is_not_searched(excess_is_the_state, monkeypatch):
    def state(t):
        return jnp.stack([-0.8 + 0.1 * jnp.sin(t), jnp.full_like(t, -1.0)])

    def cold_branch(self, needed, function, default):
        searched.append(bool(needed))
        return default

    searched, zero = [], jnp.zeros(())
    monkeypatch.setattr(KnownODE, "cold_branch", cold_branch)
    settled = judged(state, zero, SettlingTracker(zero - 5, zero, state(zero)))
    assert searched == [False]
    assert (settled.start, settled.time) == (-5, LENGTH)
