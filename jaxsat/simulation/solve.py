"""`simulate`: one loop, one start, one result."""

from typing import NamedTuple, cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, Int, PyTree

from jaxsat.checks import as_float, concrete
from jaxsat.dynamics import PlantState
from jaxsat.metrics import Since, Tolerances
from jaxsat.simulation.assessment import (
    Look,
    Looker,
    Sight,
    WatchedSolver,
    WatchedState,
    assessment,
    effort_flow,
    still,
)
from jaxsat.simulation.loops import AbstractContinuousLoop, AbstractLoop, SampledLoop, SampledState
from jaxsat.simulation.methods import Method, default_method
from jaxsat.simulation.trajectory import Outcome, Signals, Trajectory

STATE_LIMIT = 1e6
"""A run ends when a state exceeds this: |w| then means upside down, a rate means divergence."""


def simulate(
    loop: AbstractLoop,
    start: PlantState,
    times: ArrayLike | list,
    *,
    method: Method | None = None,
    adjoint: diffrax.AbstractAdjoint | None = None,
    state_limit: float = STATE_LIMIT,
    tolerances: Tolerances | None = None,
) -> Trajectory:
    """Run a closed loop from `start` at `times[0]` and save its signals at `times` (s).

    Without a `method` the loop's default is used. `adjoint` chooses how diffrax differentiates
    (reverse mode with checkpoints unless told otherwise; `diffrax.ForwardMode()` for few gains).
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
    if isinstance(loop, SampledLoop):
        numbers = sample_numbers(loop, times)
        samples = int(numbers[-1])
        return _run_sampled(loop, start, times, numbers, samples, method.solver, limit, tolerances)
    if not isinstance(loop, AbstractContinuousLoop):
        raise TypeError(f"Argument `loop` must be a loop of jaxsat.simulation, got {type(loop)}.")
    adjoint = diffrax.RecursiveCheckpointAdjoint() if adjoint is None else adjoint
    return _run_continuous(loop, start, times, method, adjoint, limit, tolerances)


@eqx.filter_jit
def _run_continuous(loop, start, times, method, adjoint, limit, tolerances) -> Trajectory:
    state = loop.start(start)
    solver = WatchedSolver(method.solver, _continuous_looker(still(loop), tolerances))
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
        stepsize_controller=method.step_size,
        max_steps=method.max_steps,
        adjoint=adjoint,
        event=diffrax.Event(lambda t, y, args, **_: ~all_within(y, limit)),
        throw=False,
    )
    signals, final = cast(tuple[Signals, PyTree], solution.ys)
    code = outcome_code(solution.result)
    watched = cast(WatchedState, solution.solver_state).watched
    since = (solver.since(watched, 0), solver.since(watched, 1))
    success = code == int(Outcome.SUCCESS)
    return Trajectory(
        times,
        jax.tree.map(_blank_unreached, signals),
        jax.tree.map(lambda x: x[0], final),
        code,
        solution.stats["num_steps"],
        assessment(loop.plant, since, watched.integral, times, success),
    )


def _continuous_looker(loop: AbstractContinuousLoop, tolerances: Tolerances) -> Looker:
    def look(t, state) -> Look:
        motion = loop.motion(t, state)
        sight = Sight.of(loop.plant, motion.plant)
        flow = effort_flow(loop.plant, t, motion.plant, motion.torque)
        return Look((sight.excess(tolerances), sight.rest_excess(tolerances)), flow)

    return look


def all_within(state: PyTree, limit: Float[Array, ""]) -> Array:
    """Whether every entry is a number below the limit (NaN fails the comparison)."""
    return jnp.all(jnp.stack([jnp.all(jnp.abs(x) < limit) for x in jax.tree.leaves(state)]))


def _blank_unreached(values: Array) -> Array:
    """diffrax leaves infinity at times that a run never reached; a person expects NaN."""
    return jnp.where(jnp.isinf(values), jnp.nan, values)


def outcome_code(result: diffrax.RESULTS) -> Int[Array, ""]:
    """How a diffrax solve ended, as an `Outcome`."""
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


class _Seen(NamedTuple):
    """What has been seen of a sampled run: settled and at rest since when, ∫|T| (N m s)."""

    settled: Since
    rest: Since
    integral: Float[Array, " m"]

    def looked(self, t, sight: Sight, tolerances: Tolerances) -> "_Seen":
        """With one more look."""
        settled = self.settled.looked(t, sight.excess(tolerances))
        rest = self.rest.looked(t, sight.rest_excess(tolerances))
        return _Seen(settled, rest, self.integral)


@eqx.filter_jit
def _run_sampled(loop, start, times, numbers, samples, solver, limit, tolerances) -> Trajectory:
    """Scan over the samples; a state past the limit is kept and nothing more is computed on it."""

    def one_period(carry, number):
        state, seen, code = carry
        t = times[0] + number * loop.controller.period
        torque, memory, signals = loop.sample(number, t, state)
        plant, seen = _after_period(loop, solver, t, state, torque, seen, tolerances)
        following = SampledState(plant, memory, torque)
        code = jnp.where(
            all_within((following.plant, memory), limit), code, int(Outcome.STATE_LIMIT)
        )
        ended = code != int(Outcome.SUCCESS)
        following = jax.tree.map(lambda new, old: jnp.where(ended, old, new), following, state)
        blank = carry[2] != int(Outcome.SUCCESS)
        signals = jax.tree.map(lambda x: jnp.where(blank, jnp.nan, x), signals)
        return (following, seen, code), signals

    nothing = effort_flow(loop.plant, times[0], start, jnp.zeros_like(start.omega)) * 0
    seen = _Seen(Since.begun(times[0], 3), Since.begun(times[0], 1), nothing)
    seen = seen.looked(times[0], Sight.of(loop.plant, start), tolerances)
    first = (loop.start(start), still(seen), jnp.array(int(Outcome.SUCCESS)))
    (state, seen, code), signals = jax.lax.scan(one_period, first, jnp.arange(samples))
    (_, _, code), last = one_period((state, seen, code), jnp.array(samples))
    signals = jax.tree.map(lambda x, y: jnp.concatenate([x, y[None]])[numbers], signals, last)
    success = code == int(Outcome.SUCCESS)
    found = assessment(loop.plant, (seen.settled, seen.rest), seen.integral, times, success)
    return Trajectory(times, signals, state, code, jnp.array(samples * loop.substeps), found)


def _after_period(loop, solver, t, state, torque, seen, tolerances) -> tuple[PlantState, _Seen]:
    """The plant after one period, its held torques one after the other."""
    plant = state.plant
    for hold in loop.holds(state, torque):
        plant, seen = _after_hold(loop, solver, t + hold.begin, plant, hold, seen, tolerances)
    return PlantState(plant.attitude.normalised(), plant.omega), seen


def _after_hold(loop, solver, t, state, hold, seen, tolerances):
    term = diffrax.ODETerm(loop.plant_rate)
    step = hold.length / loop.substeps
    solver_state = solver.init(term, t, t + step, state, hold.torque)

    def substep(number, carry):
        current, inner, seen = carry
        begin = t + number * step
        after, _, _, inner, _ = solver.step(
            term, begin, begin + step, current, hold.torque, inner, made_jump=False
        )
        plant, torque, before, now, length = still((loop.plant, hold.torque, current, after, step))
        flow = effort_flow(plant, begin, before, torque)
        flow = flow + effort_flow(plant, begin + length, now, torque)
        seen = seen.looked(begin + length, Sight.of(plant, now), tolerances)
        return after, inner, seen._replace(integral=seen.integral + length / 2 * flow)

    carry = (state, solver_state, seen)
    after, _, seen = jax.lax.fori_loop(0, loop.substeps, substep, carry)
    return after, seen
