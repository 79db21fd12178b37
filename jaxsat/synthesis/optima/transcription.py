"""Multiple shooting: the manoeuvre as a nonlinear program, solved by IPOPT through CasADi.

Time is cut into intervals of equal, unknown length with constant torque. The states at their ends
are unknowns, too, connected by Runge-Kutta steps.
"""

import enum
from dataclasses import dataclass
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Float

from jaxsat.core.errors import ArgumentError
from jaxsat.synthesis.optima.manoeuvre import Manoeuvre

SHORTEST = 1e-3
"""Least duration of a manoeuvre over `Manoeuvre.time_unit`."""

STATES = 7
"""Number of states: quaternion and ω."""

NO_RATE = np.zeros(3)


class BoundObjective(enum.Enum):
    """Objective to minimise: the duration (s), or ∫ Σ|T_i| dt (N m s)."""

    TIME = "time"
    EFFORT = "effort"


class Solution(NamedTuple):
    """A local optimum: value (s or N m s), duration (s), thrusts and states.

    `thrust` (intervals, m) in N m is held over equal intervals; `states` are those at their ends.
    """

    value: float
    duration: float
    thrust: Float[np.ndarray, "intervals m"]
    states: Float[np.ndarray, "ends 7"]


@dataclass(frozen=True)
class BoundTranscription:
    """The nonlinear program of a manoeuvre.

    Each of the `intervals` has `substeps` classical Runge-Kutta steps; `longest` (s) bounds the
    duration, without which least effort would be slower than any horizon.
    """

    manoeuvre: Manoeuvre
    objective: BoundObjective
    longest: float
    intervals: int = 96
    substeps: int = 2
    iterations: int = 1000

    def __post_init__(self):
        for name in ("intervals", "substeps", "iterations"):
            if not getattr(self, name) > 0:
                raise ArgumentError(name, "must be positive", getattr(self, name))
        if not self.shortest <= self.longest < np.inf:
            raise ArgumentError(
                "longest", f"must be finite and at least {self.shortest:.3g} s", self.longest
            )

    @property
    def shortest(self) -> float:
        """Least duration of a manoeuvre, s."""
        return SHORTEST * self.manoeuvre.time_unit()

    def solver(self) -> Any:
        """Return the CasADi function that solves the program from any guess.

        Raises `ModuleNotFoundError` where CasADi is not installed.
        """
        casadi = _casadi()
        m = self.manoeuvre.torque_axes.shape[1]
        states = casadi.MX.sym("states", STATES, self.intervals + 1)
        thrust = casadi.MX.sym("thrust", m, self.intervals)
        sizes = casadi.MX.sym("sizes", 3, self.intervals)
        duration = casadi.MX.sym("duration")
        step = self._interval(casadi).map(self.intervals)
        length = duration / self.intervals
        begins = casadi.DM(np.arange(self.intervals)[None, :]) * length
        after = step(states[:, :-1], thrust, begins, casadi.repmat(length, 1, self.intervals))
        torque = casadi.mtimes(casadi.DM(self.manoeuvre.torque_axes), thrust)
        by_time = self.objective is BoundObjective.TIME
        goal = duration if by_time else length * casadi.sum2(casadi.sum1(sizes))
        constraints = [
            casadi.vec(states[:, 1:] - after),
            casadi.vertcat(*self._arrival(casadi, states[:, -1])),
            casadi.vec(sizes - torque),
            casadi.vec(sizes + torque),
        ]
        unknowns = [casadi.vec(states), casadi.vec(thrust), casadi.vec(sizes), duration]
        program = {"x": casadi.vertcat(*unknowns), "f": goal, "g": casadi.vertcat(*constraints)}
        options = {
            "print_time": False,
            "ipopt": {
                "print_level": 0,
                "sb": "yes",
                "max_iter": self.iterations,
                "tol": 1e-8,
                "mu_strategy": "adaptive",
            },
        }
        return casadi.nlpsol("solver", "ipopt", program, options)

    def solve(self, solver: Any, seed: int) -> Solution | None:
        """Return the local optimum from a random guess; None where IPOPT fails."""
        return self._solve(solver, self._guess(np.random.default_rng(seed)))

    def solve_near(self, solver: Any, guess: Solution) -> Solution | None:
        """Return the local optimum near a solution; None where IPOPT fails."""
        return self._solve(solver, self._near(guess))

    def _solve(self, solver: Any, guess: Float[np.ndarray, " n"]) -> Solution | None:
        lower, upper = self._bounds()
        ties, arrivals, sizes = STATES * self.intervals, self._arrivals, 2 * 3 * self.intervals
        below = 0.0 if self.manoeuvre.ends_at_rest else -np.inf
        result = solver(
            x0=guess,
            lbx=lower,
            ubx=upper,
            lbg=np.concatenate([np.zeros(ties), np.full(arrivals, below), np.zeros(sizes)]),
            ubg=np.concatenate([np.zeros(ties + arrivals), np.full(sizes, np.inf)]),
        )
        if not solver.stats()["success"]:
            return None
        return self._solution(np.asarray(result["x"]).ravel(), float(result["f"]))

    def _interval(self, casadi) -> Any:
        """Return the CasADi function of the state after one interval of constant thrust."""
        man = self.manoeuvre
        state, thrust = casadi.SX.sym("x", STATES), casadi.SX.sym("u", man.torque_axes.shape[1])
        begin, length = casadi.SX.sym("t"), casadi.SX.sym("h")
        inertia = casadi.DM(man.inertia)
        inverse = casadi.DM(np.linalg.inv(man.inertia))

        def rate(t, x):
            q0, q, omega = x[0], x[1:4], x[4:7]
            relative = omega - self._frame_rate(casadi, q0, q)
            disturbance = man.amplitude * casadi.sin(man.frequency * t + man.phase) + man.constant
            torque = casadi.mtimes(casadi.DM(man.torque_axes), thrust) + disturbance
            nadir = _third_column(casadi, q0, q)
            gradient = casadi.cross(nadir, casadi.mtimes(inertia, nadir))
            turning = casadi.cross(omega, casadi.mtimes(inertia, omega))
            total = torque + 3 * man.gradient_rate**2 * gradient - turning
            acceleration = casadi.mtimes(inverse, total)
            if man.third_rate_held:
                acceleration -= inverse[:, 2] * (acceleration[2] / inverse[2, 2])
            return casadi.vertcat(
                -casadi.dot(q, relative) / 2,
                (q0 * relative + casadi.cross(q, relative)) / 2,
                acceleration,
            )

        h, x, t = length / self.substeps, state, begin
        for _ in range(self.substeps):
            k1 = rate(t, x)
            k2 = rate(t + h / 2, x + h / 2 * k1)
            k3 = rate(t + h / 2, x + h / 2 * k2)
            k4 = rate(t + h, x + h * k3)
            x, t = x + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4), t + h
        return casadi.Function("interval", [state, thrust, begin, length], [x])

    def _frame_rate(self, casadi, q0, q) -> Any:
        """Return the orbit frame's angular velocity in body axes."""
        axis = casadi.DM([0, 1, 0]) if self.manoeuvre.small_angle else _second_column(casadi, q0, q)
        return -self.manoeuvre.orbit_rate * axis

    def _arrival(self, casadi, end) -> list[Any]:
        """Return expressions that vanish at the target (q and -q alike), or where ω = 0.

        With tolerances the expressions are at most zero within those of tilt, turn and rate.
        """
        q0, q, rate = end[0], end[1:4], end[4 : 4 + self._rates]
        if not self.manoeuvre.rates_only:
            rate = (end[4:7] - self._frame_rate(casadi, q0, q))[: self._rates]
        if self.manoeuvre.ends_at_rest:
            return [rate] if self.manoeuvre.rates_only else [q, rate]
        tilt, turn, most = self.manoeuvre.end
        of_rate = casadi.sumsqr(rate) / most**2 - 1
        if self.manoeuvre.rates_only:
            return [of_rate]
        of_tilt = casadi.sumsqr(q[:2]) / np.sin(tilt / 2) ** 2 - 1
        of_turn = q[2] ** 2 / np.sin(turn / 2) ** 2 - (q0**2 + q[2] ** 2)
        return [of_tilt, of_turn, of_rate]

    @property
    def _rates(self) -> int:
        """Number of rates constrained at the end: without the third where it is held at zero."""
        return 2 if self.manoeuvre.third_rate_held else 3

    @property
    def _arrivals(self) -> int:
        if not self.manoeuvre.ends_at_rest:
            return 1 if self.manoeuvre.rates_only else 3
        return self._rates + (0 if self.manoeuvre.rates_only else 3)

    def _bounds(self) -> tuple[np.ndarray, np.ndarray]:
        man, n = self.manoeuvre, self.intervals
        start = np.concatenate([man.quaternion, man.omega])
        free = np.full(STATES * n, np.inf)
        thrust = np.full(man.torque_axes.shape[1] * n, man.limit)
        sizes = np.full(3 * n, np.inf)
        lower = [start, -free, -thrust, np.zeros(3 * n), [self.shortest]]
        upper = [start, free, thrust, sizes, [self.longest]]
        return np.concatenate(lower), np.concatenate(upper)

    def _guess(self, random: np.random.Generator) -> np.ndarray:
        """Return a straight line to one of the target's two signs, and thrust, with noise."""
        man, n = self.manoeuvre, self.intervals
        share = np.linspace(0, 1, n + 1)[:, None]
        sign = random.choice([-1.0, 1.0])
        target = np.array([sign, 0, 0, 0, 0, -man.orbit_rate, 0])
        if man.rates_only:
            target = np.concatenate([sign * man.quaternion, NO_RATE])
        start = np.concatenate([man.quaternion, man.omega])
        bumps = np.sin(np.pi * share * random.integers(1, 4, STATES))
        states = start + share * (target - start) + 0.5 * bumps * random.normal(size=STATES)
        states[:, :4] /= np.linalg.norm(states[:, :4], axis=1, keepdims=True)
        states[:, 4:] *= [1, 1, 0.3]
        thrust = man.limit * random.uniform(-0.5, 0.5, (n, man.torque_axes.shape[1]))
        spread = (1.0, 3.0) if self.objective is BoundObjective.TIME else (2.0, 8.0)
        duration = max(self.shortest, min(self.longest, man.slew_time() * random.uniform(*spread)))
        states[:, 4:] = (
            start[4:]
            + share * (target - start)[4:]
            + (bumps[:, 4:] * random.normal(size=3) * np.pi / duration)
        )
        sizes = np.abs(thrust @ man.torque_axes.T)
        return np.concatenate([states.ravel(), thrust.ravel(), sizes.ravel(), [duration]])

    def _near(self, guess: Solution) -> Float[np.ndarray, " n"]:
        """Return the guess as variables of this program, on its own intervals."""
        ends, middles = np.arange(self.intervals + 1), np.arange(self.intervals) + 0.5
        count = len(guess.thrust)
        sources = (middles / self.intervals * count).astype(int)
        thrust = guess.thrust[sources]
        places = ends / self.intervals * count
        states = [np.interp(places, np.arange(count + 1), column) for column in guess.states.T]
        sizes = np.abs(thrust @ self.manoeuvre.torque_axes.T)
        columns = np.stack(states, axis=1)
        return np.concatenate([columns.ravel(), thrust.ravel(), sizes.ravel(), [guess.duration]])

    def _solution(self, unknowns: np.ndarray, value: float) -> Solution:
        n, m = self.intervals, self.manoeuvre.torque_axes.shape[1]
        ends = np.cumsum([STATES * (n + 1), m * n])
        states, thrust, _ = np.split(unknowns, ends)
        return Solution(
            value, float(unknowns[-1]), thrust.reshape(n, m), states.reshape(n + 1, STATES)
        )


def _second_column(casadi, q0, q):
    """Return C (0, 1, 0)ᵀ of a quaternion from the orbit to the body frame."""
    return casadi.vertcat(
        2 * (q[0] * q[1] + q0 * q[2]),
        q0**2 - q[0] ** 2 + q[1] ** 2 - q[2] ** 2,
        2 * (q[1] * q[2] - q0 * q[0]),
    )


def _third_column(casadi, q0, q) -> Any:
    """Return C (0, 0, 1)ᵀ of a quaternion from the orbit to the body frame: nadir."""
    return casadi.vertcat(
        2 * (q[0] * q[2] - q0 * q[1]),
        2 * (q[1] * q[2] + q0 * q[0]),
        q0**2 - q[0] ** 2 - q[1] ** 2 + q[2] ** 2,
    )


def _casadi() -> Any:
    try:
        import casadi
    except ModuleNotFoundError as error:
        raise ModuleNotFoundError(
            "Bounds need CasADi; install it with `pip install 'jaxsat[bounds]'`."
        ) from error
    return casadi
