"""Search from several starts, plans of `jaxsat.control.planning` among them.

Each result is a local optimum, flown again with independent integrator and equations.
"""

import dataclasses
from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxsat.control.planning.planner import Plan, Planner, PlanStatus
from jaxsat.core.checks import require_counts
from jaxsat.core.tolerances import Tolerances
from jaxsat.simulation.loops import AbstractLoop, ContinuousLoop
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.synthesis.optima.manoeuvre import Manoeuvre, ideal_thrusters
from jaxsat.synthesis.optima.transcription import BoundObjective, BoundTranscription, Solution

TOLERANCE = 1e-11

MAX_ANGLE = 1e-4
"""Errors of a flight that arrives at rest, in rad and in rad per τ of the manoeuvre."""

MAX_EXCESS = 0.01
"""Relative excess over tolerances with which a flight still arrives."""


class EndError(NamedTuple):
    """Distance from the target at the end of a flight, in angle (rad) and relative rate (rad/s).

    The rate is inertial where rates alone are to be stopped. `effort` is ∫ Σ|T_i| dt (N m s) and
    `largest_thrust` the largest of any thruster (N m). `tilt` and `turn` (rad) are the parts of the
    angle across and about the third axis.
    """

    angle: float
    rate: float
    effort: float
    largest_thrust: float
    tilt: float
    turn: float

    def arrives(self, manoeuvre: Manoeuvre) -> bool:
        """Whether the flight ends where the manoeuvre does."""
        if manoeuvre.ends_at_rest:
            angles, ends = (self.angle,), (MAX_ANGLE, MAX_ANGLE / manoeuvre.tau)
        else:
            angles = (self.tilt, abs(self.turn))
            ends = tuple((1 + MAX_EXCESS) * one for one in manoeuvre.end)
        near = manoeuvre.rates_only or all(a < b for a, b in zip(angles, ends, strict=False))
        return near and self.rate < ends[-1]


def propagate(manoeuvre: Manoeuvre, solution: Solution) -> EndError:
    """Fly a solution's thrusts by DOP853, the attitude as direction cosines by (1), (10), (11)."""
    inverse = np.linalg.inv(manoeuvre.inertia)
    length = solution.duration / len(solution.thrust)

    def rate(t, y, torque):
        cosines, omega = y[:9].reshape(3, 3), y[9:]
        nadir = cosines[:, 2]
        gradient = 3 * manoeuvre.gradient_rate**2 * np.cross(nadir, manoeuvre.inertia @ nadir)
        turning = np.cross(omega, manoeuvre.inertia @ omega)
        total = torque + manoeuvre.disturbance(t) + gradient - turning
        cosines_rate = -np.cross(relative_rate(cosines, omega), cosines, axisb=0, axisc=0)
        return np.concatenate([cosines_rate.ravel(), acceleration(total)])

    def acceleration(total):
        if not manoeuvre.third_rate_held:
            return inverse @ total
        return np.append(np.linalg.solve(manoeuvre.inertia[:2, :2], total[:2]), 0.0)

    def relative_rate(cosines, omega):
        axis = np.eye(3)[1] if manoeuvre.small_angle else cosines[:, 1]
        return omega + manoeuvre.orbit_rate * axis

    from scipy.integrate import solve_ivp  # takes its time, and a check flies nothing

    y = np.concatenate([_cosines(manoeuvre.quaternion).ravel(), manoeuvre.omega])
    for number, thrust in enumerate(solution.thrust):
        span = (number * length, (number + 1) * length)
        torque = manoeuvre.torque_axes @ thrust
        arc = solve_ivp(rate, span, y, "DOP853", args=(torque,), rtol=TOLERANCE, atol=TOLERANCE)
        y = arc.y[:, -1]
    cosines, omega = y[:9].reshape(3, 3), y[9:]
    sine = np.array([cosines[1, 2] - cosines[2, 1], cosines[2, 0] - cosines[0, 2]])
    sine = np.append(sine, cosines[0, 1] - cosines[1, 0]) / 2
    angle = np.arctan2(np.linalg.norm(sine), (np.trace(cosines) - 1) / 2)
    tilt = np.arctan2(np.hypot(cosines[0, 2], cosines[1, 2]), cosines[2, 2])
    turn = np.arctan2(cosines[0, 1] - cosines[1, 0], cosines[0, 0] + cosines[1, 1])
    torques = solution.thrust @ manoeuvre.torque_axes.T
    return EndError(
        float(angle),
        float(np.linalg.norm(omega if manoeuvre.rates_only else relative_rate(cosines, omega))),
        float(np.abs(torques).sum() * length),
        float(np.abs(solution.thrust).max()),
        float(tilt),
        float(turn),
    )


def _cosines(quaternion: np.ndarray) -> np.ndarray:
    q0, q = quaternion[0], quaternion[1:]
    cross = np.array([[0, -q[2], q[1]], [q[2], 0, -q[0]], [-q[1], q[0], 0]])
    return (q0**2 - q @ q) * np.eye(3) + 2 * np.outer(q, q) - 2 * q0 * cross


