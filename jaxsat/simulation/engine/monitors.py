"""Monitors of requirements during a trajectory, at every observed instant."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.core.array_types import BoolScalar, RealScalar
from jaxsat.simulation.assessment import stop_gradient
from jaxsat.simulation.engine.program import Program
from jaxsat.simulation.engine.progress import Progress
from jaxsat.simulation.engine.rates import consumption, plant_state
from jaxsat.simulation.loops import AbstractLoop, failures_of, sensor_failures_of
from jaxsat.simulation.requirements import Margin, Requirements
from jaxsat.simulation.trajectory import Signals


def with_monitors(program: Program, loop: AbstractLoop, progress: Progress) -> Progress:
    """Progress at time zero with monitors of the program's requirements, if any."""
    if program.requirements is None:
        return progress
    zero = jnp.zeros_like(progress.ended_at)
    monitors = program.requirements.initial(zero, _failure_times(loop).size)
    return progress._replace(monitors=monitors)


def monitored(
    program: Program,
    loop: AbstractLoop,
    progress: Progress,
    t: RealScalar,
    state: PyTree,
    good: BoolScalar | bool = True,
) -> Progress:
    """The progress with one more instant `t` (s) of the loop's state, NaN where not `good`."""
    if program.requirements is None:
        return progress
    loop, state, t = stop_gradient((loop, state, t))
    signals, failures = state_signals(loop, t, state), _failure_times(loop)
    monitors = program.requirements.observe(progress.monitors, t, signals, failures, good)
    return progress._replace(monitors=monitors)


def state_signals(loop: AbstractLoop, t: RealScalar, state: PyTree) -> dict[str, Array]:
    """The signals, by name, that follow from a loop's state without its law."""
    plant = plant_state(loop, t, state)
    return {
        "quaternion": plant.attitude.as_quaternion().q,
        "omega": plant.omega,
        "relative_rate": loop.plant.relative_rate(plant),
        **loop.plant.stored(plant),
        **consumption(loop, state),
    }


def margins_of(program: Program, loop: AbstractLoop, progress: Progress) -> Margin | None:
    """The margins after the last instant; None without requirements."""
    if program.requirements is None:
        return None
    return program.requirements.margins(progress.monitors, _failure_times(loop))


def margins_of_history(
    requirements: Requirements | None,
    loop: AbstractLoop,
    times: Float[Array, " times"],
    signals: Signals,
) -> Margin | None:
    """The margins of a whole history, NaN after the end of the run; None without requirements."""
    if requirements is None:
        return None
    arrays = {name: one for name, one in vars(signals).items() if isinstance(one, jax.Array)}
    return requirements.after_history(times, arrays | signals.parts, _failure_times(loop))


def _failure_times(loop: AbstractLoop) -> Float[Array, " f"]:
    failures = (*failures_of(loop), *sensor_failures_of(loop))
    return jnp.concatenate([jnp.zeros(0), *(one.at for one in failures)])
