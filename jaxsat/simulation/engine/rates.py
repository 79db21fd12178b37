"""Rates of loops with their integrals of cost and effort, and equal steps through holds."""

import dataclasses
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, PyTree

from jaxsat.core.array_types import RealScalar, Vector
from jaxsat.simulation.assessment import JudgedSignals, stop_gradient
from jaxsat.simulation.engine.details import effort_rates
from jaxsat.simulation.engine.program import Case, Program
from jaxsat.simulation.engine.progress import Integrals, RunningCost, Since, judged_at
from jaxsat.simulation.engine.runge_kutta import HalvedSteps, Span
from jaxsat.simulation.loops import AbstractContinuousLoop, AbstractLoop
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.held_effector import Hold


def continuous_loop(case: Case) -> AbstractContinuousLoop:
    """The case's loop; raises `TypeError` unless it is an ordinary differential equation."""
    if not isinstance(case.loop, AbstractContinuousLoop):
        raise TypeError(f"A loop must be one of jaxsat.simulation, but got {type(case.loop)}.")
    return case.loop


def plant_state(loop: AbstractLoop, t: float | RealScalar, state: PyTree) -> PlantState:
    """The plant in any loop's state at time `t` (s)."""
    if isinstance(loop, AbstractContinuousLoop):
        return loop.plant_state(jnp.asarray(t), state)
    return state.plant


def consumption(loop: AbstractLoop, state: PyTree) -> dict[str, Array]:
    """Consumption of the effectors up to a state of the loop, by the names of their signals, and
    what its estimator has counted."""
    if not isinstance(loop, SampledLoop):
        return {}
    parts = zip(loop.plant.effectors, state.effectors, strict=True)
    used = {name: x for one, own in parts for name, x in one.consumption(own).items()}
    return used | loop.counts(state)


def augmented_rate(program: Program, loop: AbstractContinuousLoop):
    """Right-hand side for a loop's state together with its integrals."""

    def rate(t, both):
        motion = loop.motion(t, both[0])
        torque = motion.torque
        effort = effort_rates(
            program.detailed, loop.plant, t, motion.plant, torque, jnp.abs(torque)
        )
        cost = running_cost(program.running_cost, motion.plant, motion.relative_rate, torque)
        return motion.rate, Integrals(cost, effort)

    return rate


def running_cost(
    cost: RunningCost | None, plant: PlantState, relative_rate: Vector, torque: Vector
) -> RealScalar:
    """The cost rate, per second; zero without a cost."""
    if cost is None:
        return jnp.zeros((), torque.dtype)
    wz = plant.attitude.as_wz()
    return cost(wz.w, wz.z, relative_rate, torque)


def held_rate(
    program: Program, loop: SampledLoop, hold: Hold, begin: RealScalar, start: PlantState
):
    """Right-hand side for the plant and its integrals in a hold.

    The hold begins at `begin` (s) with the plant in the state `start`.
    """

    mean = loop.mean_torque_size(begin, start, hold)

    def rate(t, both):
        state, _ = both
        plant_rate, relative_rate, torque = loop.motion(t, state, hold, t - begin)
        cost = running_cost(program.running_cost, state, relative_rate, torque)
        size = jnp.abs(torque) if mean is None else mean
        effort = effort_rates(program.detailed, loop.plant, t, state, torque, size)
        return plant_rate, Integrals(cost, effort)

    return rate


def judge_of(program: Program, loop: AbstractLoop):
    """Function that updates settling and rest by the state between two steps."""

    def judge(since: Since, t, both) -> Since:
        state = both[0] if isinstance(loop, SampledLoop) else plant_state(loop, t, both[0])
        return judged_at(since, t, JudgedSignals.of(loop.plant, state), program.tolerances)

    return judge


class HoldSteps(NamedTuple):
    """Equal steps through the holds of a sampled loop, with the torque and the error in each.

    `steps` returns the state, and trackers of settling and rest, after equal steps from a rate, an
    initial time (s), a length (s), the number of steps, state and trackers; `alone` the state
    without trackers, see `HalvedSteps`.
    """

    program: Program
    loop: SampledLoop
    steps: Callable
    alone: Callable

    def __call__(self, number, t, hold: Hold, plant: PlantState, carry: tuple):
        """The plant and the carry after a hold that begins at time `t` (s) in period `number`."""
        (integrals, since, held_torque, error), loop, length = carry, self.loop, hold.length
        rate, count = held_rate(self.program, loop, hold, t, plant), loop.substeps
        first = loop.motion(t, plant, hold, jnp.zeros_like(length)).torque
        (after, integrals), since = self.steps(rate, t, length, count, ((plant, integrals), since))
        last = loop.motion(t + length, after, hold, length).torque
        held_torque = held_torque.with_hold(*stop_gradient((length, first, last)))
        same, still = stop_gradient((loop, hold))
        estimate = HalvedSteps(
            self.program, self.alone, count, loop.plant, lambda now, plant: plant
        )
        error = estimate.after(
            error,
            number,
            lambda now, plant: same.motion(now, plant, still, now - t).rate,
            Span(t, length, plant, after),
        )
        return after, (integrals, since, held_torque, error)


def within_limit(state: PyTree, limit: RealScalar, *finite: PyTree) -> Array:
    """Whether the Euclidean norm of all floating-point entries is a number below the limit.

    Momenta of wheels, which scale with the body, and the trees `finite` need only be finite.
    """
    motion = jax.tree.map(
        lambda one: dataclasses.replace(one, effectors=None) if _is_plant(one) else one,
        state,
        is_leaf=_is_plant,
    )
    squares = [jnp.sum(x**2) for x in _floats(motion)]
    plants = [x for x in jax.tree.leaves(state, is_leaf=_is_plant) if _is_plant(x)]
    squares += [jnp.sum(0 * x) for x in _floats(([plant.effectors for plant in plants], finite))]
    return sum(squares) < limit**2  # which fails for NaN, too


def _is_plant(state: PyTree) -> bool:
    return isinstance(state, PlantState)


def _floats(tree: PyTree) -> list[Array]:
    return [x for x in jax.tree.leaves(tree) if jnp.issubdtype(x.dtype, jnp.floating)]