INTERVALS = 96
"""Intervals: twice those of a plan, so that each plan is among the solutions."""

ROUNDING = 1e-6
"""Relative excess over the longest duration; IPOPT exceeds bounds by less."""


class Bound(NamedTuple):
    """The best solution, its verification flight, and the values of all local optima, best first.

    It is not certified: that no start led to a better one proves nothing.
    """

    objective: BoundObjective
    solution: Solution
    verification: EndError
    starts: int
    values: list[float]

    def as_data(self) -> dict[str, Any]:
        """Convert the bound and its flight to plain data."""
        return {
            "objective": self.objective.value,
            "value": self.solution.value,
            "duration_s": self.solution.duration,
            "starts": self.starts,
            "local_optima": self.values,
            "flown_again": self.verification._asdict(),
            "thrust_N_m": self.solution.thrust.tolist(),
            "states_quaternion_omega": self.solution.states.tolist(),
        }


def best_of_starts(
    manoeuvre: Manoeuvre,
    objective: BoundObjective,
    starts: int = 12,
    *,
    longest: float,
    seed: int = 0,
    intervals: int = INTERVALS,
    plans: Sequence[Solution] = (),
    report: Callable[[int, float], None] | None = None,
) -> Bound | None:
    """Return the best local optimum from `plans` and `starts` random guesses; None if none arrives.

    Its value is never above that of a plan. `longest` (s) bounds the duration. `report` gets the
    number of completed starts and the best value so far. Raises `ValueError` for no starts and
    `ModuleNotFoundError` without CasADi.
    """
    require_counts(starts=starts)
    transcription = BoundTranscription(manoeuvre, objective, longest, intervals)
    solver = transcription.solver()
    optima: list[tuple[Solution, EndError]] = []

    def add(solution: Solution | None) -> None:
        if solution is None or solution.duration > longest * (1 + ROUNDING):
            return
        verification = propagate(manoeuvre, solution)
        if verification.arrives(manoeuvre):
            effort = objective is BoundObjective.EFFORT
            value = verification.effort if effort else solution.duration
            optima.append((solution._replace(value=value), verification))

    for number in range(len(plans) + starts):
        if number < len(plans):
            add(plans[number])
            add(transcription.solve_near(solver, plans[number]))
        else:
            add(transcription.solve(solver, seed * 1_000_003 + number - len(plans)))
        if report is not None:
            report(number + 1, min((one.value for one, _ in optima), default=float("inf")))
    if not optima:
        return None
    optima.sort(key=lambda pair: pair[0].value)
    best, verification = optima[0]
    count = len(plans) + starts
    return Bound(objective, best, verification, count, [one.value for one, _ in optima])


GUESSES = 48

STRETCHES = (2.0, 4.0, 8.0)
"""Durations of plans of least effort over the least time."""


def plans_of(
    loop: AbstractLoop,
    start: PlantState,
    objective: BoundObjective,
    longest: float,
    tolerances: Tolerances | None = None,
) -> list[Solution]:
    """Return the plan of least time and, for least effort, plans of durations up to `longest` (s).

    They end within `tolerances` or, without them, at rest; another one ends at rest in any case.
    Empty with less than two thrusters, for a third rate that is held, and where no plan arrives.
    """
    planner = _planner(loop, tolerances)
    if planner is None:
        return []
    plans = quickest_plans(planner, start)
    if objective is BoundObjective.EFFORT and int(plans[0].status) != PlanStatus.FAILED:
        cheapest = eqx.filter_jit(planner.cheapest)
        least = float(plans[0].duration)
        durations = dict.fromkeys(min(stretch * least, longest) for stretch in STRETCHES)
        plans += [cheapest(jnp.zeros(()), start, jnp.asarray(one)) for one in durations]
    return [solution_of(plan) for plan in plans if int(plan.status) != PlanStatus.FAILED]


def quickest_plans(planner: Planner, start: PlantState) -> list[Plan]:
    """Return the plan of least time and, with tolerances, also that to exact rest."""
    planners = [planner]
    if planner.tolerances is not None:
        planners.append(dataclasses.replace(planner, tolerances=None))
    return [_quickest(one, start) for one in planners]


@eqx.filter_jit
def _quickest(planner: Planner, start: PlantState) -> Plan:
    return planner.quickest(jnp.zeros(()), start)


def solution_of(plan: Plan) -> Solution:
    """Convert a plan to a solution with its duration as value."""
    states = np.concatenate([plan.quaternion, plan.omega], axis=1)
    duration = float(plan.duration)
    return Solution(duration, duration, np.asarray(plan.torque), states)


def _planner(loop: AbstractLoop, tolerances: Tolerances | None) -> Planner | None:
    if not isinstance(loop, ContinuousLoop | SampledLoop):
        return None
    plant, thrusters = loop.plant, ideal_thrusters(loop.plant)
    if thrusters is None or thrusters.count < 2 or plant.third_rate_held:
        return None
    axes, limit = thrusters.torque_axes, thrusters.limit
    return Planner(plant, axes, limit, guesses=GUESSES, tolerances=tolerances)
