"""Guard of a sampled loop against samples with invalid measurements.

`jaxsat.flight.guard` writes the same rules as C.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, PyTree

from jaxsat.core.array_types import BoolScalar, IntScalar
from jaxsat.core.checks import as_array
from jaxsat.core.declaration.sensors import HOLD_SAMPLES
from jaxsat.core.errors import ArgumentError
from jaxsat.spacecraft.held_effector import Decision


class GuardState(NamedTuple):
    """The last commands, and the number of successive samples held since the law's last step."""

    last: PyTree
    missed: IntScalar


class Guard(eqx.Module):
    """A guard skips the law at a sample with invalid measurements, and keeps its memory.

    At the first `hold_samples` such samples in a row, effectors repeat their last command, then
    receive none. Raises `ArgumentError` for a number of samples below zero.
    """

    hold_samples: IntScalar

    def __init__(self, hold_samples: ArrayLike = HOLD_SAMPLES):
        if np.less(hold_samples, 0):
            raise ArgumentError("hold_samples", "must be zero or positive", hold_samples)
        self.hold_samples = as_array(np.asarray(hold_samples, np.int32))

    def init(self, asked: PyTree) -> GuardState:
        """The state before the first sample, with the structure of the command `asked`."""
        last = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), asked)
        return GuardState(last, jnp.zeros_like(self.hold_samples))

    def decide(self, valid: BoolScalar, state: GuardState) -> Decision:
        """The decision at a sample."""
        return Decision(valid, state.missed < self.hold_samples)

    def asked(
        self, decision: Decision, asked: PyTree, state: GuardState
    ) -> tuple[PyTree, GuardState]:
        """The commands, from those of a step (`asked`), and the next state."""

        def one(new: Array, last: Array) -> Array:
            return jnp.where(decision.steps, new, jnp.where(decision.held, last, 0))

        chosen = jax.tree.map(one, asked, state.last)
        waited = jnp.where(decision.held, state.missed + 1, state.missed)
        return chosen, GuardState(chosen, jnp.where(decision.steps, 0, waited))
