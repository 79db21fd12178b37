"""A loop whose controller's memory is integrated in the rotating frame of its integrating factor.

States must have a `memory`. Without an integrating factor the frame is the usual one.
"""

import equinox as eqx
from jaxtyping import Array, Float, PyTree

from jaxsat.core.barriers import apart
from jaxsat.simulation.loops import AbstractContinuousLoop, Motion


def into_frame(loop: AbstractContinuousLoop, t: Float[Array, ""], state: PyTree) -> PyTree:
    """A state at time `t` (s) with its memory in the rotating frame."""
    factor = loop.integrating_factor(t)
    return state if factor is None else state._replace(memory=factor.into_frame(state.memory))


def out_of_frame(loop: AbstractContinuousLoop, t: Float[Array, ""], framed: PyTree) -> PyTree:
    """The state that `into_frame` takes to `framed`."""
    factor = loop.integrating_factor(t)
    return framed if factor is None else framed._replace(memory=factor.out_of_frame(framed.memory))


def motion_in_frame(loop: AbstractContinuousLoop, t: Float[Array, ""], framed: PyTree) -> Motion:
    """`loop.motion` for a state in the rotating frame, with the rate of that state."""
    factor = apart(_integrating_factor, loop, t)
    if factor is None:
        return loop.motion(t, framed)
    motion = loop.motion(t, framed._replace(memory=factor.out_of_frame(framed.memory)))
    rate = motion.rate._replace(memory=factor.rate_in_frame(motion.rate_error))
    return motion._replace(rate=rate)


@eqx.filter_jit
def _integrating_factor(loop: AbstractContinuousLoop, t: Float[Array, ""]):
    return loop.integrating_factor(t)
