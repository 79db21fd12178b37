"""A single run: one case of a detailed program, by machine code or by diffrax, densely observed."""

import dataclasses
from collections.abc import Callable
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, PyTree

from jaxsat.core.array_types import RealScalar
from jaxsat.core.checks import as_array, as_float, concrete
from jaxsat.core.jax_internals import Tracer
from jaxsat.core.process import no_collection
from jaxsat.core.ranges import STATE_LIMIT
from jaxsat.core.tolerances import Tolerances
from jaxsat.core.trees import strong
from jaxsat.simulation.assessment import Assessment
from jaxsat.simulation.engine.adaptive import AdaptiveStepper, Tolerance
from jaxsat.simulation.engine.dense_output import require_dense_output
from jaxsat.simulation.engine.diffrax_run import integrated
from jaxsat.simulation.engine.fixed import FixedStepper, SampledStepper
from jaxsat.simulation.engine.native import NativeEngine, native_obstacle
from jaxsat.simulation.engine.program import (
    AbstractCaseFactory,
    Case,
    Program,
    observations_per_save,
)
from jaxsat.simulation.engine.progress import Outputs
from jaxsat.simulation.engine.runge_kutta import require_explicit
from jaxsat.simulation.engine.stepper import AbstractStepper
from jaxsat.simulation.held_torque import saved
from jaxsat.simulation.loops import AbstractContinuousLoop, AbstractLoop
from jaxsat.simulation.methods import AdaptiveSteps, Adjoint, Method, checkpoints, default_method
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.simulation.trajectory import Signals, Trajectory
from jaxsat.spacecraft.dynamics import PlantState


def simulate(
    loop: AbstractLoop,
    start: PlantState,
    times: ArrayLike | list,
    *,
    method: Method | None = None,
    adjoint: Adjoint | None = None,
    state_limit: float = STATE_LIMIT,
    tolerances: Tolerances | None = None,
) -> Trajectory:
    """Run a closed loop from `start` at `times[0]` and save its signals at `times` (s).

    Without a `method` the loop's default is used. `adjoint` chooses how diffrax differentiates a
    continuous loop (by default reverse mode with checkpoints; `diffrax.ForwardMode()` for few
    gains); a sampled loop takes both modes and needs none. Settling, by `tolerances`, is judged on
    the integrator's own steps and their dense output, so it does not depend on the saved times; it
    is not differentiated. A run that fails raises nothing: see `Trajectory.code`. Raises
    `ValueError` for times that do not increase, or, for a sampled loop, that are not sampling
    instants.
    """
    times = as_float(times)
    instants = concrete(times)
    if instants is not None and (
        instants.ndim != 1 or len(instants) < 2 or not np.all(np.diff(instants) > 0)
    ):
        raise ValueError("Argument `times` must be at least two increasing numbers of seconds.")
    method = default_method(loop) if method is None else method
    loop, start = strong((loop, start))
    numbers, interval, count = None, times[-1] - times[0], 1
    if isinstance(loop, SampledLoop):
        numbers = sample_numbers(loop, times)
        interval, count = loop.controller.period, int(numbers[-1])
    elif not isinstance(loop, AbstractContinuousLoop):
        raise TypeError(f"Argument `loop` must be a loop of jaxsat.simulation, got {type(loop)}.")
    adjoint = checkpoints() if adjoint is None else adjoint
    with jax.debug_nans(False):  # NaN marks times not reached
        program, case = _program(loop, start, interval, count, tolerances, state_limit)
        return _by_diffrax(program, case, times, numbers, method, adjoint)


@eqx.filter_jit
def _by_diffrax(program: Program, case: PyTree, times, numbers, method, adjoint) -> Trajectory:
    case, instants = program.case_factory(*case), times
    if numbers is not None:
        instants = times[0] + program.time_of(jnp.arange(program.intervals + 1))
    outputs, signals, holds = integrated(program, case, instants, method, adjoint)
    if holds is None or numbers is None:
        return _trajectory(times, outputs, signals)
    return _trajectory(times, outputs, saved(signals, numbers, holds))


