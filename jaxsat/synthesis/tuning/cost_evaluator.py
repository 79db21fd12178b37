"""Costs of many cases at many points of the search at once, with a count of trajectories."""

import dataclasses
from collections.abc import Callable, Mapping
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass, field
from typing import Any, Literal, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxsat.core.checks import require_counts
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.interface import AbstractEngine, program_identity
from jaxsat.simulation.engine.program import AbstractCaseFactory, Case, Program
from jaxsat.simulation.engine.progress import Outputs
from jaxsat.simulation.engine.stepper import AbstractStepper
from jaxsat.studies.designs import AbstractDesign
from jaxsat.studies.dispersions import Dispersed, StudyCase
from jaxsat.synthesis.tuning.parameters import SearchSpace, Values

GradientMethod = Literal["forward", "reverse", "differences"]
"""Method of derivatives: either mode of the engine, or central differences of costs."""


class CaseWithGains(NamedTuple):
    """A case and its gains."""

    case: PyTree
    gains: Mapping[str, Array | np.ndarray]


class WithGains(AbstractCaseFactory):
    """Cases with individual gains, so that one batch holds many points of the search.

    Gains given to an engine are added to them: zero, the variables of derivatives.
    """

    inner: AbstractCaseFactory

    def __call__(self, case: CaseWithGains, gains: dict[str, Array] | None = None) -> Case:
        """Return the case with its own gains."""
        shift = gains or {}
        own = {name: jnp.asarray(value) + shift.get(name, 0) for name, value in case.gains.items()}
        return self.inner(case.case, own)


class CaseGradients(NamedTuple):
    """Outputs (points, cases) and derivatives of the costs along the search."""

    outputs: Outputs
    derivatives: Float[np.ndarray, "points cases parameters"]


@dataclass
class TrajectoryCounter:
    """Number of trajectories, in units of whole horizons.

    A gradient of n gains counts n + 1; by differences, 2n + 1.
    """

    trajectories: float = 0.0


