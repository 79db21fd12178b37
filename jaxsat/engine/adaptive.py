"""Adaptive steps in a plain loop: every case of a block at its own pace, until the last is done.

The loop is over attempted steps, not over intervals, so a case waits for the others only at the
end of a run. A case that ends early leaves the loop's work to the others.
"""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
from jax.flatten_util import ravel_pytree
from jaxtyping import Array, Float, PyTree

from jaxsat.checks import as_float, require_positive
from jaxsat.engine.progress import Progress, looked_at
from jaxsat.engine.rates import augmented_rate
from jaxsat.engine.runge_kutta import step_with_error
from jaxsat.simulation import Outcome
from jaxsat.simulation.solve import all_within

SAFETY, LEAST_FACTOR, LARGEST_FACTOR = 0.9, 0.2, 5.0


class Tolerance(eqx.Module):
    """What adaptive steps are held to: the error of a step below atol + rtol |state|.

    The norm is the root mean square over the loop's state and the cost; the effort, whose rate has
    corners, goes along unjudged. Steps begin at `first_step` (s), are never below `min_step` (s),
    which passes points where a law has no derivative, and a case has at most `max_steps` of them.
    """

    rtol: Float[Array, ""] = eqx.field(converter=as_float, default=1e-9)
    atol: Float[Array, ""] = eqx.field(converter=as_float, default=1e-9)
    first_step: Float[Array, ""] = eqx.field(converter=as_float, default=1e-2)
    min_step: Float[Array, ""] = eqx.field(converter=as_float, default=1e-9)
    max_steps: int = eqx.field(static=True, default=2**20)

    def __check_init__(self):
        for name in ("rtol", "atol", "first_step", "min_step"):
            require_positive(name, getattr(self, name))
        if self.max_steps < 1:
            raise ValueError(f"Argument `max_steps` must be at least 1, but got {self.max_steps}.")


def advance_adaptively(solver, tolerance, program, loop, progress, first, count) -> Progress:
    """Progress after `count` intervals from number `first` on, by steps that end on them."""
    tableau = solver.tableau
    order = solver.order(diffrax.ODETerm(lambda t, y, args: y))
    rate = augmented_rate(program, loop)
    last = first + count

    def unfinished(carry):
        progress, number, _ = carry
        return (number < last) & (progress.code == int(Outcome.SUCCESS))

    def attempt(carry):
        progress, number, t = carry
        end = (number + 1) * program.interval
        reaches = t + progress.step >= end - tolerance.min_step
        step = jnp.where(reaches, end - t, progress.step)
        seen = _seen(program, loop, progress, number, t)
        both = (progress.state, progress.integrals)
        after, error = step_with_error(tableau, rate, t, step, both)
        size = _size(tolerance, both, after, error)
        accepted = (size <= 1) | (step <= tolerance.min_step)
        following = _following(program, tolerance, seen, after, accepted, reaches, end)
        factor = jax.lax.stop_gradient(_factor(size, order))
        proposal = jnp.maximum(step * factor, tolerance.min_step)
        # a step cut short at the end of an interval says nothing against longer ones
        proposal = jnp.where(reaches & accepted, jnp.maximum(proposal, progress.step), proposal)
        following = following._replace(step=proposal)
        number = number + (accepted & reaches)
        t = jnp.where(accepted, jnp.where(reaches, end, t + step), t)
        return following, number, t

    carry = (progress, first + 0, first * program.interval)
    return jax.lax.while_loop(unfinished, attempt, carry)[0]


def _factor(size: Float[Array, ""], order: int) -> Float[Array, ""]:
    """How much longer the next step may be; much shorter where the error is no number."""
    wanted = SAFETY * jnp.maximum(size, 1e-12) ** (-1 / order)
    known = jnp.where(jnp.isfinite(size), wanted, LEAST_FACTOR)
    return jnp.clip(known, LEAST_FACTOR, LARGEST_FACTOR)


def _seen(program, loop, progress: Progress, number, t) -> Progress:
    """With the instant taken into account if it is one of those looked at."""
    seen = looked_at(progress, t, loop.signals(t, progress.state), program.tolerances)
    begins = t == number * program.interval
    return jax.tree.map(lambda new, old: jnp.where(begins, new, old), seen, progress)


def _following(program, tolerance, seen, after, accepted, reaches, end) -> Progress:
    """The next progress: further on, where it was, or ended."""
    state, integrals = after
    fine = all_within((state, integrals.cost * 0), program.state_limit)
    steps = seen.steps + 1
    code = jnp.where(accepted & ~fine, int(Outcome.STATE_LIMIT), seen.code)
    out = (code == int(Outcome.SUCCESS)) & (steps >= tolerance.max_steps)
    code = jnp.where(out, int(Outcome.MAX_STEPS), code)
    moved = seen._replace(
        state=state,
        integrals=integrals,
        ended_at=jnp.where(reaches, end, seen.ended_at),
    )
    kept = jax.tree.map(lambda new, old: jnp.where(accepted & fine, new, old), moved, seen)
    return kept._replace(code=code, steps=steps)


def _size(tolerance, before: PyTree, after: PyTree, error: PyTree) -> Float[Array, ""]:
    """The error in parts of what is tolerated; NaN where it is no number, never accepted."""
    x, y, e = (ravel_pytree((state, sums.cost))[0] for state, sums in (before, after, error))
    scale = tolerance.atol + tolerance.rtol * jnp.maximum(jnp.abs(x), jnp.abs(y))
    return jnp.sqrt(jnp.mean((e / scale) ** 2))
