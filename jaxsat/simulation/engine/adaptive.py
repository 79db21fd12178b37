"""Adaptive steps through a loop in smooth pieces, each trajectory at its own pace.

During a step the loop is fixed to one of its smooth pieces (`loop.smooth_piece`). Where an event
function has changed its sign at the end of one of a step's equal parts, the event is located on the
step's dense output, the step ends there, and the next one is taken in the other piece. Nothing else
ends a step: observed instants lie on the dense output, and the state at the end of the run, or
where a replay stops, is that of a shorter step from the begin of the last one. Settling is judged
on the dense output of a completed step, whatever instants are observed.

Forward-mode derivatives include the law's corners. The step length until an event carries one
differentiable step of Newton's method, so the instant moves correctly with the parameters, and so
does all that follows; the sequence of steps is held fixed.
"""

from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar
from jaxsat.core.checks import positive, require_counts
from jaxsat.core.solvers import NamedSolver, Solver, class_name
from jaxsat.simulation.assessment import stop_gradient
from jaxsat.simulation.engine.dense_output import require_dense_output
from jaxsat.simulation.engine.details import details_of, with_details
from jaxsat.simulation.engine.flat_ode import DenseStep, FlatODE, initial_state
from jaxsat.simulation.engine.instants import (
    StepEnd,
    excess_at,
    rest_excess_at,
    settled_along_step,
    until_event,
)
from jaxsat.simulation.engine.monitors import margins_of, monitored, with_monitors
from jaxsat.simulation.engine.program import Case, Program
from jaxsat.simulation.engine.progress import (
    Integrals,
    Outputs,
    Progress,
    initial_progress,
    outputs_of,
    with_peaks,
)
from jaxsat.simulation.engine.rates import within_limit
from jaxsat.simulation.engine.root_finding import sign_changes
from jaxsat.simulation.engine.runge_kutta import require_explicit, stage_rates, tableau_of, weighted
from jaxsat.simulation.engine.stepper import AbstractStepper
from jaxsat.simulation.trajectory import Outcome, Signals

SAFETY, MIN_FACTOR, MAX_FACTOR = 0.9, 0.2, 5.0


class Tolerance(eqx.Module):
    """Tolerances of adaptive steps: the error of a step must be below atol + rtol |state|.

    `atol` is in the unit of each state, for momenta of wheels `Spacecraft.momentum_unit`. The norm
    is the root mean square over the loop's state and the cost, without the effort. The first step
    is `first_step` (s); steps are never below `min_step` (s), which passes points where a law has
    no derivative and surfaces on which it slides. A case has at most `max_steps` steps.
    """

    rtol: RealScalar = eqx.field(converter=positive("rtol"), default=1e-9)
    atol: RealScalar = eqx.field(converter=positive("atol"), default=1e-9)
    first_step: RealScalar = eqx.field(converter=positive("first_step"), default=1e-2)
    min_step: RealScalar = eqx.field(converter=positive("min_step"), default=1e-9)
    max_steps: int = eqx.field(static=True, default=2**17)

    def __check_init__(self):
        require_counts(max_steps=self.max_steps)


class AdaptiveState(NamedTuple):
    """State of a trajectory: time (s), number of the next instant to observe, flat state with its
    rate, event functions with their signs (true where positive), excess over the tolerances, and
    last step."""

    t: RealScalar
    number: IntScalar
    state: Float[Array, " n"]
    rate: Float[Array, " n"]
    signs: Bool[Array, " m"]
    events: Float[Array, " m"]
    excess: Float[Array, " conditions"]
    last_step: DenseStep


