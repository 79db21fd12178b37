"""Fixed steps, interval by interval: through a continuous loop, and between samples."""

import dataclasses
from collections.abc import Callable
from functools import partial

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar
from jaxsat.core.checks import require_counts
from jaxsat.core.solvers import NamedSolver, Solver, class_name
from jaxsat.core.trees import halved, restored
from jaxsat.simulation.assessment import IntegrationError, JudgedSignals, stop_gradient
from jaxsat.simulation.engine.details import details_of, with_details
from jaxsat.simulation.engine.failure_record import initial_record
from jaxsat.simulation.engine.monitors import margins_of, monitored, with_monitors
from jaxsat.simulation.engine.program import Case, Program
from jaxsat.simulation.engine.progress import (
    Outputs,
    Progress,
    initial_progress,
    judged_at,
    outputs_of,
    with_peaks,
)
from jaxsat.simulation.engine.rates import (
    HoldSteps,
    augmented_rate,
    consumption,
    continuous_loop,
    judge_of,
    plant_state,
    within_limit,
)
from jaxsat.simulation.engine.runge_kutta import (
    HalvedSteps,
    Span,
    explicit_step,
    require_explicit,
    tableau_of,
)
from jaxsat.simulation.engine.stepper import AbstractStepper, nan_where
from jaxsat.simulation.held_torque import HeldTorque, Unmade, averaged, summed
from jaxsat.simulation.loops import AbstractLoop
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.simulation.trajectory import Outcome, Signals
from jaxsat.spacecraft.sensors import Sensors

NOISE_BLOCK = 16
"""Number of samples whose noise is drawn together. More gain little; a replay stops at every sample
and uses only one draw of each block."""


class FixedStepper(AbstractStepper):
    """`substeps` equal steps of a continuous loop in each interval of the program."""

    solver: Solver = NamedSolver("tsit5")
    substeps: int = eqx.field(static=True, default=20)

    def __check_init__(self):
        require_explicit(self.solver)
        require_counts(substeps=self.substeps)

    def identity(self):
        """The solver and its substeps, as plain data."""
        return {"solver": class_name(self.solver), "substeps": self.substeps}

    def begin(self, program, case):
        """The progress at time zero."""
        return progress_at_zero(program, case)

    def advance(self, program, case, progress, first, count, axis_name=None):
        """The progress after `count` intervals."""
        loop = continuous_loop(case)
        rate, judge = augmented_rate(program, loop), judge_of(program, loop)
        tableau, plant_at = tableau_of(self.solver), stop_gradient(loop).plant_state
        estimate = HalvedSteps(
            program, partial(_steps_alone, tableau), self.substeps, loop.plant, plant_at
        )

        def interval(i, progress):
            t = program.time_of(first + i)
            signals = loop.signals(t, progress.state)
            candidate = with_peaks(progress, signals.omega, signals.parts)
            candidate = monitored(program, loop, candidate, t, progress.state)
            both, since = (progress.state, progress.integrals), (progress.settled, progress.rest)
            (state, integrals), since = _equal_steps(
                tableau, rate, t, program.interval, self.substeps, (both, since), judge
            )
            span = Span(t, program.interval, progress.state, state)
            error = estimate.after(progress.error, first + i, stop_gradient(loop), span)
            carry = (integrals, since, None, error)
            return _unless_ended(program, progress, candidate, state, (state,), carry, t)

        return jax.lax.fori_loop(0, count, interval, progress)

    def finish(self, program, case, progress, number):
        """Outputs at the end."""
        end, steps = program.time_of(number), number * self.substeps
        return final_outputs(program, case, progress, end, steps)

    def signals(self, program, case, progress, number):
        """The loop's signals at instant `number`."""
        return continuous_loop(case).signals(program.time_of(number), progress.state)


