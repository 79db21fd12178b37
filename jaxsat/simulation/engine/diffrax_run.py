"""One case by diffrax: any solver, adaptive steps, every loop, both modes of differentiation.

diffrax is imported on use.
"""

import dataclasses
from functools import partial
from typing import Any, NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.core.array_types import IntScalar
from jaxsat.core.solvers import AbstractSolver, solver_of
from jaxsat.core.tolerances import SettlingTracker
from jaxsat.simulation.assessment import JudgedSignals, stop_gradient
from jaxsat.simulation.engine.details import details_of, effort_rates, with_details
from jaxsat.simulation.engine.fixed import final_outputs, progress_at_zero, through_period
from jaxsat.simulation.engine.monitors import margins_of_history
from jaxsat.simulation.engine.program import Case, Program
from jaxsat.simulation.engine.progress import (
    Integrals,
    Outputs,
    Progress,
    initial_progress,
    outputs_of,
    peaks_of,
)
from jaxsat.simulation.engine.rates import (
    HoldSteps,
    continuous_loop,
    judge_of,
    plant_state,
    running_cost,
    within_limit,
)
from jaxsat.simulation.engine.stepper import nan_where
from jaxsat.simulation.held_torque import HeldTorque
from jaxsat.simulation.loops import AbstractContinuousLoop, Motion
from jaxsat.simulation.methods import Adjoint, Method, step_size_for
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.simulation.trajectory import Outcome, Signals


class Integrated(NamedTuple):
    """Outputs and signals of a case, and the torque of every period of a sampled loop."""

    outputs: Outputs
    signals: Signals
    held_torque: HeldTorque | None


def integrated(
    program: Program, case: Case, times: Float[Array, " times"], method: Method, adjoint: Adjoint
) -> Integrated:
    """One case by diffrax, from the first to the last of the `times` (s).

    For a sampled loop, `times` are all its samples. Times that were not reached have NaN.
    """
    if isinstance(case.loop, SampledLoop):
        return _run_sampled(program, case, times, _either_mode(solver_of(method.solver)))
    return _run_continuous(program, case, times, method, adjoint)


def _run_continuous(program: Program, case: Case, times, method: Method, adjoint) -> Integrated:
    import diffrax

    from jaxsat.simulation.diffrax_parts import MonitoredSolver, MonitoredState

    loop, cost, zero = continuous_loop(case), program.running_cost, jnp.zeros((), times.dtype)

    def rate(t, both, args):
        motion = _motion(loop, t, both[0])
        if cost is None:
            return motion.rate, None
        return motion.rate, running_cost(cost, motion.plant, motion.relative_rate, motion.torque)

    solver = MonitoredSolver(solver_of(method.solver), _monitor(*stop_gradient((program, loop))))
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(rate),
        solver,
        t0=times[0],
        t1=times[-1],
        dt0=method.first_step,
        y0=(loop.start(case.start), None if cost is None else zero),
        saveat=diffrax.SaveAt(
            subs=[
                diffrax.SubSaveAt(ts=times, fn=lambda t, both, args: loop.signals(t, both[0])),
                diffrax.SubSaveAt(t1=True),
            ],
            solver_state=True,
        ),
        stepsize_controller=step_size_for(method, loop),
        max_steps=method.max_steps,
        adjoint=adjoint,
        event=diffrax.Event(lambda t, y, args, **_: ~within_limit(y[0], program.state_limit)),
        throw=False,
    )
    signals, final = cast(tuple[Signals, PyTree], solution.ys)
    signals = jax.tree.map(lambda x: jnp.where(jnp.isinf(x), jnp.nan, x), signals)
    state, whole = jax.tree.map(lambda x: x[0], final)
    record = cast(MonitoredState, solution.solver_state).record
    tracker, *rest = (solver.since(record, group) for group in range(len(record.since)))
    progress = _initial(program, case)._replace(
        state=state,
        integrals=Integrals(zero if cost is None else whole, record.integral),
        settled=tracker,
        rest=rest[0] if rest else None,
        code=_outcome_code(solution.result),
        steps=solution.stats["num_steps"],
    )
    return Integrated(_outputs(program, case, progress, times, signals), signals, None)


@eqx.filter_jit
def _motion(loop: AbstractContinuousLoop, t, state: PyTree) -> Motion:
    """The motion of a loop, traced once for all its uses in a program."""
    return loop.motion(t, state)


def _monitor(program: Program, loop):
    """The monitor of settling and effort, and in a detailed program of rest."""
    from jaxsat.simulation.diffrax_parts import MonitorSample

    def monitor(t, both) -> MonitorSample:
        motion = _motion(loop, t, both[0])
        observation = JudgedSignals.of(loop.plant, motion.plant)
        excess = (observation.excess(program.tolerances),)
        if program.detailed:
            excess = (*excess, observation.rest_excess(program.tolerances))
        arguments = (loop.plant, t, motion.plant, motion.torque, jnp.abs(motion.torque))
        return MonitorSample(excess, effort_rates(program.detailed, *arguments))

    return monitor