@dataclass(frozen=True)
class CostEvaluator:
    """A program over dispersed cases, the cases of a design, and an engine to run them.

    Batches are shared among `workers` threads, without effect on the results. Derivatives by
    "differences", of half width `half_width` along the search, see what automatic differentiation
    is blind to, such as thresholds at which a law switches between samples. With `recovery` a case
    costs `recovery_costs` in place of its integral, and `penalty` adds to the costs of a point the
    violation of a constraint by its values.
    """

    program: Program
    design: AbstractDesign
    engine: AbstractEngine
    space: SearchSpace
    workers: int = 1
    gradient: GradientMethod = "forward"
    half_width: float = 0.02
    recovery: float | None = None
    penalty: Callable[[Values], Float[np.ndarray, " points"]] | None = None
    counter: TrajectoryCounter = field(default_factory=TrajectoryCounter)

    def __post_init__(self):
        if not isinstance(self.program.case_factory, Dispersed):
            raise TypeError("Argument `program` must run dispersed cases.")
        require_counts(workers=self.workers)

    def evaluate(
        self, points: Values, numbers: np.ndarray, intervals: int | None = None
    ) -> Outputs:
        """Return outputs (points, cases) of the cases `numbers` at every point of the search."""
        program = self._program(intervals)

        def run(cases: CaseWithGains) -> Outputs:
            return self.engine.evaluate(program, cases, None)

        outputs = _by_point(self._in_batches(run, points, numbers), points, numbers)
        self._count(points, numbers, 1, intervals)
        if self.recovery is not None:
            horizon = float(np.asarray(program.duration))
            outputs = outputs._replace(cost=recovery_costs(outputs, horizon, self.recovery))
        if self.penalty is not None:
            more = self.penalty(self.space.to_values(points))
            outputs = outputs._replace(cost=outputs.cost + more[:, None])
        return outputs

    def differentiate(
        self, points: Values, numbers: np.ndarray, intervals: int | None = None
    ) -> CaseGradients:
        """Return outputs and derivatives of the costs in the units of the search."""
        if self.gradient == "differences":
            return self._differences(points, numbers, intervals)
        mode = self.gradient
        program, space, zero = self._program(intervals), self.space, self._zero()

        def run(cases: CaseWithGains) -> Any:
            return self.engine.gradient(program, cases, zero, mode)

        gradients = self._in_batches(run, points, numbers)
        self._count(points, numbers, 1 + space.size, intervals)
        leading = (len(points), len(numbers))
        by_value = space.joined(gradients.derivatives, leading)
        return CaseGradients(
            _by_point(gradients.outputs, points, numbers),
            by_value * space.slope(points)[:, None, :],
        )

    def _differences(
        self, points: Values, numbers: np.ndarray, intervals: int | None
    ) -> CaseGradients:
        size, count = self.space.size, len(points)
        shifts = self.half_width * np.concatenate(
            [np.eye(size), -np.eye(size), np.zeros((1, size))]
        )
        spread = self.space.projected(points[:, None] + shifts[None])
        apart = np.diagonal(spread[:, :size] - spread[:, size : 2 * size], axis1=1, axis2=2)
        around = spread.reshape(-1, size)
        outputs = self.evaluate(around, numbers, intervals)
        costs = np.asarray(outputs.cost).reshape(count, 2 * size + 1, -1)
        slopes = (costs[:, :size] - costs[:, size : 2 * size]) / apart[:, :, None]
        middle = jax.tree.map(lambda x: x[2 * size :: 2 * size + 1], outputs)
        return CaseGradients(middle, np.moveaxis(slopes, 1, 2))

    def derivative_of_one(
        self, point: Float[np.ndarray, " parameters"], number: int, gain: int, intervals: int | None
    ) -> tuple[AbstractStepper, Program, CaseWithGains, dict[str, Array], dict[str, Array]]:
        """Return the arguments of `nan_in_run` for one case at a point and one tuned number.

        The diffrax engine has no single steps; its runs get those of the scan engine.
        """
        stepper = getattr(self.engine, "stepper", None)
        gains = self.space.gains(self.space.to_values(point))
        case = jax.tree.map(lambda x: x[0], self.drawn(np.array([number])))
        direction = self.space.gains(np.eye(self.space.size)[gain])
        return (
            FixedStepper() if stepper is None else stepper,
            self._program(intervals),
            CaseWithGains(case, gains),
            self._zero(),
            jax.tree.map(jnp.asarray, direction),
        )

    def program_identity(self, *, differentiated: bool = False) -> dict[str, Any]:
        """Return the fingerprint of the program, with derivatives if an engine mode takes them."""
        gains = self.space.gains(np.zeros((1, self.space.size)))
        example = CaseWithGains(self.drawn(np.arange(1)), gains)
        if not differentiated or self.gradient == "differences":
            return program_identity(self.engine, self._program(None), example)
        return program_identity(
            self.engine, self._program(None), example, self._zero(), self.gradient
        )

    def drawn(self, numbers: np.ndarray) -> StudyCase:
        """Return the cases of these numbers."""
        factory: Dispersed = self.program.case_factory  # pyright: ignore[reportAssignmentType]
        points = self.design.points(numbers, factory.dimensions())
        return StudyCase(np.asarray(numbers).astype(np.uint32), points)

    def _zero(self) -> dict[str, Array]:
        return jax.tree.map(jnp.asarray, self.space.gains(np.zeros(self.space.size)))

    def _program(self, intervals: int | None) -> Program:
        return dataclasses.replace(
            self.program,
            case_factory=WithGains(self.program.case_factory),
            intervals=self.program.intervals if intervals is None else intervals,
        )

    def _count(self, points: Values, numbers: np.ndarray, runs: int, intervals: int | None) -> None:
        part = 1.0 if intervals is None else intervals / self.program.intervals
        self.counter.trajectories += len(points) * len(numbers) * runs * part

    def _in_batches(self, run: Callable, points: Values, numbers: np.ndarray):
        """Run points × cases in whole batches, the first alone, as it may compile."""
        gains = self.space.gains(self.space.to_values(points))
        cases = jax.tree.map(
            lambda x: np.tile(x, (len(points), *[1] * (x.ndim - 1))), self.drawn(numbers)
        )
        own = {name: np.repeat(value, len(numbers), axis=0) for name, value in gains.items()}
        everything = CaseWithGains(cases, own)
        total, size = len(points) * len(numbers), self.engine.batch_size
        if self.workers == 1 or total <= 2 * size:
            return run(everything)
        batches = [
            jax.tree.map(lambda x, at=first: x[at : at + size], everything)
            for first in range(0, total, size)
        ]
        first = run(batches[0])
        with ThreadPoolExecutor(self.workers, thread_name_prefix="jaxsat") as pool:
            results = [first, *pool.map(run, batches[1:])]
        return jax.tree.map(lambda *parts: np.concatenate(parts), *results)


def recovery_costs(outputs: Outputs, horizon: float, unrecovered: float) -> np.ndarray:
    """Return times from the first failure until a case is settled, over the horizon (s).

    Without dispersed failures they are times from the start. A case that never settles costs
    `unrecovered`.
    """
    settled = np.asarray(outputs.settling_time)
    strikes = outputs.drawn.get("failure_time")
    since = 0.0 if strikes is None else np.clip(np.asarray(strikes).min(axis=-1), 0.0, horizon)
    return np.where(np.isfinite(settled), np.maximum(settled - since, 0.0) / horizon, unrecovered)


def _by_point(outputs: Outputs, points: Values, numbers: np.ndarray) -> Outputs:
    leading = (len(points), len(numbers))
    return jax.tree.map(lambda x: x.reshape(*leading, *x.shape[1:]), outputs)