class SampledStepper(AbstractStepper):
    """The sampled loop's own substeps in each of its periods."""

    solver: Solver = NamedSolver("tsit5")

    def __check_init__(self):
        require_explicit(self.solver)

    def identity(self):
        """The solver, as plain data."""
        return {"solver": class_name(self.solver)}

    def begin(self, program, case):
        """The progress at time zero."""
        progress, loop = progress_at_zero(program, case), _sampled_loop(case)
        progress = progress._replace(held_torque=HeldTorque.none(progress.state.plant.omega))
        if not program.detailed:
            return progress
        samples = jax.eval_shape(
            lambda: loop.idle_signals(jnp.array(0), program.time_of(0), progress.state)
        )
        return progress._replace(sums=jax.tree.map(lambda x: jnp.zeros(x.shape, x.dtype), samples))

    def advance(self, program, case, progress, first, count, axis_name=None):
        """The progress after `count` periods, with the torque range of these periods alone.

        A detailed program keeps the signals at the begin of the first one, and the means of those
        that are declared as a `mean`, so that a sample is compiled once and not again for
        `signals`. For them, with a `count` of zero one period runs without further effect.

        In a batch the noise of sensors is drawn for `NOISE_BLOCK` samples at a time, which is
        faster than sample by sample. The numbers are the same.
        """
        loop, sampled = _sampled_loop(case), (first, first + count)
        sensors = loop.sensors
        if program.detailed:
            count = jnp.maximum(count, 1)
        progress = progress._replace(held_torque=HeldTorque.none(progress.state.plant.omega))
        if axis_name is None or not isinstance(sensors, Sensors):
            after = self._periods(program, loop, progress, first, count, sampled)
            return after._replace(sums=averaged(after.sums, count))

        def block(number, progress):
            begin = first + number * NOISE_BLOCK
            block_sensors = sensors.drawn(begin, NOISE_BLOCK, progress.state.plant.omega.dtype)
            block_loop = dataclasses.replace(loop, sensors=block_sensors)
            samples = jnp.minimum(NOISE_BLOCK, count - number * NOISE_BLOCK)
            return self._periods(program, block_loop, progress, begin, samples, sampled)

        blocks = (count + NOISE_BLOCK - 1) // NOISE_BLOCK
        after = jax.lax.fori_loop(0, blocks, block, progress)
        return after._replace(sums=averaged(after.sums, count))

    def _periods(
        self, program: Program, loop: SampledLoop, progress, first, count, sampled
    ) -> Progress:
        """The progress after `count` periods; a detailed program keeps the signals of the first of
        those `sampled` (from one number to another), also if there is none, and sums of means."""
        tableau, judge = tableau_of(self.solver), judge_of(program, loop)
        steps = partial(_equal_steps, tableau, judge=judge)
        integrate = HoldSteps(program, loop, steps, partial(_steps_alone, tableau))

        def period(i, progress):
            progress, number = restored(progress), first + i
            progress, sums = progress._replace(sums=None), progress.sums
            t, runs = program.time_of(number), None if sums is None else number < sampled[1]
            after, signals, _ = through_period(program, loop, integrate, number, t, progress, runs)
            if sums is not None:
                ended = progress.code != int(Outcome.SUCCESS)
                now = summed(sums, number == sampled[0], partial(nan_where, ended, signals))
                after = after._replace(sums=now)
            return halved(after)

        return restored(jax.lax.fori_loop(0, count, period, halved(progress)))

    def finish(self, program, case, progress, number):
        """Outputs at the last sample."""
        end, steps = program.time_of(number), number * _sampled_loop(case).substeps
        return final_outputs(program, case, progress, end, steps)

    def signals(self, program, case, progress, number):
        """Signals of sample `number`, and the range of the torque since the last observation."""
        t = program.time_of(number)
        assert progress.held_torque is not None
        signals = _sampled_loop(case).signals(number, t, progress.state)
        return dataclasses.replace(signals, torque_range=progress.held_torque.range())


def through_period(
    program: Program,
    loop: SampledLoop,
    integrate: Callable,
    number: IntScalar,
    t: RealScalar,
    progress: Progress,
    runs: BoolScalar | None = None,
) -> tuple[Progress, Signals, HeldTorque]:
    """The progress after the period of sample `number` at time `t` (s), or the last good one, and
    the sample's signals and the torques so far.

    `integrate` is as of `HoldSteps`; for `runs` see `_unless_ended`.
    """
    since = (progress.settled, progress.rest)
    carry = (progress.integrals, since, progress.held_torque, progress.error)
    through = partial(integrate, number)
    state, carry, signals = loop.period(number, t, progress.state, through, carry)
    candidate = with_peaks(progress, signals.omega, signals.parts)
    candidate = monitored(program, loop, candidate, t, progress.state)
    if progress.unmade is not None:
        assert signals.torque_unmade is not None
        unmade = progress.unmade.with_sample(signals.torque, signals.torque_unmade)
        candidate = candidate._replace(unmade=unmade)
    if progress.failures is not None:
        failures = progress.failures.observe(t, signals, program.tolerances)
        candidate = candidate._replace(failures=failures)
    checked = halved((state.plant, loop.controller.judged(state.memory)))
    after = _unless_ended(program, progress, candidate, state, checked, carry, t, runs)
    return after, signals, carry[2]


