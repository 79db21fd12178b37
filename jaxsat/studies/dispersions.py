"""Dispersed copies of a nominal closed loop, each one case of a study."""

from collections.abc import Mapping
from typing import Any, NamedTuple, TypeVar

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree, UInt32

from jaxsat.core import noise
from jaxsat.core.array_types import BoolScalar
from jaxsat.core.checks import as_array
from jaxsat.core.declaration.quantities import DISPERSIBLE, EXCLUSIVE
from jaxsat.simulation.engine.program import AbstractCaseFactory, Case
from jaxsat.simulation.loops import AbstractLoop
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.sensors import Sensors
from jaxsat.studies.changes import (
    PerturbedLoop,
    controller_of,
    follow_frequency,
    possible_belief,
    possible_body,
    with_controller,
)
from jaxsat.studies.designs import open_uniform
from jaxsat.studies.dispersion_problems import dispersion_problems, limits_of
from jaxsat.studies.distributions import AbstractProbabilityDistribution
from jaxsat.studies.quantities import QUANTITIES

Tree = TypeVar("Tree")

ATTEMPTS = 32
"""Largest number of inertia draws before a case is treated as impossible."""

BODY = tuple(name for name, one in DISPERSIBLE.items() if one.stage == "body")
BELIEF = ("model_inertia",)
RATES = frozenset({"omega", "rate_error"})
"""Quantities that change the initial rate."""


class Dispersions(eqx.Module):
    """Distributions by the name of the dispersed quantity; see `QUANTITIES` for the names.

    With `frequency_known` the law's internal model and ripple estimator follow the dispersed
    disturbance frequency.
    """

    distributions: dict[str, AbstractProbabilityDistribution]
    frequency_known: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        unknown = sorted(set(self.distributions) - set(QUANTITIES))
        if unknown:
            raise ValueError(
                f"Dispersed quantities must be among {', '.join(QUANTITIES)}, but got {unknown}."
            )
        for one, other in EXCLUSIVE:
            if one in self.distributions and other in self.distributions:
                raise ValueError(f"`{one}` and `{other}` must not both be dispersed.")

    @property
    def names(self) -> tuple[str, ...]:
        """Dispersed names in the order in which they are applied."""
        return tuple(name for name in QUANTITIES if name in self.distributions)

    @property
    def ordered(self) -> dict[str, AbstractProbabilityDistribution]:
        """Distributions in the order in which they are applied."""
        return {name: self.distributions[name] for name in self.names}

    def check(self, loop: AbstractLoop, start: PlantState | None = None) -> None:
        """Raise `ValueError` for the first of `dispersion_problems`."""
        for problem in dispersion_problems(self.ordered, self.frequency_known, loop, start):
            got = "" if problem.got is None else f", but got {problem.got}"
            raise ValueError(f"`{problem.quantity}` {problem.rule}{got}.")

    def dimensions(self, loop: AbstractLoop) -> dict[str, int]:
        """Number of unit coordinates of each name."""
        return {
            name: self.distributions[name].dimension(QUANTITIES[name].size(loop))
            for name in self.names
        }


class StudyCase(NamedTuple):
    """The number that seeds the noise of a case, and the case's point in the unit cube."""

    number: UInt32[Array | np.ndarray, "*n"]
    point: Float[Array | np.ndarray, "*n dimension"]


