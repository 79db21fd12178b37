"""What a sampled loop's torque was between the times that are saved."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jaxsat.simulation.trajectory import TorqueRange


class HeldTorque(NamedTuple):
    """The torques that a period has held so far (N m): bounds, ∫T dt (N m s), and how long (s)."""

    least: Float[Array, "3"]
    largest: Float[Array, "3"]
    integral: Float[Array, "3"]
    length: Float[Array, ""]

    @staticmethod
    def none(torque: Float[Array, "3"]) -> "HeldTorque":
        """Before the first hold."""
        zero = jnp.zeros_like(torque)
        return HeldTorque(zero + jnp.inf, zero - jnp.inf, zero, zero[0])

    def with_hold(
        self, length: Float[Array, ""], first: Float[Array, "3"], last: Float[Array, "3"]
    ) -> "HeldTorque":
        """With a time (s) in which the torque went from `first` to `last`, if it has a length."""
        held = length > 0
        return HeldTorque(
            jnp.where(held, jnp.minimum(self.least, jnp.minimum(first, last)), self.least),
            jnp.where(held, jnp.maximum(self.largest, jnp.maximum(first, last)), self.largest),
            self.integral + length / 2 * (first + last),
            self.length + length,
        )

    def range(self) -> TorqueRange:
        """The range of what was held; without anything held no numbers."""
        return TorqueRange(self.least, self.largest, self.integral / self.length)

    def between(self, numbers: Int[Array, " times"], last: Float[Array, "3"]) -> TorqueRange:
        """Of many periods: the range from each of these samples to the next, then the `last`."""
        count = numbers.shape[0] - 1
        after = jnp.searchsorted(numbers, jnp.arange(self.length.shape[0]), side="right") - 1
        options = {"num_segments": count, "indices_are_sorted": True}
        least = jax.ops.segment_min(self.least, after, **options)
        largest = jax.ops.segment_max(self.largest, after, **options)
        integral = jax.ops.segment_sum(self.integral, after, **options)
        length = jax.ops.segment_sum(self.length, after, **options)
        found = TorqueRange(least, largest, integral / length[:, None])
        return jax.tree.map(lambda x: jnp.concatenate([x, last[None]]), found)