@no_collection()
def fly(
    loop: AbstractLoop,
    start: PlantState,
    times: Float[Array, " times"],
    method: Method,
    tell: Callable[[str], None] = lambda obstacle: None,
    tolerances: Tolerances | None = None,
) -> Trajectory:
    """Run a closed loop from `start` and save its signals at `times` (s), evenly spaced from zero.

    The result equals that of `simulate` to the accuracy of the method. Machine code, compiled in
    seconds for all numbers, takes equal steps of at most the method's length that meet the times,
    or adaptive ones that end on a law's corners. `simulate` runs all that the compiled engine
    cannot, including traced values (for differentiation). If steps of the smallest length miss the
    tolerance, as at a point where the law has no derivative, a run with a tenth of tolerances and
    smallest step replaces the first. `tell` receives a remark in both cases.
    """
    loop, start = strong((loop, start))
    flight = _plan(loop, start, times, method, tolerances)
    if isinstance(flight, str):
        tell(f"the compiled engine, which starts in seconds, cannot run this: {flight}")
        return simulate(loop, start, times, method=method, tolerances=tolerances)
    trajectory, forced = flight.fly(times)
    if not forced:
        return trajectory
    finer = flight.finer.fly(times)[0]
    tell(_remark(forced, trajectory, finer))
    return trajectory if finer.outcome and not trajectory.outcome else finer


def _remark(forced: int, trajectory: Trajectory, finer: Trajectory) -> str:
    """Remark about `forced` steps that miss the tolerance, judged by a finer run."""
    cause = f"{forced} steps of the smallest length miss the tolerance (the law has no derivative)"
    if finer.outcome:
        return (
            f"{cause}; finer steps do not reach the end ({finer.outcome.explanation}): the error "
            "is unknown"
        )
    rates, before = (np.asarray(one.signals.omega) for one in (finer, trajectory))
    difference = np.abs(rates - before).max(axis=1)
    remark = f"{cause}; tolerances and smallest step are divided by ten, which changes "
    differs = difference > PARTED * np.nanmax(np.abs(rates))
    if not differs.any():
        return f"{remark}the rates by at most {np.nanmax(difference):.1g} rad/s"
    return (
        f"{remark}the rates by up to {np.nanmax(difference):.1g} rad/s from "
        f"{trajectory.times[differs.argmax()]:g} s on: do not rely on single values after that"
    )


PARTED = 1e-4
"""Largest difference between two runs' rates, relative to the largest rate, that is not
reported."""


TABLE = 256
"""Largest size of an array that is not a table, such as one of gains over an orbit."""


ERROR_EVERY = 7
"""Number of periods of a sampled loop per error estimate, which takes twice as long as the steps.
Coprime to 2, 3, 4, 5, 8 and 10, so that sensors and pulses that repeat after so many periods are
met in each of their phases."""


class _OneCase(AbstractCaseFactory):
    """The case whose numbers are the arrays of a loop and of its start, as a list.

    Arrays larger than `TABLE` are at its end, in the gains: machine code copies a case into its
    state, number by number, and reads gains in place. (A stored kernel compares the structure of
    its arguments, and a loop's need not equal itself after it has been written and read. `places`
    has the numbers of the arrays in that list.)
    """

    rest: PyTree
    places: PyTree

    def __call__(self, case, gains):
        numbers = [*case, *gains]
        arrays = jax.tree.map(lambda place: numbers[place], self.places)
        loop, start = eqx.combine(arrays, self.rest)
        return Case(loop, start, {}, jnp.array(True))


class _Flight(eqx.Module):
    """A program of one case, its stepper, and the number of intervals between saves."""

    program: Program
    stepper: AbstractStepper
    case: list[Array]
    tables: list[Array]
    every: int = eqx.field(static=True)

    @property
    def cases(self) -> PyTree:
        """The case with a leading axis."""
        return jax.tree.map(lambda x: np.asarray(x)[None], self.case)

    @property
    def finer(self) -> "_Flight":
        """The flight with adaptive steps at a tenth of the tolerances and smallest step."""
        stepper = cast(AdaptiveStepper, self.stepper)
        tolerance = stepper.tolerance
        numbers = [x / 10 for x in (tolerance.rtol, tolerance.atol, tolerance.min_step)]
        return eqx.tree_at(
            lambda one: [getattr(one.stepper.tolerance, x) for x in ("rtol", "atol", "min_step")],
            self,
            numbers,
        )

    def fly(self, times: Float[Array, " times"]) -> tuple[Trajectory, int]:
        """The run, and the number of steps of the smallest length that miss the tolerance."""
        engine = NativeEngine(stepper=self.stepper, simd_lanes=1)
        instants = self.program.instants(self.every)
        batch = engine.observed(self.program, self.cases, self.tables, instants)
        outputs, signals = jax.tree.map(lambda x: x[0], batch)
        forced = int(outputs.details.forced or 0)
        with jax.debug_nans(False):  # NaN marks missing values, as of a failed actuator
            outputs, signals = jax.tree.map(lambda x: as_array(np.asarray(x)), (outputs, signals))
        return _trajectory(times, outputs, signals), forced


