"""Initial guesses of a plan: paths to the target with random bumps, or an earlier plan."""

import jax.numpy as jnp
import numpy as np
from jax import lax
from jaxtyping import Array, Float

from jaxsat.control.planning.transcription import STATES, PlanObjective, Transcription, Unknowns
from jaxsat.core.array_types import RealScalar
from jaxsat.core.once import once

BUMPS, BUMPS_OVER_SQUARE = 0.5, 1 / 16
"""Standard deviation of the quaternion's bumps: the first, or the second times the square of a
short duration, about the rotation by the torques within a quarter of it."""

SPREAD = (1.0, 3.0)
"""Durations of guesses over that of one slew with one thruster."""

LEAST_DURATION, LEAST_REST = 0.5, 0.05
"""Smallest duration of a guess, and of the rest of an earlier plan of least time, in units of τ."""


BLOCK = 12
"""Number of guesses per block of random numbers."""


@once
def random_numbers(count: int) -> dict[str, Float[np.ndarray, "count ..."]]:
    """Random numbers of the guesses: equal for every start, half of them for each sign of q.

    The numbers of fewer guesses are the first of those of more.
    """
    blocks = [_block(number) for number in range(-(-count // BLOCK))]
    numbers = {name: np.concatenate([one[name] for one in blocks])[:count] for name in blocks[0]}
    return {"sign": np.where(np.arange(count) % 2, -1.0, 1.0), **numbers}


def _block(number: int) -> dict[str, Float[np.ndarray, "block ..."]]:
    """The random numbers of one block of guesses; `number` is their seed."""
    random = np.random.default_rng(number)
    return {
        "stretch": random.uniform(*SPREAD, BLOCK),
        "waves": random.integers(1, 4, (BLOCK, STATES)).astype(float),
        "bumps": random.normal(size=(BLOCK, STATES)),
    }


def slew_duration(program: Transcription, x: Float[Array, "7"]) -> RealScalar:
    """Duration of one slew over a start's tilt and turn with one thruster, in units of τ.

    It only begins a search: not differentiated, as its root has no derivative at the target.
    """
    x = lax.stop_gradient(x)
    moments = program.model.spacecraft.moments
    relative = moments / jnp.mean(moments)
    angle = 2 * jnp.arctan2(jnp.sqrt(jnp.sum(x[1:4] ** 2)), jnp.abs(x[0]))
    stop = jnp.max(relative * jnp.abs(x[4:]))
    return jnp.maximum(2 * jnp.sqrt(jnp.max(relative) * angle) + stop, LEAST_DURATION)


def guess(
    program: Transcription,
    x: Float[Array, "7"],
    numbers: dict[str, Array],
    duration: RealScalar | None = None,
    least: float = 0.0,
) -> Unknowns:
    """A straight path from `x` to the target with bumps from random numbers, without torque.

    The duration is given, or random and longer than `least` (both in units of τ).
    """
    if duration is None:
        duration = jnp.maximum(slew_duration(program, x), least) * numbers["stretch"]
    size = jnp.minimum(BUMPS, BUMPS_OVER_SQUARE * duration**2)
    target = program.target * jnp.concatenate([jnp.full(4, numbers["sign"]), jnp.ones(3)])

    def state(share: RealScalar) -> Float[Array, "7"]:
        bumps = jnp.sin(jnp.pi * share * numbers["waves"]) * numbers["bumps"]
        straight = x + share * (target - x)
        q = straight[:4] + size * bumps[:4]
        omega = straight[4:] + 2 * jnp.pi * size / duration * bumps[4:]
        return jnp.concatenate([q / jnp.sqrt(jnp.sum(q**2)), omega])

    shares = jnp.linspace(0.0, 1.0, program.intervals, endpoint=False, dtype=x.dtype)
    torque = jnp.zeros((program.intervals, program.torque_axes.shape[1]))
    return Unknowns(lax.map(state, shares), target, torque, duration, program.place(target))


def resampled(
    program: Transcription, x: Float[Array, "7"], plan: Unknowns, elapsed: RealScalar
) -> Unknowns:
    """The rest of a plan after the time `elapsed`, on this program's intervals, beginning at `x`.

    A plan of least time keeps at least `LEAST_REST`; a given duration is unchanged.
    """
    count, rest = plan.torque.shape[0], plan.duration - elapsed
    if program.objective is PlanObjective.TIME:
        rest = jnp.maximum(rest, LEAST_REST)
    following = jnp.concatenate([plan.states[1:], plan.last[None]])

    def interval(share: RealScalar):
        place = (elapsed + share * rest) / plan.duration * count
        number = jnp.clip(place.astype(int), 0, count - 1)
        part = jnp.clip(place - number.astype(place.dtype), 0.0, 1.0)
        middle = (elapsed + (share + 0.5 / program.intervals) * rest) / plan.duration * count
        torque = plan.torque[jnp.clip(middle.astype(int), 0, count - 1)]
        return plan.states[number] * (1 - part) + following[number] * part, torque

    shares = jnp.linspace(0.0, 1.0, program.intervals, endpoint=False, dtype=x.dtype)
    states, torque = lax.map(interval, shares)
    return Unknowns(states.at[0].set(x), plan.last, torque, rest, program.place(plan.last))
