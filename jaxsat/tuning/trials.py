"""Running many cases at many points of the search at once, and counting what that takes."""

from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxsat.engine import AbstractCopies, AbstractEngine, Copy, Mode, Outputs, Program
from jaxsat.montecarlo import AbstractDesign, Dispersed, StudyCase
from jaxsat.tuning.parameters import SearchSpace, Values


class GainedCase(NamedTuple):
    """A case and the gains that it is run with."""

    case: PyTree
    gains: dict[str, Array]


class Gained(AbstractCopies):
    """Copies with gains of their own, so that one batch holds many points of the search.

    The gains that an engine is given on top are added to them: zero, and what derivatives are
    taken by.
    """

    copies: AbstractCopies

    def __call__(self, case: GainedCase, gains: dict[str, Array] | None = None) -> Copy:
        """The copy of one case."""
        own = case.gains
        if gains is not None:
            own = {name: value + gains[name] for name, value in own.items()}
        return self.copies(case.case, own)


class Slopes(NamedTuple):
    """Outputs (points, cases) and derivatives of the costs along the search."""

    outputs: Outputs
    derivatives: Float[np.ndarray, "points cases parameters"]


@dataclass
class Counter:
    """Trajectories computed, in units of whole horizons; a gradient of n gains counts n + 1."""

    trajectories: float = 0.0


@dataclass(frozen=True)
class Trials:
    """A program over dispersed copies, the cases of a design, and an engine to run them.

    `workers` threads share the blocks of a batch out; the results do not depend on how.
    """

    program: Program
    design: AbstractDesign
    engine: AbstractEngine
    space: SearchSpace
    workers: int = 1
    mode: Mode = "forward"
    counter: Counter = field(default_factory=Counter)

    def __post_init__(self):
        if not isinstance(self.program.copies, Dispersed):
            raise TypeError("Argument `program` must run dispersed copies.")
        if self.workers < 1:
            raise ValueError(f"Argument `workers` must be at least 1, but got {self.workers}.")

    def evaluate(
        self, points: Values, numbers: np.ndarray, intervals: int | None = None
    ) -> Outputs:
        """Outputs (points, cases) of the cases `numbers` at every point of the search."""
        program = self._program(intervals)

        def run(cases: GainedCase) -> Outputs:
            return self.engine.evaluate(program, cases, None)

        outputs = self._over_blocks(run, points, numbers)
        self._count(points, numbers, 1, intervals)
        return _by_point(outputs, points, numbers)

    def differentiate(
        self, points: Values, numbers: np.ndarray, intervals: int | None = None
    ) -> Slopes:
        """Outputs and derivatives of the costs along the search, in the units of the search."""
        program, space = self._program(intervals), self.space
        zero = jax.tree.map(jnp.asarray, space.gains(np.zeros(space.size)))

        def run(cases: GainedCase) -> Any:
            return self.engine.gradient(program, cases, zero, self.mode)

        found = self._over_blocks(run, points, numbers)
        self._count(points, numbers, 1 + space.size, intervals)
        leading = (len(points), len(numbers))
        by_value = space.joined(found.derivatives, leading)
        return Slopes(
            _by_point(found.outputs, points, numbers), by_value * space.slope(points)[:, None, :]
        )

    def drawn(self, numbers: np.ndarray) -> StudyCase:
        """The cases of these numbers."""
        copies: Dispersed = self.program.copies  # pyright: ignore[reportAssignmentType]
        points = self.design.points(numbers, copies.dimensions())
        return StudyCase(np.asarray(numbers).astype(np.uint32), points)

    def _program(self, intervals: int | None) -> Program:
        whole = self.program
        count = whole.intervals if intervals is None else intervals
        rest = (whole.tolerances, whole.cost, whole.state_limit)
        return Program(Gained(whole.copies), whole.interval, count, *rest)

    def _count(self, points: Values, numbers: np.ndarray, runs: int, intervals: int | None) -> None:
        part = 1.0 if intervals is None else intervals / self.program.intervals
        self.counter.trajectories += len(points) * len(numbers) * runs * part

    def _over_blocks(self, run: Callable, points: Values, numbers: np.ndarray):
        """`run` over points × cases in pieces of whole blocks, the first alone: it may compile."""
        gains = self.space.gains(self.space.to_values(points))
        cases = jax.tree.map(
            lambda x: np.tile(x, (len(points), *[1] * (x.ndim - 1))), self.drawn(numbers)
        )
        own = {name: np.repeat(value, len(numbers), axis=0) for name, value in gains.items()}
        everything = GainedCase(cases, own)
        total, width = len(points) * len(numbers), self.engine.width
        if self.workers == 1 or total <= 2 * width:
            return run(everything)
        blocks = -(-total // width)
        pieces = [
            jax.tree.map(lambda x, b=block: x[b * width : (b + 1) * width], everything)
            for block in range(blocks)
        ]
        first = run(pieces[0])
        with ThreadPoolExecutor(self.workers, thread_name_prefix="jaxsat") as pool:
            found = [first, *pool.map(run, pieces[1:])]
        return jax.tree.map(lambda *parts: np.concatenate(parts), *found)


def _by_point(outputs: Outputs, points: Values, numbers: np.ndarray) -> Outputs:
    leading = (len(points), len(numbers))
    return jax.tree.map(lambda x: x.reshape(*leading, *x.shape[1:]), outputs)
