"""Numbers of a part of the spacecraft that a study may draw: what they change, within what limits.

Limits are those that leave a part in the ranges of `jaxsat.core.ranges`, which the keys of a
scenario have as well; those of a relative change follow from the nominal number.
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
        """The limits of numbers that are drawn as they are."""
        return Limits(as_float(values.low), as_float(values.high))

    @staticmethod
    def of_change(values: Range, nominal: Float[Array, " n"]) -> "Limits":
        """Relative changes that keep nominal numbers in their range; zero remains zero whatever it
        is multiplied with."""
        xp, numbers = numpy_if_known(nominal)
        safe = xp.where(numbers == 0, 1.0, numbers)
        one, other = values.low / safe, values.high / safe
        free = xp.where(numbers == 0, xp.inf, 0.0)
        return Limits(xp.minimum(one, other) - 1 - free, xp.maximum(one, other) - 1 + free)


class Dispersible(NamedTuple):
    """What a drawn quantity changes in an effector, or in its state at the start.

    For quantities that are more than one field of the effector, which their declaration names.
    `changed` takes the effector, its state and the numbers, `each` so many for every device, and
    gives effector and state. `within` gives the part of the effector that has the devices. The law
    is unaware of what is drawn.
    """

    changed: Callable[[Any, Any, Float[Array, " size"]], tuple[Any, Any]]
    limits: Callable[[Any], Limits]
    each: int = 1
    within: Callable[[Any], Any] = lambda effector: effector

    def size(self, effector: Any) -> int:
        """How many numbers a draw has."""
        return self.each * self.within(effector).count
