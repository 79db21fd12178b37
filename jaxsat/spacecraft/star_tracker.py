"""A star tracker: an attitude now and then, some time after it was true."""

from collections.abc import Mapping
from typing import Any, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float, Int

from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import (
    as_array,
    as_float,
    as_optional_float,
    require_counts,
    require_positive,
)
from jaxsat.core.errors import ArgumentError

Queue = TypeVar("Queue")


class StarTracker(eqx.Module):
    """A star tracker whose samples fall on those of a sampled law.

    It measures at every `every`-th sample of the law, from the first on, and its measurement is
    there `latency` samples later, or `arrival` samples later, at most as many, if that is not None.
    It measures nothing while |ω| exceeds `rate_limit` (rad/s), nor for `outage` (s) from
    `outage_start` (s) on; None for both is no outage.
    The error is a small rotation with the standard deviations `across` (rad) about the two
    directions across the boresight and `along` (rad) about the boresight itself. The rows of
    `axes` are these three directions in body axes.

    Raises `ValueError` for a deviation or a limit that is not positive, for a boresight without a
    direction, and for counts that are none.
    """

    across: Float[Array, ""]
    along: Float[Array, ""]
    axes: Float[Array, "3 3"]
    rate_limit: Float[Array, ""]
    every: Int[Array, ""]
    latency: int = eqx.field(static=True)
    arrival: Int[Array, ""] | None
    outage_start: Float[Array, ""] | None
    outage: Float[Array, ""] | None

    def __init__(
        self,
        across: ArrayLike,
        along: ArrayLike,
        boresight: ArrayLike | list | tuple = (0.0, 0.0, 1.0),
        every: int = 1,
        latency: int = 0,
        rate_limit: ArrayLike = np.inf,
        outage_start: ArrayLike | None = None,
        outage: ArrayLike | None = None,
    ):
        self.across, self.along = as_float(across), as_float(along)
        self.axes = as_array(_frame(np.asarray(boresight, float)))
        self.rate_limit = as_float(rate_limit)
        self.every, self.latency, self.arrival = as_array(np.asarray(every)), latency, None
        self.outage_start, self.outage = as_optional_float(outage_start), as_optional_float(outage)
        if (self.outage is None) != (self.outage_start is None):
            raise ValueError("Arguments `outage_start` and `outage` must be given together.")
        for name in ("across", "along", "rate_limit"):
            require_positive(name, getattr(self, name))
        require_counts(every=every)
        if latency < 0:
            raise ArgumentError("latency", "must be zero or positive", latency)

    @classmethod
    def from_table(cls, values: Mapping[str, Any], period: float) -> "StarTracker":
        """That of a checked table `[star_tracker]` of a scenario; `period` (s) is the law's."""
        update, limit = values["update_period_s"], values["rate_limit_rad_s"]
        return cls(
            values["across_rad"],
            values["along_rad"],
            values["boresight"],
            1 if update is None else round(update / period),
            round(values["latency_s"] / period),
            np.inf if limit is None else limit,
            values["outage_start_s"],
            values["outage_s"],
        )

    @property
    def deviations(self) -> Float[Array, "3"]:
        """Standard deviations (rad) about the three `axes`."""
        return jnp.stack([self.across, self.across, self.along])

    def measures(
        self, sample: Int[Array, ""], period: Float[Array, ""], omega: Float[Array, "3"]
    ) -> Bool[Array, ""]:
        """Whether there is a measurement at this sample; samples are `period` s apart."""
        seen = (sample % self.every == 0) & (jnp.sum(omega**2) <= self.rate_limit**2)
        if self.outage_start is None or self.outage is None:
            return seen
        since = sample * period - self.outage_start
        return seen & ((since < 0) | (since >= self.outage))

    def arriving(self, queue: Queue) -> Queue:
        """What arrives now of all that was measured in the last `latency` samples and now."""
        place = 0 if self.arrival is None else self.latency - self.arrival
        return jax.tree.map(lambda part: part[place], queue)

    def measured(self, attitude: Quaternion, noise: Float[Array, "3"]) -> Quaternion:
        """The measured attitude for the true one and standard normal numbers."""
        return attitude.turned((self.deviations * noise) @ self.axes)


def _frame(boresight: np.ndarray) -> np.ndarray:
    """Two directions across a boresight and the boresight, as rows."""
    length = np.linalg.norm(boresight)
    if boresight.shape != (3,) or not 0 < length < np.inf:
        rule = "must be a direction in body axes, three numbers"
        raise ArgumentError("boresight", rule, boresight.tolist())
    along = boresight / length
    first = np.cross(along, np.eye(3)[np.argmin(np.abs(along))])
    first = first / np.linalg.norm(first)
    return np.stack([first, np.cross(along, first), along])
