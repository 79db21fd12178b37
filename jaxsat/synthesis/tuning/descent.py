"""Resumable descent: by gradients from several starts, or by evolution of a population."""

from collections.abc import Callable
from dataclasses import dataclass, field, replace
from typing import Any, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Bool, Float, Int

from jaxsat.core.once import latest
from jaxsat.scenario.optimisers import OptimiserSettings
from jaxsat.simulation.engine.progress import Outputs
from jaxsat.simulation.trajectory import Outcome
from jaxsat.synthesis.tuning.cost_evaluator import CaseGradients
from jaxsat.synthesis.tuning.parameters import Values
from jaxsat.synthesis.tuning.plan import TuningPlan
from jaxsat.synthesis.tuning.strategies import next_population
from jaxsat.synthesis.tuning.unusable import NoGradient, unusable

NEVER = np.inf


class StepRecord(NamedTuple):
    """One step of all starts; NaN for a start that has been given up.

    Points and losses are those before the step. `failed`, `masked` and `bounded` count cases: runs
    that ended early, cases without a finite derivative, and derivatives cut to their bound.
    `trajectories` is the total after the step, in whole horizons.
    """

    points: Values
    loss: Float[np.ndarray, " starts"]
    gradient_norm: Float[np.ndarray, " starts"]
    settled: Float[np.ndarray, " starts"]
    failed: Int[np.ndarray, " starts"]
    masked: Int[np.ndarray, " starts"]
    bounded: Int[np.ndarray, " starts"]
    horizon: int
    trajectories: float


class ValidationRecord(NamedTuple):
    """The exact law on the validation cases after `step` steps; NaN for starts given up."""

    step: int
    loss: Float[np.ndarray, " starts"]
    settled: Float[np.ndarray, " starts"]
    best_loss: float
    best_point: Float[np.ndarray, " parameters"]
    trajectories: float


@dataclass
class DescentState:
    """State of a run: everything from which it is resumed, and its history."""

    points: Values
    alive: Bool[np.ndarray, " starts"]
    optimiser: Any
    best_point: Float[np.ndarray, " parameters"]
    best_loss: float = NEVER
    step: int = 0
    trajectories: float = 0.0
    steps: list[StepRecord] = field(default_factory=list)
    validations: list[ValidationRecord] = field(default_factory=list)


class DescentProgress(NamedTuple):
    """Progress of a descent: the start with the least training loss at this step."""

    step: int
    steps: int
    loss: float
    gradient_norm: float
    settled: float
    best_loss: float
    starts: int


def initial_state(plan: TuningPlan) -> DescentState:
    """Return the first state: the given point and the best screened ones, before any step."""
    settings, space = plan.settings, plan.space
    own = space.projected(space.to_search(plan.start[None]))
    if settings.descent.derivative_free:
        points = next_population(space, own[0], settings.seed, settings.starts, [])
        alive = np.ones(len(points), bool)
        return _validate(plan, DescentState(points, alive, (), points[0].copy()))
    points = own
    trajectories = plan.smooth.counter.trajectories
    if settings.starts > 1:
        trial_points = space.to_search(
            space.drawn(max(settings.screened, settings.starts), settings.seed)
        )
        best_first = trial_points
        if settings.screened:
            costs = plan.smooth.evaluate(trial_points, settings.screening()).cost
            losses = np.array([settings.objective.value(row) for row in costs])
            best_first = trial_points[np.argsort(losses, kind="stable")]
        points = np.concatenate([own, best_first[: settings.starts - 1]])
    trajectories = plan.smooth.counter.trajectories - trajectories
    state = DescentState(
        points,
        np.ones(len(points), bool),
        _transformation(settings.descent, settings.steps)[0](jnp.asarray(points)),
        points[0].copy(),
        trajectories=trajectories,
    )
    return _validate(plan, state)


def descent_step(plan: TuningPlan, state: DescentState) -> DescentState:
    """Take one step of every start that is alive, and validate where that is due.

    Raises `NoGradient` where no case of the step has a usable gradient at any start.
    """
    settings, objective = plan.settings, plan.settings.objective
    if settings.descent.derivative_free:
        return _generation(plan, state)
    numbers = settings.numbers(state.step)
    horizon = settings.intervals(state.step, plan.intervals)
    before = plan.smooth.counter.trajectories
    alive = np.flatnonzero(state.alive)
    gradients_of_cases = plan.smooth.differentiate(state.points[alive], numbers, horizon)
    per_start = [
        objective.loss_gradient(*both)
        for both in zip(
            gradients_of_cases.outputs.cost, gradients_of_cases.derivatives, strict=True
        )
    ]
    if all(entry.masked == len(numbers) for entry in per_start):
        first = state.points[alive[0]]
        one = CaseGradients(
            jax.tree.map(lambda x: x[:1], gradients_of_cases.outputs),
            gradients_of_cases.derivatives[:1],
        )
        reason = unusable(plan.smooth, first, numbers, horizon, one)
        raise NoGradient(
            f"no case of step {state.step + 1} has a usable gradient at any of its "
            f"{len(alive)} points; at the first {reason}"
        )
    gradients = np.zeros_like(state.points)
    gradients[alive] = [entry.gradient for entry in per_start]
    points, optimiser = _move(plan, state, gradients)
    trajectories = state.trajectories + plan.smooth.counter.trajectories - before
    record = StepRecord(
        np.where(state.alive[:, None], state.points, np.nan),
        _spread(state.alive, [entry.loss for entry in per_start]),
        _spread(state.alive, np.linalg.norm(gradients[alive], axis=1)),
        _spread(state.alive, _settled(gradients_of_cases.outputs)),
        _spread(state.alive, _ended_early(gradients_of_cases.outputs), 0),
        _spread(state.alive, [entry.masked for entry in per_start], 0),
        _spread(state.alive, [entry.bounded for entry in per_start], 0),
        horizon,
        trajectories,
    )
    following = _next_state(plan, state, record, points=points, optimiser=optimiser)
    if following.step in settings.halve_at:
        following.alive = _better_half(following)
    return following