def stepper_for(stepper: AbstractStepper, loop: AbstractLoop) -> AbstractStepper:
    """The stepper itself; for a sampled loop, which defines its own steps, one with its solver."""
    return SampledStepper(stepper.solver) if isinstance(loop, SampledLoop) else stepper


def progress_at_zero(program: Program, case: Case) -> Progress:
    """The progress of equal steps before the first."""
    state = case.loop.start(case.start)
    begin = initial_progress(
        state, case.loop.plant, plant_state(case.loop, 0.0, state), case.possible
    )
    unmade = Unmade.none(begin.peak_square) if case.loop.tells_unmade else None
    begin = begin._replace(failures=initial_record(case.loop, state), unmade=unmade)
    begin = with_monitors(program, case.loop, begin)
    if program.error_every:
        begin = begin._replace(error=IntegrationError.none(begin.peak_square))
    return with_details(begin, case.loop, 3) if program.detailed else begin


def _sampled_loop(case: Case) -> SampledLoop:
    assert isinstance(case.loop, SampledLoop)
    return case.loop


def _equal_steps(tableau, rate, t, length, count: int, carry, judge):
    """The state after equal steps, and settling and rest, judged at the begin of each."""
    step = length / count

    def one(number, carry):
        state, since = carry
        begin = t + number * step
        after = explicit_step(tableau, rate, begin, step, state)
        return after, judge(since, begin, state)

    return one(0, carry) if count == 1 else jax.lax.fori_loop(0, count, one, carry)


def _steps_alone(tableau, rate, t, length, count: int, state):
    """The state after equal steps, without judgement."""
    return _equal_steps(tableau, rate, t, length, count, (state, None), lambda since, *_: since)[0]


def _unless_ended(
    program, before, candidate, state, checked, carry, t, runs: BoolScalar | None = None
) -> Progress:
    """The next progress, or the last good one where the case has ended or now ends.

    The case ends where the `checked` parts of the state, see `within_limit`, pass the limit. Where
    the next progress does not run (`runs`), the previous one remains.
    """
    integrals, (tracker, rest), held_torque, error = carry
    moves, *finite = checked
    good = within_limit(moves, program.state_limit, *finite, integrals.cost)
    running = before.code == int(Outcome.SUCCESS)
    if runs is not None:
        running = running & runs
    code = jnp.where(running & ~good, int(Outcome.STATE_LIMIT), before.code)
    after = candidate._replace(
        state=state,
        integrals=integrals,
        settled=tracker,
        rest=rest,
        held_torque=held_torque,
        error=error,
        ended_at=t + program.interval,
        code=code,
    )
    last_good = before._replace(code=code)
    return jax.tree.map(lambda new, old: jnp.where(running & good, new, old), after, last_good)


def final_outputs(
    program: Program,
    case: Case,
    progress: Progress,
    end: RealScalar,
    steps: IntScalar,
    begin: float | RealScalar = 0.0,
) -> Outputs:
    """Outputs of a trajectory from `begin` to `end` (s) in equal steps, so many in all."""
    plant = plant_state(case.loop, end, progress.state)
    observation = JudgedSignals.of(case.loop.plant, plant)
    since = (progress.settled, progress.rest)
    tracker, rest = judged_at(since, end, observation, program.tolerances)
    progress = with_peaks(progress, plant.omega, case.loop.plant.stored(plant))._replace(
        settled=tracker, rest=rest
    )
    success = progress.code == int(Outcome.SUCCESS)
    progress = monitored(program, case.loop, progress, end, progress.state, success)
    usage = consumption(case.loop, progress.state)
    dwell = program.tolerances.dwell
    details = details_of(progress, case.loop, progress.state, end, steps, dwell, begin)
    outputs = outputs_of(
        progress,
        plant,
        end,
        case.drawn,
        program.running_cost,
        usage,
        program.interval,
        details,
        dwell,
        begin,
    )
    return outputs._replace(requirements=margins_of(program, case.loop, progress))
