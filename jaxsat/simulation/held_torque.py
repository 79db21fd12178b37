"""Torque and thrust of a sampled loop between saved times."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int

from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.core.declaration.actuators import SIGNALS
from jaxsat.simulation.assessment import stop_gradient
from jaxsat.simulation.trajectory import Signals, TorqueRange

LACKING = 1e-9
"""Smallest unproduced torque that is counted, relative to the largest torque so far."""

Numbers = Int[Array | np.ndarray, " times"]


class HeldTorque(NamedTuple):
    """Torques of the holds so far (N m): bounds, ∫T dt (N m s), and total length (s)."""

    least: Vector
    largest: Vector
    integral: Vector
    length: RealScalar

    @staticmethod
    def none(torque: Vector) -> "HeldTorque":
        """The record before the first hold."""
        zero = jnp.zeros_like(torque)
        return HeldTorque(zero + jnp.inf, zero - jnp.inf, zero, zero[0])

    def with_hold(self, length: RealScalar, first: Vector, last: Vector) -> "HeldTorque":
        """The record with a hold of `length` s in which the torque went from `first` to `last`.

        A hold of zero length changes nothing.
        """
        lasting = length > 0
        return HeldTorque(
            jnp.where(lasting, jnp.minimum(self.least, jnp.minimum(first, last)), self.least),
            jnp.where(lasting, jnp.maximum(self.largest, jnp.maximum(first, last)), self.largest),
            self.integral + length / 2 * (first + last),
            self.length + length,
        )

    def range(self) -> TorqueRange:
        """The range over all holds; without a hold the mean is NaN."""
        return TorqueRange(self.least, self.largest, self.integral / self.length)

    def between(self, numbers: Numbers, last: Vector) -> TorqueRange:
        """The range from each of these samples to the next, then the `last` torque."""
        length = over_parts(np.add, self.length, numbers)
        parts = TorqueRange(
            over_parts(np.minimum, self.least, numbers),
            over_parts(np.maximum, self.largest, numbers),
            over_parts(np.add, self.integral, numbers) / length[:, None],
        )
        return jax.tree.map(lambda x: _with_last(x, last), parts)


class Unmade(NamedTuple):
    """Amount of commanded torque that actuators do not produce.

    `lacking` counts the samples, of all `samples`, with unproduced torque; `square` and
    `torque_square` are the largest squares of the unproduced torque and of the torque (N² m²).
    """

    samples: RealScalar
    lacking: RealScalar
    square: RealScalar
    torque_square: RealScalar

    @staticmethod
    def none(like: Float[Array, "..."]) -> "Unmade":
        """The record before the first sample, in the precision of the array `like`."""
        return Unmade(*[jnp.zeros((), like.dtype)] * 4)

    def with_sample(self, torque: Vector, unmade: Vector) -> "Unmade":
        """The record with one more sample; nothing is differentiated."""
        torque, unmade = stop_gradient((torque, unmade))
        square = jnp.sum(unmade**2)
        largest = jnp.maximum(self.torque_square, jnp.maximum(jnp.sum(torque**2), square))
        lacking = jnp.where(square > LACKING**2 * largest, 1.0, 0.0)
        return Unmade(
            self.samples + 1, self.lacking + lacking, jnp.maximum(self.square, square), largest
        )

    def outputs(self) -> dict[str, Array]:
        """The largest unproduced torque (N m), and the fraction of samples that have one."""
        fraction = self.lacking / jnp.maximum(self.samples, 1.0)
        return {"peak_torque_unmade": jnp.sqrt(self.square), "unmade_fraction": fraction}


def saved(signals: Signals, numbers: Numbers, held_torque: HeldTorque) -> Signals:
    """Select the samples of these ascending numbers, from the first to the last, from all samples.

    Signals that are declared as a `mean`, such as thrust levels, are averaged, and the torques of
    `held_torque` in each period give ranges, from each number to the next.
    """
    selection = jax.tree.map(lambda x: x[numbers], signals)
    ranges = held_torque.between(numbers, stop_gradient(selection.torque[-1]))
    selection = eqx.tree_at(
        lambda one: one.torque_range, selection, ranges, is_leaf=lambda x: x is None
    )
    counts = numbers[1:] - numbers[:-1]
    means = {
        name: _with_last(over_parts(np.add, values[:-1], numbers) / counts[:, None], values[-1])
        for name, values in _means(signals).items()
    }
    if not means:
        return selection
    where = list(means)
    return eqx.tree_at(
        lambda one: [one.parts[name] for name in where], selection, list(means.values())
    )


def summed(sums: Signals, first: BoolScalar, sample: Callable[[], Signals]) -> Signals:
    """The signals of the `first` sample of several; of those declared as a `mean`, the sums."""

    def later():
        parts = {name: sums.parts[name] + x for name, x in _means(sample()).items()}
        return dataclasses.replace(sums, parts=sums.parts | parts)

    return jax.lax.cond(first, sample, later)


def averaged(sums: Signals | None, count: int | IntScalar) -> Signals | None:
    """The signals with means over `count` samples in place of sums; None without signals."""
    if sums is None:
        return None
    means = {name: x / jnp.asarray(count, x.dtype) for name, x in _means(sums).items()}
    return dataclasses.replace(sums, parts=sums.parts | means)


def _means(signals: Signals) -> dict[str, Array]:
    names = [name for name in signals.parts if name in SIGNALS and SIGNALS[name].mean]
    return {name: jnp.asarray(signals.parts[name]) for name in names}


def over_parts(combine: np.ufunc, values: Array, numbers: Numbers) -> Array:
    """Sum, minimum or maximum of the values (samples) from each of these samples to the next."""
    segment = {
        np.add: jax.ops.segment_sum,
        np.minimum: jax.ops.segment_min,
        np.maximum: jax.ops.segment_max,
    }[combine]
    part = jnp.searchsorted(numbers, jnp.arange(values.shape[0]), side="right") - 1
    return segment(values, part, num_segments=numbers.shape[0] - 1, indices_are_sorted=True)


def _with_last(values: Array, last: Array) -> Array:
    return jnp.concatenate([values, last[None]])