def _generation(plan: TuningPlan, state: DescentState) -> DescentState:
    """Fly one population of the exact law on one set of cases, and validate where that is due.

    All points see the same cases, so that differences are not chance alone.
    """
    settings = plan.settings
    horizon = settings.intervals(state.step, plan.intervals)
    before = plan.exact.counter.trajectories
    outputs = plan.exact.evaluate(state.points, settings.numbers(state.step), horizon)
    losses = np.array([settings.objective.value(row) for row in np.asarray(outputs.cost)])
    trajectories = state.trajectories + plan.exact.counter.trajectories - before
    none = np.zeros(len(losses), int)
    record = StepRecord(
        state.points,
        losses,
        np.full(len(losses), np.nan),
        _settled(outputs),
        _ended_early(outputs),
        none,
        none,
        horizon,
        trajectories,
    )
    following = _next_state(plan, state, record)
    own = plan.space.projected(plan.space.to_search(plan.start[None]))[0]
    history = [(one.points, one.loss) for one in following.steps]
    following.points = next_population(plan.space, own, settings.seed, settings.starts, history)
    return following


def descend(
    plan: TuningPlan,
    state: DescentState,
    *,
    keep: Callable[[DescentState], None] | None = None,
    report: Callable[[DescentProgress], None] | None = None,
) -> DescentState:
    """Take at least one step, until all are done or the target is reached; `keep` is called with
    every state, `report` with the progress."""
    while state.step < plan.settings.steps:
        if state.step and plan.settings.reached(state.best_loss):
            break
        state = descent_step(plan, state)
        if keep is not None:
            keep(state)
        if report is not None:
            report(_progress(plan, state))
    return state


def _next_state(
    plan: TuningPlan, state: DescentState, record: StepRecord, **changes: Any
) -> DescentState:
    """Return the state after a step with its `changes`, validated where that is due."""
    following = replace(
        state,
        step=state.step + 1,
        trajectories=record.trajectories,
        steps=[*state.steps, record],
        **changes,
    )
    settings, step = plan.settings, following.step
    is_halving = step in settings.halve_at and not settings.descent.derivative_free
    due = is_halving or step % settings.validate_every == 0 or step == settings.steps
    return _validate(plan, following) if due else following


def _validate(plan: TuningPlan, state: DescentState) -> DescentState:
    """Add the exact law's loss on the validation cases, and the best point so far, to the state."""
    settings = plan.settings
    alive = np.flatnonzero(state.alive)
    before = plan.exact.counter.trajectories
    outputs = plan.exact.evaluate(state.points[alive], settings.validation())
    losses = [settings.objective.value(row) for row in outputs.cost]
    leader = int(np.argmin(losses))
    if losses[leader] < state.best_loss:
        state.best_loss = losses[leader]
        state.best_point = state.points[alive[leader]].copy()
    state.trajectories += plan.exact.counter.trajectories - before
    record = ValidationRecord(
        state.step,
        _spread(state.alive, losses),
        _spread(state.alive, _settled(outputs)),
        state.best_loss,
        state.best_point,
        state.trajectories,
    )
    state.validations = [*state.validations, record]
    return state


@latest(32)
def _transformation(descent: OptimiserSettings, steps: int):
    """Return optax's functions, mapped over starts, so that each is clipped by itself."""
    transformation = descent.transformation(steps)
    return jax.vmap(transformation.init), jax.jit(jax.vmap(transformation.update))


def _move(plan: TuningPlan, state: DescentState, gradients: Values):
    update = _transformation(plan.settings.descent, plan.settings.steps)[1]
    arrays = (jnp.asarray(gradients), state.optimiser, jnp.asarray(state.points))
    with jax.numpy_dtype_promotion("standard"):  # optax counts its steps in whole numbers
        shifts, optimiser = update(*arrays)
    new_points = plan.space.projected(state.points + np.asarray(shifts))
    return np.where(state.alive[:, None], new_points, state.points), optimiser


def _better_half(state: DescentState) -> Bool[np.ndarray, " starts"]:
    losses = np.where(state.alive, state.validations[-1].loss, NEVER)
    half = -(-int(state.alive.sum()) // 2)
    alive = np.zeros(len(losses), bool)
    alive[np.argsort(losses, kind="stable")[:half]] = True
    return alive & state.alive


def _settled(outputs: Outputs) -> np.ndarray:
    return np.isfinite(outputs.settling_time).mean(axis=1)


def _ended_early(outputs: Outputs) -> np.ndarray:
    return (np.asarray(outputs.code) != int(Outcome.SUCCESS)).sum(axis=1)


def _spread(
    alive: Bool[np.ndarray, " starts"], values: Any, others: float | int = np.nan
) -> np.ndarray:
    """Scatter the values of starts alive to all starts (starts,), `others` elsewhere."""
    everywhere = np.full(len(alive), others)
    everywhere[alive] = values
    return everywhere


def _progress(plan: TuningPlan, state: DescentState) -> DescentProgress:
    last = state.steps[-1]
    leader = int(np.nanargmin(last.loss))
    return DescentProgress(
        state.step,
        plan.settings.steps,
        float(last.loss[leader]),
        float(last.gradient_norm[leader]),
        float(last.settled[leader]),
        state.best_loss,
        int(state.alive.sum()),
    )