class Dispersed(AbstractCaseFactory):
    """The cases of a study: a nominal loop and start, dispersed.

    `key` belongs to the study's seed. A call with a case returns its copy; numbers in `gains`, by
    dotted name inside the controller, replace the nominal ones. If the drawn inertia is impossible,
    inertia and products are drawn again from keys of their own; a case without a possible one in
    `ATTEMPTS` draws is treated as impossible, and so is one with a draw from the tail of a
    distribution that exceeds the limits of its quantity.
    """

    loop: AbstractLoop
    start: PlantState
    dispersions: Dispersions
    key: UInt32[Array, "2"]

    def __init__(self, loop: AbstractLoop, start: PlantState, dispersions: Dispersions, seed: int):
        dispersions.check(loop, start)
        self.loop = _with_sensor_key(loop, as_array(np.zeros(2, np.uint32)))
        self.start = start
        self.dispersions = dispersions
        self.key = noise.key_of_seed(seed)

    def dimensions(self) -> dict[str, int]:
        """Number of unit coordinates of each name."""
        return self.dispersions.dimensions(self.loop)

    @property
    def has_noise(self) -> bool:
        """Whether a case depends on more than its point."""
        loop = self.loop
        if not isinstance(loop, SampledLoop):
            return False
        return any(one is not None for one in (loop.sensors, loop.navigation, loop.tachometers))

    def __call__(self, case: StudyCase, gains: dict[str, Array] | None = None) -> Case:
        """Return the copy of one case."""
        own_key = noise.fold_in(self.key, case.number)
        draws, possible = self._draw(jnp.asarray(case.point), own_key)
        perturbed = PerturbedLoop(with_gains(self.loop, gains), self.start, self.loop)
        for name in self.dispersions.names:
            perturbed = QUANTITIES[name].apply(perturbed, draws[name])
        loop = perturbed.loop
        if self.dispersions.frequency_known:
            loop = follow_frequency(loop)
        sensor_key = noise.fold_in(own_key, noise.name_number("sensor noise"))
        return Case(_with_sensor_key(loop, sensor_key), perturbed.start, draws, possible)

    def _draw(self, point: Float[Array, " dimension"], own_key: noise.Key):
        dimensions = self.dimensions()
        ends = np.cumsum([0, *dimensions.values()])
        spans = zip(dimensions, ends, ends[1:], strict=False)
        coordinates = {name: point[begin:end] for name, begin, end in spans}
        draws = {
            name: self.dispersions.distributions[name].quantile(coordinates[name])
            for name in dimensions
        }
        possible = self._within_limits(draws)
        for group, possible_in in ((BODY, possible_body), (BELIEF, possible_belief)):
            names = [name for name in group if name in draws]
            if names:
                redraws, fine = self._draw_until_possible(names, coordinates, own_key, possible_in)
                draws |= redraws
                possible = possible & fine
        return draws, possible

    def _within_limits(self, draws) -> BoolScalar:
        """Whether all draws from distributions with tails are within their quantities' limits.

        Inertias are omitted: they are drawn again until they are possible.
        """
        good = jnp.array(True)
        for name, values in draws.items():
            tails = not self.dispersions.distributions[name].is_bounded()
            if tails and name not in (*BODY, *BELIEF):
                low, high = limits_of(name, self.dispersions.frequency_known, self.loop)
                good = good & jnp.all((values >= low) & (values <= high))
        return good

    def _draw_until_possible(self, names, coordinates, own_key, possible_in):
        """Return the first of several draws of `names` that makes a possible body.

        Without any, the very first.
        """

        def draw(attempt):
            values = {}
            for name in names:
                fresh = noise.fold_in(noise.fold_in(own_key, noise.name_number(name)), attempt)
                point = coordinates[name]
                u = jnp.where(attempt == 0, point, open_uniform(fresh, len(point)))
                values[name] = self.dispersions.distributions[name].quantile(u)
            perturbed = PerturbedLoop(self.loop, self.start, self.loop)
            for name in names:
                perturbed = QUANTITIES[name].apply(perturbed, values[name])
            return values, possible_in(perturbed.loop)

        def unlucky(state):
            turn, (_, fine) = state
            return ~fine & (turn <= ATTEMPTS)

        def once_more(state):
            turn, _ = state
            return turn + 1, draw(turn % ATTEMPTS)

        nothing = jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), jax.eval_shape(draw, 0))
        return jax.lax.while_loop(unlucky, once_more, (0, nothing))[1]


def with_gains(loop: AbstractLoop, gains: dict[str, Array] | None) -> AbstractLoop:
    """Return the loop with other numbers at dotted names inside its controller.

    Raises `AttributeError` for a name that the controller does not have.
    """
    if not gains:
        return loop
    return with_controller(loop, with_numbers(controller_of(loop), gains))


def with_numbers(tree: Tree, numbers: Mapping[str, Array]) -> Tree:
    """Return a module with other numbers at dotted names inside it."""
    for name, value in numbers.items():
        tree = eqx.tree_at(lambda tree, name=name: number_at(tree, name), tree, value)
    return tree


def number_at(tree: PyTree, name: str) -> Any:
    """Return the number at a dotted name inside a module."""
    for part in name.split("."):
        tree = getattr(tree, part)
    return tree


def _with_sensor_key(loop: AbstractLoop, key: noise.Key) -> AbstractLoop:
    if isinstance(loop, SampledLoop) and loop.tachometers is not None:
        loop = eqx.tree_at(lambda loop: loop.tachometers.key, loop, key)
    if isinstance(loop, SampledLoop) and isinstance(loop.sensors, Sensors):
        return eqx.tree_at(lambda loop: loop.sensors.key, loop, key)
    if isinstance(loop, SampledLoop) and loop.navigation is not None:
        return eqx.tree_at(lambda loop: loop.navigation.key, loop, key)
    return loop
