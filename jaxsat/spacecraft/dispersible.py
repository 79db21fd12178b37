"""Quantities of a part of the spacecraft that a study may draw: their effect and their limits.

The limits keep a part in the ranges of `jaxsat.core.ranges`, which also bound the keys of a
scenario; limits of a relative change follow from the nominal number.
"""

from collections.abc import Callable
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Array, Float

from jaxsat.core.checks import as_float, numpy_if_known
from jaxsat.core.ranges import Range


class Limits(NamedTuple):
    """Least and largest number of a draw, for all components or for each."""

    low: Float[Array | np.ndarray, "*n"]
    high: Float[Array | np.ndarray, "*n"]

    @staticmethod
    def between(values: Range) -> "Limits":
        """Return the limits of numbers that are drawn directly."""
        return Limits(as_float(values.low), as_float(values.high))

    @staticmethod
    def of_change(values: Range, nominal: Float[Array, " n"]) -> "Limits":
        """Return limits of relative changes that keep nominal numbers in their range; a nominal
        zero has no limits."""
        xp, numbers = numpy_if_known(nominal)
        safe = xp.where(numbers == 0, 1.0, numbers)
        one, other = values.low / safe, values.high / safe
        free = xp.where(numbers == 0, xp.inf, 0.0)
        return Limits(xp.minimum(one, other) - 1 - free, xp.maximum(one, other) - 1 + free)


class Dispersible(NamedTuple):
    """Effect of a drawn quantity on an effector, or on its initial state.

    For quantities that are not a single field of the effector, named in its declaration. `changed`
    takes the effector, its state and the numbers, `each` of them per device, and returns effector
    and state. `within` returns the part of the effector that has the devices. The law does not know
    the drawn numbers.
    """

    changed: Callable[[Any, Any, Float[Array, " size"]], tuple[Any, Any]]
    limits: Callable[[Any], Limits]
    each: int = 1
    within: Callable[[Any], Any] = lambda effector: effector

    def size(self, effector: Any) -> int:
        """Return the number of components of a draw."""
        return self.each * self.within(effector).count
