"""A trajectory in equal steps, interval by interval."""

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxsat.dynamics import PlantState
from jaxsat.engine.program import Program
from jaxsat.engine.progress import Progress, judged_at, looked_at
from jaxsat.engine.rates import augmented_rate, held_rate
from jaxsat.engine.runge_kutta import explicit_step
from jaxsat.metrics import Since
from jaxsat.simulation import AbstractLoop, Outcome, SampledLoop
from jaxsat.simulation.assessment import Sight
from jaxsat.simulation.loops import SampledState
from jaxsat.simulation.solve import all_within
from jaxsat.vehicle import Sensors


def advance_in_equal_steps(
    tableau, substeps: int, program: Program, loop: AbstractLoop, progress: Progress, first, count
) -> Progress:
    """Progress of one trajectory after `count` intervals from number `first` on.

    A sampled loop takes its own substeps in each period.
    """

    def interval(i, progress):
        number = first + i
        t = number * program.interval
        if isinstance(loop, SampledLoop):
            seen, state, integrals = _sampled_interval(tableau, program, loop, number, t, progress)
        else:
            seen, state, integrals = _continuous_interval(
                tableau, substeps, program, loop, t, progress
            )
        return _unless_ended(program, progress, seen, state, integrals, t)

    return jax.lax.fori_loop(0, count, interval, progress)


def advance_with_drawn_noise(
    tableau, program: Program, loop: SampledLoop, progress: Progress, first, count, block: int
) -> Progress:
    """The same of a loop with noise, which is drawn for `block` samples at a time.

    The numbers are those of one sample after the other; a batch draws many at once in less time.
    """
    sensors = loop.sensors
    assert isinstance(sensors, Sensors)

    def one(number, progress):
        begin = first + number * block
        drawn = sensors.drawn(begin, block, progress.state.plant.omega.dtype)
        told = eqx.tree_at(lambda loop: loop.sensors, loop, drawn)
        left = jnp.minimum(block, count - number * block)
        return advance_in_equal_steps(tableau, 0, program, told, progress, begin, left)

    return jax.lax.fori_loop(0, (count + block - 1) // block, one, progress)


def _sampled_interval(tableau, program, loop, number, t, progress):
    torque, memory, signals = loop.sample(number, t, progress.state)
    both, settled = (progress.state.plant, progress.integrals), progress.settled

    def judge(settled, time, both):
        return judged_at(settled, time, Sight.of(loop.plant, both[0]), program.tolerances)

    for hold in loop.holds(progress.state, torque):
        rate = held_rate(program, loop, hold.torque)
        where = (tableau, rate, t + hold.begin, hold.length, loop.substeps)
        both, settled = _steps(*where, both, settled, judge)
    plant, integrals = both
    plant = PlantState(plant.attitude.normalised(), plant.omega)
    seen = looked_at(progress, signals)._replace(settled=settled)
    return seen, SampledState(plant, memory, torque), integrals


def _continuous_interval(tableau, substeps, program, loop, t, progress):
    def judge(settled, time, both):
        sight = Sight.of(loop.plant, loop.plant_state(both[0]))
        return judged_at(settled, time, sight, program.tolerances)

    seen = looked_at(progress, loop.signals(t, progress.state))
    where = (tableau, augmented_rate(program, loop), t, program.interval, substeps)
    both = (progress.state, progress.integrals)
    both, settled = _steps(*where, both, progress.settled, judge)
    return seen._replace(settled=settled), *both


def _steps(tableau, rate, t, length, count: int, state, settled: Since, judge):
    """The state after equal steps, and since when the case is settled, judged where each begins."""
    step = length / count

    def one(number, carry):
        state, settled = carry
        begin = t + number * step
        after = explicit_step(tableau, rate, begin, step, state)
        return after, judge(settled, begin, state)

    return (
        one(0, (state, settled))
        if count == 1
        else jax.lax.fori_loop(0, count, one, (state, settled))
    )


def _unless_ended(program, before, seen, state, integrals, t) -> Progress:
    """The next progress, or the last good one where the case has ended or now ends."""
    judged = (state.plant, state.memory) if isinstance(state, SampledState) else state
    fine = all_within((judged, integrals.cost * 0), program.state_limit)
    running = before.code == int(Outcome.SUCCESS)
    code = jnp.where(running & ~fine, int(Outcome.STATE_LIMIT), before.code)
    after = seen._replace(
        state=state, integrals=integrals, ended_at=t + program.interval, code=code
    )
    kept = before._replace(code=code)
    return jax.tree.map(lambda new, old: jnp.where(running & fine, new, old), after, kept)