def _plan(
    loop: AbstractLoop,
    start: PlantState,
    times: Float[Array, " times"],
    method: Method,
    tolerances: Tolerances | None,
) -> _Flight | str:
    """The flight, or the reason why there is none."""
    if any(isinstance(leaf, Tracer) for leaf in jax.tree.leaves((loop, start, method))):
        return "JAX traces its numbers"
    instants = np.asarray(times)
    gaps = np.diff(instants)
    if instants[0] != 0 or np.ptp(gaps) > 1e-9 * instants[-1]:
        return "the times to save are not even, from zero on"
    save_every = float(instants[-1]) / len(gaps)
    every = observations_per_save(save_every)
    interval = save_every / every
    stepper = _stepper(loop, method, interval)
    if isinstance(stepper, str):
        return stepper
    if isinstance(loop, SampledLoop):
        interval, every = loop.controller.period, int(sample_numbers(loop, times)[1])
    program, case = _program(loop, start, interval, every * len(gaps), tolerances)
    flight = _Flight(program, stepper, *case, every)
    obstacle = native_obstacle(stepper, program, flight.cases, flight.tables, lanes=1)
    return flight if obstacle is None else obstacle


def _program(
    loop: AbstractLoop,
    start: PlantState,
    interval: float | RealScalar,
    count: int,
    tolerances: Tolerances | None,
    state_limit: float = STATE_LIMIT,
) -> tuple[Program, tuple[list[Array], list[Array]]]:
    """The detailed program of one case, of `count` intervals (s), its numbers and its tables."""
    arrays, rest = eqx.partition((loop, start), eqx.is_array)
    leaves, structure = jax.tree.flatten(arrays)
    order = sorted(range(len(leaves)), key=lambda number: leaves[number].size > TABLE)
    places = np.argsort(order).tolist()
    factory = _OneCase(rest, jax.tree.unflatten(structure, places))
    numbers = [x for x in leaves if x.size <= TABLE]
    tables = [x for x in leaves if x.size > TABLE]
    tolerances = Tolerances() if tolerances is None else tolerances
    keys: dict[str, Any] = {"detailed": True, "state_limit": state_limit}
    keys["error_every"] = ERROR_EVERY if isinstance(loop, SampledLoop) else 1
    return Program(factory, interval, count, tolerances, **keys), (numbers, tables)


def _stepper(loop: AbstractLoop, method: Method, interval: float) -> AbstractStepper | str:
    """The method as a stepper of the engines, or the reason why there is none."""
    try:
        require_explicit(method.solver)
    except ValueError as error:
        return str(error)
    if isinstance(loop, SampledLoop):
        return SampledStepper(method.solver)
    steps: Any = method.step_size
    if steps is None:
        length = float(cast(Array, method.first_step))
        return FixedStepper(method.solver, int(np.ceil(interval / length - 1e-9)))
    if not isinstance(steps, AdaptiveSteps) or steps.min_step is None:
        return "the steps must be equal, or adaptive ones of jaxsat with a smallest step"
    try:
        require_dense_output(method.solver)
    except ValueError as error:
        return str(error)
    tolerance = Tolerance(
        steps.rtol, steps.atol, min_step=steps.min_step, max_steps=method.max_steps
    )
    return AdaptiveStepper(method.solver, tolerance)


def sample_numbers(loop: SampledLoop, times: Float[Array, " times"]) -> np.ndarray:
    """Numbers of the loop's samples at these times; raises `ValueError` if a time falls between."""
    period, instants = concrete(loop.controller.period), concrete(times)
    if period is None or instants is None:
        raise ValueError("A sampled loop's period and times must be known before tracing.")
    numbers = np.rint((instants - instants[0]) / period).astype(int)
    if np.abs(numbers * period - (instants - instants[0])).max() > 1e-6 * period:
        raise ValueError(f"Argument `times` must fall on multiples of the period {period} s.")
    return numbers


def _trajectory(times, outputs: Outputs, signals: Signals) -> Trajectory:
    details, ranges = outputs.details, signals.torque_range
    assert details is not None
    assessment = Assessment(
        outputs.settling_time, details.at_rest_from, details.effort, details.constraint_effort
    )
    signals = dataclasses.replace(signals, torque_range=None)
    return Trajectory(
        times,
        signals,
        details.final,
        outputs.code,
        details.steps,
        assessment,
        ranges,
        outputs.integration_error,
    )
