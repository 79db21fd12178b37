"""`simulate`: one loop, one start, one result. What is run by diffrax imports it there."""

import dataclasses
from collections.abc import Callable
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Int, PyTree

from jaxsat.core.checks import as_float, concrete
from jaxsat.core.ranges import STATE_LIMIT
from jaxsat.core.solvers import AbstractSolver, solver_of
from jaxsat.core.tolerances import SettlingTracker, Tolerances
from jaxsat.core.trees import strong
from jaxsat.simulation.assessment import (
    Monitor,
    MonitoredState,
    MonitorSample,
    Observation,
    assessment,
    effort_rate,
    stop_gradient,
)
from jaxsat.simulation.held_torque import HeldTorque
from jaxsat.simulation.integration_error import IntegrationError
from jaxsat.simulation.loops import AbstractContinuousLoop, AbstractLoop
from jaxsat.simulation.methods import (
    Adjoint,
    Method,
    checkpoints,
    default_method,
    step_size_for,
)
from jaxsat.simulation.recorded_hold import SampledRecord, over_hold
from jaxsat.simulation.sampled_loop import Integrator, SampledLoop, SampledState
from jaxsat.simulation.trajectory import Outcome, Signals, Trajectory
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

    Without a `method` the loop's default is used. `adjoint` chooses how diffrax differentiates
    a continuous loop (reverse mode with checkpoints unless told otherwise; `diffrax.ForwardMode()`
    for few gains); a sampled loop takes both modes and needs none.
    When the run settled, by `tolerances`, is judged on the integrator's own steps and their dense
    output, so it does not depend on what is saved; nothing of that is differentiated. A run that
    fails raises nothing: see `Trajectory.code`. Raises `ValueError` for times that do not increase,
    or, for a sampled loop, that are not sampling instants.
    """
    times = as_float(times)
    known = concrete(times)
    if known is not None and (known.ndim != 1 or len(known) < 2 or not np.all(np.diff(known) > 0)):
        raise ValueError("Argument `times` must be at least two increasing numbers of seconds.")
    method = default_method(loop) if method is None else method
    limit = as_float(state_limit)
    tolerances = Tolerances() if tolerances is None else tolerances
    loop, start = strong((loop, start))
    if isinstance(loop, SampledLoop):
        numbers = sample_numbers(loop, times)
        samples, solver = int(numbers[-1]), _either_mode(solver_of(method.solver))
        with jax.debug_nans(False):  # NaN is what a run did not reach
            return _run_sampled(loop, start, times, numbers, samples, solver, limit, tolerances)
    if not isinstance(loop, AbstractContinuousLoop):
        raise TypeError(f"Argument `loop` must be a loop of jaxsat.simulation, got {type(loop)}.")
    adjoint = checkpoints() if adjoint is None else adjoint
    with jax.debug_nans(False):
        return _run_continuous(loop, start, times, method, adjoint, limit, tolerances)


def _either_mode(solver: AbstractSolver) -> AbstractSolver:
    """The solver with a loop over its stages that both modes of differentiation go through."""
    if getattr(solver, "scan_kind", "none") is not None:
        return solver
    return eqx.tree_at(
        lambda solver: solver.scan_kind, solver, "bounded", is_leaf=lambda x: x is None
    )


@eqx.filter_jit
def _run_continuous(loop, start, times, method, adjoint, limit, tolerances) -> Trajectory:
    import diffrax

    from jaxsat.simulation.monitored_solver import MonitoredSolver

    state = loop.start(start)
    solver = MonitoredSolver(solver_of(method.solver), _monitor(stop_gradient(loop), tolerances))
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(loop),
        solver,
        t0=times[0],
        t1=times[-1],
        dt0=method.first_step,
        y0=state,
        saveat=diffrax.SaveAt(
            subs=[
                diffrax.SubSaveAt(ts=times, fn=lambda t, y, args: loop.signals(t, y)),
                diffrax.SubSaveAt(t1=True),
            ],
            solver_state=True,
        ),
        stepsize_controller=step_size_for(method, loop),
        max_steps=method.max_steps,
        adjoint=adjoint,
        event=diffrax.Event(lambda t, y, args, **_: ~within_limit(y, limit)),
        throw=False,
    )
    signals, final = cast(tuple[Signals, PyTree], solution.ys)
    code = outcome_code(solution.result)
    record = cast(MonitoredState, solution.solver_state).record
    since = (solver.since(record, 0), solver.since(record, 1))
    success = code == int(Outcome.SUCCESS)
    return Trajectory(
        times,
        jax.tree.map(_blank_unreached, signals),
        jax.tree.map(lambda x: x[0], final),
        code,
        solution.stats["num_steps"],
        assessment(loop.plant, since, record.integral, times, success, tolerances.dwell),
    )


def _monitor(loop: AbstractContinuousLoop, tolerances: Tolerances) -> Monitor:
    def monitor(t, state) -> MonitorSample:
        motion = loop.motion(t, state)
        observed = Observation.of(loop.plant, motion.plant)
        rate = effort_rate(loop.plant, t, motion.plant, motion.torque)
        return MonitorSample((observed.excess(tolerances), observed.rest_excess(tolerances)), rate)

    return monitor


def within_limit(state: PyTree, limit: Float[Array, ""], *finite: PyTree) -> Array:
    """Whether the Euclidean norm of all floating-point entries is a number below the limit.

    Momenta of wheels, and what is to be `finite`, only have to be: they are as large as the body.
    """
    motion = jax.tree.map(_without_momentum, state, is_leaf=_is_plant)
    squares = [jnp.sum(x**2) for x in _floats(motion)]
    squares += [jnp.sum(0 * x) for x in _floats((state, finite))]
    return sum(squares) < limit**2  # which fails for NaN, too


def _is_plant(state: PyTree) -> bool:
    return isinstance(state, PlantState)


def _without_momentum(state: PyTree) -> PyTree:
    return dataclasses.replace(state, effectors=None) if _is_plant(state) else state


def _floats(tree: PyTree) -> list[Array]:
    return [x for x in jax.tree.leaves(tree) if jnp.issubdtype(x.dtype, jnp.floating)]


def _blank_unreached(values: Array) -> Array:
    """diffrax leaves infinity at times that a run never reached; a person expects NaN."""
    return jnp.where(jnp.isinf(values), jnp.nan, values)


def outcome_code(result: Any) -> Int[Array, ""]:
    """How a diffrax solve ended, one of its `RESULTS`, as an `Outcome`."""
    import diffrax

    known = {
        Outcome.STATE_LIMIT: diffrax.RESULTS.event_occurred,
        Outcome.MAX_STEPS: diffrax.RESULTS.max_steps_reached,
        Outcome.SUCCESS: diffrax.RESULTS.successful,
    }
    code = jnp.array(int(Outcome.STEP_UNDERFLOW))
    for outcome, meaning in known.items():
        code = jnp.where(result == meaning, int(outcome), code)
    return code


def sample_numbers(loop: SampledLoop, times: Float[Array, " times"]) -> np.ndarray:
    """Which samples of the loop the times are; raises `ValueError` where one falls between."""
    period, known = concrete(loop.controller.period), concrete(times)
    if period is None or known is None:
        raise ValueError("A sampled loop's period and times must be known before tracing.")
    numbers = np.rint((known - known[0]) / period).astype(int)
    if np.abs(numbers * period - (known - known[0])).max() > 1e-6 * period:
        raise ValueError(f"Argument `times` must fall on multiples of the period {period} s.")
    return numbers


def run_samples(
    loop: SampledLoop,
    start: PlantState,
    samples: int,
    integrate: Integrator,
    carry: PyTree,
    limit: Float[Array, ""],
    begin: float | Float[Array, ""] = 0.0,
    split: Callable[[PyTree], tuple[PyTree, PyTree]] = lambda carry: (carry, None),
) -> tuple[SampledState, PyTree, Int[Array, ""], Signals, PyTree]:
    """A whole run of so many periods: state and carry at its end, code, signals at all samples.

    A state past the `limit` is not taken over: from there on the last one is kept, and the signals
    are NaN. `integrate` and `carry` are those of `SampledLoop.period`. At the end of every period
    `split` gives the carry of the next one and what is to be kept of this one, which stands last,
    NaN after the end of the run.
    """

    def period(running, number):
        state, carry, code = running
        length = loop.controller.period
        t = begin + number.astype(length.dtype) * length
        following, carried, signals = loop.period(number, t, state, integrate, carry)
        kept_finite = loop.controller.judged(following.memory)
        good = within_limit(following.plant, limit, kept_finite)
        carried, of_period = split(carried)
        seen = (signals, of_period)
        seen = jax.tree.map(lambda x: jnp.where(code == 0, x, jnp.nan), seen)
        code = jnp.where(good, code, int(Outcome.STATE_LIMIT))
        new, old = (following, carried), (state, carry)
        kept = jax.tree.map(lambda x, y: jnp.where(code == 0, x, y), new, old)
        return (*kept, code), seen

    first = (loop.start(start), carry, jnp.array(int(Outcome.SUCCESS)))
    (state, carry, code), (signals, seen) = jax.lax.scan(period, first, jnp.arange(samples))
    last = loop.signals(jnp.array(samples), begin + samples * loop.controller.period, state)
    last = jax.tree.map(lambda x: jnp.where(code == 0, x, jnp.nan), last)
    signals = jax.tree.map(lambda x, y: jnp.concatenate([x, y[None]]), signals, last)
    return state, carry, code, signals, seen


@eqx.filter_jit
def _run_sampled(loop, start, times, numbers, samples, solver, limit, tolerances) -> Trajectory:
    def integrate(t, hold, state, record):
        return over_hold(loop, solver, t, state, hold, record, tolerances)

    nothing = effort_rate(loop.plant, times[0], start, jnp.zeros_like(start.omega)) * 0
    record = SampledRecord(
        SettlingTracker.initial(times[0], 3),
        SettlingTracker.initial(times[0], 1),
        nothing,
        HeldTorque.none(start.omega),
        IntegrationError.none(start.omega),
    )
    record = record.at(times[0], Observation.of(loop.plant, start), tolerances)

    def split(record):
        return record._replace(held=HeldTorque.none(record.held.integral)), record.held

    state, record, code, signals, held = run_samples(
        loop, start, samples, integrate, stop_gradient(record), limit, times[0], split
    )
    success = code == int(Outcome.SUCCESS)
    since = (record.settled, record.rest)
    found = assessment(loop.plant, since, record.integral, times, success, tolerances.dwell)
    signals = _saved(signals, numbers)
    steps = jnp.array(samples * loop.substeps)
    torque_range = held.between(numbers, stop_gradient(signals.torque[-1]))
    return Trajectory(times, signals, state, code, steps, found, torque_range, record.error)


def _saved(signals: Signals, numbers: Int[Array, " times"]) -> Signals:
    """Signals at these samples; of thrust levels, the mean from each to the next."""
    saved = jax.tree.map(lambda x: x[numbers], signals)
    if signals.thrust_level is None:
        return saved
    level = signals.thrust_level
    sums = jnp.concatenate([jnp.zeros_like(level[:1]), jnp.cumsum(level, axis=0)])
    ends = jnp.append(numbers[1:], numbers[-1] + 1)
    means = (sums[ends] - sums[numbers]) / (ends - numbers)[:, None]
    return dataclasses.replace(saved, thrust_level=means)