class AdaptiveStepper(AbstractStepper):
    """Steps of adaptive length within the `tolerance`, for continuous loops.

    `advance` repeats `attempt` while `unfinished`.
    """

    solver: Solver = NamedSolver("tsit5")
    tolerance: Tolerance = eqx.field(default_factory=Tolerance)

    def __check_init__(self):
        require_explicit(self.solver)
        require_dense_output(self.solver)

    def identity(self) -> dict[str, Any]:
        """Solver and tolerance, as plain data."""
        numbers = [float(x) for x in jax.tree.leaves(self.tolerance)]
        tolerance = [*numbers, self.tolerance.max_steps]
        return {"solver": class_name(self.solver), "tolerance": tolerance}

    def begin(self, program: Program, case: Case) -> Progress:
        """The progress at time zero."""
        ode, flat = FlatODE.of(self.solver, program, case), initial_state(program, case)
        zero = jnp.zeros((), flat.dtype)
        events = ode.loop.event_functions(zero, ode.state(zero, flat))
        nowhere = jnp.zeros((ode.output.sign_checks, ode.torque_count), flat.dtype)
        increments = jnp.zeros((ode.output.rows, flat.size), flat.dtype)
        effort = jnp.zeros(ode.torque_count, flat.dtype) if program.detailed else zero
        last_step = DenseStep(zero, zero + 1.0, flat, increments, nowhere, effort, events > 0)
        rate = ode.rate(events > 0)(zero, flat)
        excess = excess_at(ode, zero, flat)
        state = AdaptiveState(zero, jnp.array(0), flat, rate, events > 0, events, excess, last_step)
        first_step = self.tolerance.first_step
        plant = ode.loop.plant_state(zero, ode.state(zero, flat))
        progress = initial_progress(state, case.loop.plant, plant, case.possible, first_step)
        progress = with_monitors(program, ode.loop, progress)
        if not program.detailed:
            return progress
        progress = with_details(progress, ode.loop, ode.loop.torque_count)
        return progress._replace(forced=jnp.array(0))

    def unfinished(self, program: Program, progress: Progress, bound: IntScalar) -> BoolScalar:
        """Whether instant `bound` is still ahead, or an earlier one not yet observed."""
        state: AdaptiveState = progress.state
        ahead = (state.t < program.time_of(bound)) | (state.number < bound)
        return ahead & (progress.code == int(Outcome.SUCCESS))

    def attempt(
        self,
        program: Program,
        case: Case,
        progress: Progress,
        bound: IntScalar,
        axis_name: str | None = None,
    ) -> Progress:
        """Try one step, and observe all instants before number `bound` that it has passed."""
        ode, state = FlatODE.of(self.solver, program, case, axis_name), progress.state
        up_to_date = state.t < program.time_of(state.number)
        active = up_to_date & (state.t < program.time_of(bound))
        active &= progress.code == int(Outcome.SUCCESS)
        return _observe_passed(ode, bound, _attempt_step(self, ode, active, progress))

    def advance(self, program, case, progress, first, count, axis_name=None):
        """The progress up to instant number `first + count`, while any of a batch is unfinished.

        An attempt does not change a trajectory that has ended.
        """
        bound = jnp.asarray(first + count)
        ode = FlatODE.of(self.solver, program, case, axis_name)
        return jax.lax.while_loop(
            lambda progress: ode.in_any_case(self.unfinished(program, progress, bound)),
            lambda progress: self.attempt(program, case, progress, bound, axis_name),
            progress,
        )

    def finish(
        self, program: Program, case: Case, progress: Progress, number: IntScalar
    ) -> Outputs:
        """Outputs at instant `number`, within the last step.

        State and cost there come from a separate step from the begin of the last one, as the dense
        output is of lower order.
        """
        ode, last_step = FlatODE.of(self.solver, program, case), progress.state.last_step
        t = program.time_of(number)
        end = last_step.fraction(t)
        flat = self._end_of_shorter_step(ode, last_step, t)
        plant = ode.loop.plant_state(t, ode.state(t, flat))
        progress = with_peaks(progress, plant.omega, ode.loop.plant.stored(plant))
        excess = excess_at(ode, t, ode.interpolated(last_step, end))
        always = jnp.array(True)
        tracker = settled_along_step(ode, last_step, end, progress.settled, excess, always)
        rest = _rest_along_step(ode, last_step, end, progress.rest, t, always)
        success = progress.code == int(Outcome.SUCCESS)
        cost = ode.restore(jnp.where(success, flat, progress.state.state))[1]
        progress = progress._replace(
            integrals=Integrals(cost, ode.effort(last_step, end)),
            settled=tracker,
            rest=rest,
            ended_at=jnp.where(success, t, progress.ended_at),
        )
        final, dwell = ode.state(t, flat), program.tolerances.dwell
        details = details_of(progress, ode.loop, final, t, progress.steps, dwell)
        progress = monitored(program, ode.loop, progress, t, final, success)
        outputs = outputs_of(
            progress, plant, t, case.drawn, program.running_cost, details=details, dwell=dwell
        )
        return outputs._replace(requirements=margins_of(program, ode.loop, progress))

    def _end_of_shorter_step(
        self, ode: FlatODE, last_step: DenseStep, t: RealScalar
    ) -> Float[Array, " n"]:
        """The flat state after a step from the begin of `last_step` to the time `t` (s)."""
        tableau, rate = tableau_of(self.solver), ode.rate(last_step.signs)
        begin, flat, step = last_step.begin, last_step.state, t - last_step.begin
        rates = stage_rates(tableau, rate, begin, step, flat, rate(begin, flat))
        return flat + step * weighted(tableau.b_sol, rates)

    def signals(
        self, program: Program, case: Case, progress: Progress, number: IntScalar
    ) -> Signals:
        """Signals at instant `number`, which the last step must have reached or passed.

        The state equals that of `finish`.
        """
        ode = FlatODE.of(self.solver, program, case)
        t = program.time_of(number)
        flat = self._end_of_shorter_step(ode, progress.state.last_step, t)
        return ode.loop.signals(t, ode.state(t, flat))


