"""Derivatives by JAX against differences of values, which know nothing of JAX's rules."""

from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np

from helpers.compiling import by_machine_code

WIDTHS = (1e-4, 1e-5, 1e-6, 1e-7)
"""Half widths of the differences."""

TOLERANCE = 1e-5
"""Relative error of a derivative, of the differences' own best."""

SMOOTH = 1e-5
"""Relative difference of the slopes on both sides, and at two widths, below which a function counts
as smooth there."""

CORNER = 1e-3
"""Difference of the slopes on both sides from which on a corner, not a wrong rule, explains what a
derivative is off, as a part of that. Where several sets of actuators are the cheapest alike, the
last bit decides whose derivative is taken, and slopes on both sides may be nearly the same."""


class Compared(NamedTuple):
    """What was found wrong, each with the name of its input, and which inputs were compared.

    An input is not compared where differences contradict each other, those of either side or of
    two widths: at a corner or a jump, at which there is no derivative.
    """

    wrong: list[str]
    compared: set[str]


class Derivatives:
    """A function of a vector, its derivative in forward mode, and its differences.

    `names` are those of the inputs. All calls share one compiled program.
    """

    def __init__(self, function, names):
        self.names = tuple(names)
        self._both = by_machine_code(lambda *given: _forward(function, *given))

    def at(self, x, *rest):
        """Compare around `x`; `rest` is given to the function as it is."""
        x, wrong, compared = np.asarray(x, float), [], set()
        for number, name in enumerate(self.names):
            way = np.eye(len(x))[number]
            value, slope = map(np.asarray, self._both(x, way, *rest))
            if not np.isfinite(value).all():
                wrong.append(f"{name}: the value is {value}")
            elif not np.isfinite(slope).all():
                wrong.append(f"{name}: the derivative is {slope}")
            else:
                told = self._differs(x, way, rest, value, slope)
                compared |= set() if told is None else {name}
                wrong += [f"{name}: {told}"] if told else []
        return Compared(wrong, compared)

    def _differs(self, x, way, rest, value, slope):
        """What is wrong, nothing where all is well, and None where there is no derivative."""
        least = max(1e-4 * np.abs(value).max(), 1e-12)
        smooth, best, gap, before = False, np.inf, np.inf, np.inf
        for width in WIDTHS:
            step = width * way
            above, below = (np.asarray(self._both(y, way, *rest)[0]) for y in (x + step, x - step))
            right, left = (above - value) / width, (value - below) / width
            size, mean = max(np.abs(right).max(), least), (right + left) / 2
            apart = max(np.abs(right - left).max(), np.abs(mean - before).max())
            smooth |= apart < SMOOTH * size
            gap = min(gap, np.abs(right - left).max() / size)
            best, before = min(best, np.abs(slope - mean).max() / size), mean
        if best <= TOLERANCE:
            return ""
        wrong = smooth and gap < CORNER * best
        return f"the derivative is {best:.1e} off {slope}" if wrong else None


def _forward(function, x, way, *rest):
    return jax.jvp(lambda x: jnp.asarray(function(x, *rest)), (x,), (way,))