def _outcome_code(result: Any) -> IntScalar:
    """The `Outcome` of a diffrax solve, given as one of its `RESULTS`."""
    import diffrax

    meanings = {
        Outcome.STATE_LIMIT: diffrax.RESULTS.event_occurred,
        Outcome.MAX_STEPS: diffrax.RESULTS.max_steps_reached,
        Outcome.SUCCESS: diffrax.RESULTS.successful,
    }
    code = jnp.array(int(Outcome.STEP_UNDERFLOW))
    for outcome, meaning in meanings.items():
        code = jnp.where(result == meaning, int(outcome), code)
    return code


def _either_mode(solver: AbstractSolver) -> AbstractSolver:
    """The solver with a loop over its stages that supports both modes of differentiation."""
    if getattr(solver, "scan_kind", "none") is not None:
        return solver
    return eqx.tree_at(
        lambda solver: solver.scan_kind, solver, "bounded", is_leaf=lambda x: x is None
    )


def _run_sampled(program: Program, case: Case, times, solver: AbstractSolver) -> Integrated:
    """Run all periods. A state past the limit is discarded: the last good one stays."""
    loop, begin, end = cast(SampledLoop, case.loop), times[0], times[-1]
    plain = dataclasses.replace(program, requirements=None)  # judged by the whole history below
    steps = partial(_equal_steps, solver, judge=judge_of(program, loop))

    def alone(rate, begin, length, count: int, state):
        carry, nobody = (state, None), lambda none, *_: none
        return _equal_steps(solver, rate, begin, length, count, carry, judge=nobody)[0]

    integrate = HoldSteps(program, loop, steps, alone)
    none, count = HeldTorque.none(case.start.omega), times.size - 1

    def period(progress: Progress, sample):
        (number, t), ended = sample, progress.code != int(Outcome.SUCCESS)
        now = progress._replace(held_torque=none)
        after, *observation = through_period(plain, loop, integrate, number, t, now)
        return after, nan_where(ended, tuple(observation))

    first = progress_at_zero(plain, case)
    tracker, rest = SettlingTracker.initial(begin, 3), None
    if program.detailed:
        rest = SettlingTracker.initial(begin, 1)
    first = first._replace(settled=tracker, rest=rest, held_torque=none, ended_at=begin)
    samples = (jnp.arange(count), times[:-1])
    progress, (signals, holds) = jax.lax.scan(period, first, samples)
    last = loop.signals(jnp.array(count), end, progress.state)
    last = nan_where(progress.code != int(Outcome.SUCCESS), last)
    signals = jax.tree.map(lambda x, y: jnp.concatenate([x, y[None]]), signals, last)
    outputs = final_outputs(plain, case, progress, end, jnp.array(count * loop.substeps), begin)
    margins = margins_of_history(program.requirements, loop, times, signals)
    return Integrated(outputs._replace(requirements=margins), signals, holds)


def _equal_steps(solver, rate, begin, length, count: int, carry, *, judge):
    """The state after equal steps of diffrax, and trackers, judged at the begin of each."""
    import diffrax

    term, step = diffrax.ODETerm(lambda t, state, args: rate(t, state)), length / count

    def one(number, carry):
        before, inner, since = carry
        t = begin + number * step
        after, _, _, inner, _ = solver.step(term, t, t + step, before, None, inner, made_jump=False)
        return after, inner, judge(since, t, before)

    state, since = carry
    first = (state, solver.init(term, begin, begin + step, state, None), since)
    after, _, since = jax.lax.fori_loop(0, count, one, first)
    return after, since


def _initial(program: Program, case: Case) -> Progress:
    state = case.loop.start(case.start)
    progress = initial_progress(
        state, case.loop.plant, plant_state(case.loop, 0.0, state), case.possible
    )
    return with_details(progress, case.loop, 3) if program.detailed else progress


def _outputs(program: Program, case: Case, progress: Progress, times, signals) -> Outputs:
    """Outputs of a run with these signals at all `times`."""
    end = times[-1]
    plant = plant_state(case.loop, end, progress.state)
    squares = jnp.sum(signals.omega**2, axis=1)
    last_index = jnp.maximum(jnp.sum(jnp.isfinite(squares)) - 1, 0)  # the start may be NaN, too
    progress = progress._replace(
        peak_square=jnp.max(squares),
        ended_at=jnp.where(case.possible, times[last_index], times[0]),
        code=jnp.where(case.possible, progress.code, int(Outcome.IMPOSSIBLE_CASE)),
        peaks={name: jnp.max(peaks_of(signals.parts)[name], axis=0) for name in progress.peaks},
    )
    begin, dwell = times[0], program.tolerances.dwell
    details = details_of(progress, case.loop, progress.state, end, progress.steps, dwell, begin)
    outputs = outputs_of(
        progress,
        plant,
        end,
        case.drawn,
        program.running_cost,
        details=details,
        dwell=dwell,
        begin=begin,
    )
    margins = margins_of_history(program.requirements, case.loop, times, signals)
    return outputs._replace(requirements=margins)