def _attempt_step(stepper: AdaptiveStepper, ode: FlatODE, active, progress: Progress) -> Progress:
    """Progress after one step, accepted or not; unchanged where the trajectory is not `active`."""
    solver, tolerance = stepper.solver, stepper.tolerance
    tableau, state, step = tableau_of(solver), progress.state, progress.step
    begin = ode.at_step_begin(state.state)
    rates = stage_rates(tableau, ode.rate(state.signs), state.t, step, begin, state.rate)
    increment = step * weighted(tableau.b_sol, rates)
    after = begin + increment
    error = step * weighted(tableau.b_error, rates)
    norm = stop_gradient(_error_norm(tolerance, *map(ode.error_controlled, (begin, after, error))))
    accepted = active & ((norm <= 1) | (step <= tolerance.min_step))
    increments = ode.increments(step, rates, increment)
    zeros = jnp.zeros((ode.output.sign_checks, ode.torque_count), increments.dtype)
    effort = progress.integrals.effort
    dense = DenseStep(state.t, step, begin, increments, zeros, effort, state.signs)
    end = StepEnd(step, after, rates[-1], state.signs, state.events)
    end = until_event(ode, state.signs, state.events, dense, end, accepted, tolerance.min_step)
    fraction = end.length / step if state.signs.size else jnp.ones_like(step)
    coefficients = ode.torque_coefficients(increments)
    zeros = sign_changes(coefficients, ode.output.sign_checks, fraction, accepted, ode.cold_branch)
    dense = dense._replace(torque_zeros=stop_gradient(zeros))
    t = state.t + end.length
    excess = excess_at(ode, t, end.state)
    next_state = AdaptiveState(
        t, state.number, end.state, end.rate, end.signs, end.events, excess, dense
    )
    last_step = state.last_step
    until = last_step.fraction(state.t)
    candidate = progress._replace(
        state=next_state,
        integrals=progress.integrals._replace(effort=ode.effort(dense, fraction)),
        settled=settled_along_step(ode, last_step, until, progress.settled, state.excess, accepted),
        rest=_rest_along_step(ode, last_step, until, progress.rest, state.t, accepted),
        ended_at=t,
    )
    following = _accept_step(tolerance, ode, progress, candidate, active, accepted, norm)
    # no growth after an event: a sliding law would diverge
    largest = jnp.where(fraction < 1, 1.0, MAX_FACTOR)
    factor = jnp.minimum(_step_factor(norm, tableau.order), largest)
    proposal = jnp.maximum(step * stop_gradient(factor), tolerance.min_step)
    return following._replace(step=jnp.where(active, proposal, step))


def _rest_along_step(ode: FlatODE, step: DenseStep, until, rest, t, active):
    """Settling of the inertial rate, see `settled_along_step`; `t` (s) is at `until`."""
    if rest is None:
        return None
    at_end = rest_excess_at(ode, t, ode.interpolated(step, until))
    return settled_along_step(ode, step, until, rest, at_end, active, rest_excess_at)


def _accept_step(tolerance, ode, before: Progress, candidate: Progress, active, accepted, norm):
    """The `candidate` where its step is accepted and its state is within the limit, else `before`.

    A trajectory ends where the state passes the limit, or after its largest number of steps.
    """
    limit = ode.program.state_limit
    good = within_limit(ode.restore(candidate.state.state)[0], limit)
    steps = before.steps + active.astype(before.steps.dtype)
    code = jnp.where(accepted & ~good, int(Outcome.STATE_LIMIT), before.code)
    out = active & (code == int(Outcome.SUCCESS)) & (steps >= tolerance.max_steps)
    code = jnp.where(out, int(Outcome.MAX_STEPS), code)
    progress = jax.tree.map(
        lambda new, old: jnp.where(accepted & good, new, old), candidate, before
    )
    if before.forced is not None:
        forced = (accepted & (norm > 1)).astype(before.forced.dtype)
        progress = progress._replace(forced=before.forced + forced)
    return progress._replace(code=code, steps=steps)


def _observe_passed(ode: FlatODE, bound, progress: Progress) -> Progress:
    """The progress after observing all instants before number `bound` that the last step passed."""
    program = ode.program

    def pending(progress: Progress):
        state: AdaptiveState = progress.state
        due = (state.number < bound) & (program.time_of(state.number) <= state.t)
        return due & (progress.code == int(Outcome.SUCCESS))

    def observe(progress: Progress) -> Progress:
        state: AdaptiveState = progress.state
        t = program.time_of(state.number)
        flat = ode.interpolated(state.last_step, state.last_step.fraction(t))
        plant = ode.loop.plant_state(t, ode.state(t, flat))
        progress = with_peaks(progress, plant.omega, ode.loop.plant.stored(plant))
        progress = monitored(program, ode.loop, progress, t, ode.state(t, flat))
        return progress._replace(state=state._replace(number=state.number + 1))

    return jax.lax.while_loop(pending, observe, progress)


def _error_norm(tolerance, before, after, error) -> RealScalar:
    """The error relative to the tolerance; NaN, which is never accepted, where the error is NaN."""
    scale = tolerance.atol + tolerance.rtol * jnp.maximum(jnp.abs(before), jnp.abs(after))
    return jnp.sqrt(jnp.mean((error / scale) ** 2))


def _step_factor(norm: RealScalar, order: int | None) -> RealScalar:
    """Growth factor of the next step; the smallest where the error is NaN."""
    assert order is not None
    factor = SAFETY * jnp.exp(-(1 / order) * jnp.log(jnp.maximum(norm, 1e-12)))
    factor = jnp.where(jnp.isfinite(norm), factor, MIN_FACTOR)
    return jnp.clip(factor, MIN_FACTOR, MAX_FACTOR)
