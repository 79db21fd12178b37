"""Reasons why distributions cannot disperse the quantities of a closed loop."""

from collections.abc import Iterator, Mapping
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np

from jaxsat.control.three_axis import InternalModel
from jaxsat.core import ranges
from jaxsat.core.checks import concrete
from jaxsat.core.declaration.quantities import DISPERSIBLE
from jaxsat.simulation.loops import AbstractLoop, parts_of
from jaxsat.spacecraft.dispersible import Limits
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.studies.changes import controller_of, periodic_of
from jaxsat.studies.distributions import AbstractProbabilityDistribution, Discrete, RandomAttitude
from jaxsat.studies.quantities import QUANTITIES

Distributions = Mapping[str, AbstractProbabilityDistribution]


class DispersionProblem(NamedTuple):
    """Reason why a quantity cannot be dispersed: `rule` is "must …", `got` the actual value.

    `parameter` is the offending parameter of the distribution, if any. `lacking` is whether the
    loop has no such quantity, whatever its distribution.
    """

    quantity: str
    rule: str
    got: str | None = None
    parameter: str | None = None
    lacking: bool = False


def dispersion_problems(
    distributions: Distributions,
    frequency_known: bool,
    loop: AbstractLoop,
    start: PlantState | None = None,
) -> Iterator[DispersionProblem]:
    """Yield every problem with the dispersion of a nominal loop and start, quantity by quantity.

    Problems are a quantity that the loop lacks, an unsuitable distribution, another number of
    components, and values outside the quantity's limits. For a normal distribution only the mean is
    checked: each draw shows whether its tails exceed the limits. Traced numbers are not checked.
    """
    for name, distribution in distributions.items():
        obstacle = QUANTITIES[name].obstacle(loop)
        if obstacle is not None:
            yield DispersionProblem(name, f"must not be dispersed here: {obstacle}", lacking=True)
            continue
        own = _of_the_kind(name, distribution, loop) or _singular(name, start)
        if own is not None:
            yield own
        else:
            yield from _outside(name, distribution, limits_of(name, frequency_known, loop), loop)
    if frequency_known:
        yield from _unknowable(loop)


def limits_of(name: str, frequency_known: bool, loop: AbstractLoop) -> Limits:
    """Limits of a quantity's draws; an internal model excludes frequencies of zero or less."""
    limits = QUANTITIES[name].limits(loop)
    if name != "disturbance_frequency" or not frequency_known:
        return limits
    knowable = Limits.of_change(ranges.KNOWN_FREQUENCY, periodic_of(loop).frequency)
    about_xy = np.array([True, True, False])
    xp = np if isinstance(knowable.low, np.ndarray) else jnp
    return Limits(
        xp.where(about_xy, xp.maximum(limits.low, knowable.low), limits.low),
        xp.where(about_xy, xp.minimum(limits.high, knowable.high), limits.high),
    )


def _of_the_kind(
    name: str, distribution: AbstractProbabilityDistribution, loop: AbstractLoop
) -> DispersionProblem | None:
    if DISPERSIBLE[name].random_attitude != isinstance(distribution, RandomAttitude):
        kind = type(distribution).__name__
        rule = "must have RandomAttitude if it is `attitude` and only then"
        return DispersionProblem(name, rule, kind, "distribution")
    size, components = QUANTITIES[name].size(loop), distribution.components()
    if components not in (None, size):
        return DispersionProblem(name, f"must have {size} components", str(components))
    return None


def _singular(name: str, start: PlantState | None) -> DispersionProblem | None:
    """Problem of a change of (w, z) that is singular at this start."""
    if start is None or name not in ("tilt", "tilt_direction", "turn"):
        return None
    w = concrete(start.attitude.as_wz().w)
    if w is None:
        return None
    if not np.isfinite(w).all():
        rule = "must have a start that is not upside down, where (w, z) are singular"
        return DispersionProblem(name, rule)
    if name == "tilt" and not w.any():
        rule = "must have a start that is tilted, whose direction it keeps"
        return DispersionProblem(name, rule)
    return None


def _outside(
    name: str, distribution: AbstractProbabilityDistribution, limits: Limits, loop: AbstractLoop
) -> Iterator[DispersionProblem]:
    size, unit = QUANTITIES[name].size(loop), DISPERSIBLE[name].unit.removesuffix("1")
    low, high = concrete(limits.low), concrete(limits.high)
    if low is None or high is None:
        return
    if isinstance(distribution, Discrete):
        if distribution.components() is None:  # each component may be any of the values
            low, high = np.max(low), np.min(high)
        else:
            low, high = (np.broadcast_to(x, size)[:, None] for x in (low, high))
    for parameter, values in distribution.ends().items():
        ends = concrete(values)
        if ends is None:
            continue
        shape = ends.shape if isinstance(distribution, Discrete) else (size,)
        numbers, least, most = (np.broadcast_to(x, shape) for x in (ends, low, high))
        bad = np.argwhere((numbers < least) | (numbers > most))
        if bad.size:
            first = tuple(bad[0])
            below = numbers[first] < least[first]
            limit = f"at least {least[first]:.6g}" if below else f"at most {most[first]:.6g}"
            which = f" (component {first[0] + 1})" if ends.ndim != 1 and size > 1 else ""
            entry = f" as entry {first[-1] + 1}" if ends.ndim else ""
            rule = f"must be {f'{limit} {unit}'.strip()}{which}"
            yield DispersionProblem(name, rule, f"{numbers[first]:.6g}{entry}", parameter)


def _unknowable(loop: AbstractLoop) -> Iterator[DispersionProblem]:
    name = "disturbance_frequency"
    obstacle = QUANTITIES[name].obstacle(loop)
    if obstacle is not None:
        rule = f"must not be known to the law: {obstacle}"
        yield DispersionProblem(name, rule, parameter="frequency_known", lacking=True)
    elif parts_of(InternalModel, controller_of(loop)):
        frequency = concrete(periodic_of(loop).frequency)
        if frequency is not None and not np.all(frequency[:2] > 0):
            rule = "must be above zero about x and y for the law to know it"
            got = f"{frequency[:2].tolist()} rad/s"
            yield DispersionProblem(name, rule, got, "frequency_known")
