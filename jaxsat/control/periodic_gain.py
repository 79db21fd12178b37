"""The linear-quadratic gain of magnetorquers over an orbit, by a periodic Riccati equation.

What magnetorquers can do depends on the Earth's field, which is periodic in the place in the orbit
and in the Earth's turn. A day is slow beside an orbit, so the gain is that of a periodic system for
each turn of the Earth: Wisniewski, Satellite Attitude Control Using Only Electromagnetic Actuation,
PhD thesis, Aalborg, 1996; Psiaki, J. Guidance, Control, and Dynamics 24(2), 2001.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from jaxsat.core.attitude import skew
from jaxsat.core.checks import as_float
from jaxsat.spacecraft.environment.orbit import EARTH_ROTATION, DipoleField

TURNS, PHASES = 8, 32
"""Of the Earth and of the orbit, for which gains are stored."""

STEPS = 32
"""Of integration from one phase to the next."""

FLOOR = 0.01
"""Of a torque along the field, what the gains are designed as if it were made. They stay bounded so
where the field hardly turns: in orbits near the geomagnetic equator, for a part of a day."""

SETTLED, MOST_ORBITS = 1e-9, 400
"""Relative change in an orbit of a Riccati solution that has settled; it does within so many."""

RealScalar = Float[Array, ""]
Matrices = Float[np.ndarray, "... _ _"]
"""Square ones."""


class LinearMotion(NamedTuple):
    """dx/dτ = `state` x + (0, `inverse` T) u about rest in the orbit frame, x = (θ, ω_r / ω0).

    τ = ω0 t, θ (rad) is the small turn from the orbit frame and ω_r the relative rate. Torques u
    are in units of J0 ω0², J0 = `moment` (kg m²), the geometric mean of the principal moments;
    `inverse` is J0 J⁻¹. T, of shape (turns, 2n + 1, 3, 3), is what of a torque is made, at n equal
    steps of an orbit and in their middles, for each turn of the Earth: `reach`.
    """

    moment: float
    rate: float
    state: Float[np.ndarray, "6 6"]
    inverse: Float[np.ndarray, "3 3"]
    reach: Float[np.ndarray, "turns halves 3 3"]


def linear_motion(
    inertia: Float[np.ndarray, "3 3"],
    field: DipoleField,
    unmade: Float[np.ndarray, "3 3"],
    momentum: Float[np.ndarray, "3"],
    *,
    gravity_gradient: bool,
) -> LinearMotion:
    """The motion of a body (kg m²) in a field, with what wheels leave to magnetorquers, `unmade`.

    That is an orthogonal projection N, and T = 1 - N + N (1 - b bᵀ) N, b = B / |B|. `momentum`
    (N m s) is that of the wheels in body axes. With gravity gradient 3 ω0² n × Jn is in it.
    """
    rate = float(field.orbit.rate)
    moment = float(np.cbrt(np.linalg.det(inertia)))
    scaled, stored = inertia / moment, momentum / (moment * rate)
    frame, nadir = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    inverse, turning = np.linalg.inv(scaled), _cross(frame)
    spin = inverse @ (_cross(scaled @ frame + stored) - turning @ scaled)  # of a change of ω
    state = np.zeros((6, 6))
    state[:3, 3:] = np.eye(3)
    state[3:, 3:] = spin - turning
    state[3:, :3] = spin @ turning
    if gravity_gradient:
        pull = _cross(nadir) @ scaled - _cross(scaled @ nadir)
        state[3:, :3] += 3 * inverse @ pull @ _cross(nadir)
    instants = np.arange(2 * PHASES * STEPS + 1) * np.pi / (PHASES * STEPS * rate)
    turns = np.arange(TURNS) * 2 * np.pi / TURNS
    over = jax.jit(jax.vmap(jax.vmap(field.over, (0, None)), (None, 0)))
    there = np.asarray(over(as_float(instants), as_float(turns)), float)
    units = there / np.linalg.norm(there, axis=-1, keepdims=True)
    across = np.eye(3) - units[..., :, None] * units[..., None, :]
    return LinearMotion(moment, rate, state, inverse, np.eye(3) - unmade + unmade @ across @ unmade)


class PeriodicGain(eqx.Module):
    """K of the torque -K (θ, ω_r, d), N m, bilinear between `gains` over an orbit and a day.

    θ is the turn from the orbit frame (rad), ω_r the rate relative to it (rad/s), and d a constant
    torque (N m) that acts besides. `gains` are those of `turns` of the Earth and phases of the
    orbit, evenly spaced from time zero on; `rate` is ω0 (rad/s).
    """

    gains: Float[Array, "turns phases 3 9"] = eqx.field(converter=as_float)
    rate: RealScalar = eqx.field(converter=as_float)

    def __call__(self, t: RealScalar) -> Float[Array, "3 9"]:
        """K at time `t` (s)."""
        turns, phases = self.gains.shape[:2]
        turn, after_turn, late = _places(EARTH_ROTATION * t, turns)
        phase, after_phase, share = _places(self.rate * t, phases)

        def along(place):
            row = self.gains[place]
            return row[phase] * (1 - share) + row[after_phase] * share

        return along(turn) * (1 - late) + along(after_turn) * late


def _places(angle: RealScalar, count: int):
    """The two of so many places on a circle about an angle (rad), and the share of the second."""
    place = angle * (count / (2 * np.pi))
    place = place - count * jnp.floor(place / count)
    low = jnp.minimum(jnp.floor(place), count - 1).astype(int)
    return low, jnp.where(low == count - 1, 0, low + 1), place - low


def periodic_gain(motion: LinearMotion, weight: float) -> PeriodicGain | None:
    """K = J⁻¹ P / r, P the solution of -dP/dτ = AᵀP + PA + Q - P Γ P with Γ = J⁻¹ (T + f) J⁻¹ / r.

    But for the `FLOOR` f it is least in ∫ |θ|² + |ω_r / ω0|² + r |v|² dτ with T = L Lᵀ, u = L v: of
    torques that can be made; r is the `weight`. The state of A, P and Q has the constant torque d
    as well, which nothing weighs. None where P of θ and ω_r does not become periodic.
    """
    state, into, cost = np.zeros((9, 9)), np.zeros((*motion.reach.shape[:2], 9, 9)), np.zeros(9)
    state[:6, :6], state[3:6, 6:], cost[:6] = motion.state, motion.inverse, 1.0
    made = motion.reach + FLOOR * np.eye(3)
    into[..., 3:6, 3:6] = motion.inverse @ made @ motion.inverse / weight
    onwards = _products(_transitions(_hamiltonian(state, into, np.diag(cost))), STEPS)
    solution = np.broadcast_to(np.eye(9), (TURNS, 9, 9))
    for _ in range(MOST_ORBITS):
        before, rows = solution, []
        for phase in reversed(range(PHASES)):
            upper, lower = onwards[:, phase, :9], onwards[:, phase, 9:]
            left = lower[..., 9:] - solution @ upper[..., 9:]
            solution = np.linalg.solve(left, solution @ upper[..., :9] - lower[..., :9])
            solution = (solution + np.swapaxes(solution, 1, 2)) / 2
            rows.append(solution)
        change = np.abs(solution[:, :6] - before[:, :6]).max()
        size = np.abs(solution[:, :6]).max()
        if not np.isfinite(size):
            return None
        if change <= SETTLED * size:
            riccati = np.stack(rows[::-1], axis=1)
            return PeriodicGain(
                motion.inverse @ riccati[..., 3:6, :] / weight * _units(motion), motion.rate
            )
    return None


def _hamiltonian(state: Matrices, into: Matrices, cost: Matrices) -> Matrices:
    """What moves the state and P times the state."""
    count = state.shape[-1]
    whole = np.zeros((*into.shape[:-2], 2 * count, 2 * count))
    whole[..., :count, :count], whole[..., count:, count:] = state, -state.T
    whole[..., :count, count:], whole[..., count:, :count] = -into, -cost
    return whole


def _units(motion: LinearMotion) -> Float[np.ndarray, "9"]:
    """Of the columns of a gain: N m for rad, N m s, and 1."""
    momentum = motion.moment * motion.rate
    return np.repeat([momentum * motion.rate, momentum, 1.0], 3)


def floquet_multipliers(motion: LinearMotion, gain: PeriodicGain) -> Complex[np.ndarray, "turns 6"]:
    """What the linear closed loop does in an orbit while the Earth stands, for each of its turns.

    Multipliers in decreasing size; errors fall if the size of all is below one.
    """
    gains = (np.asarray(gain.gains, float) / _units(motion))[..., :6]
    halves = motion.reach.shape[1]
    place = np.arange(halves) / (2 * STEPS)
    low = place.astype(int) % PHASES
    share = (place % 1)[:, None, None]
    gains = gains[:, low] * (1 - share) + gains[:, (low + 1) % PHASES] * share
    closed = np.broadcast_to(motion.state, (TURNS, halves, 6, 6)).copy()
    closed[..., 3:, :] -= motion.inverse @ motion.reach @ gains
    grown = _products(_transitions(closed), PHASES * STEPS)[:, 0]
    values = np.linalg.eigvals(grown).astype(complex)
    return np.take_along_axis(values, np.argsort(-np.abs(values), axis=1), axis=1)


def _cross(vector: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    return np.asarray(skew(as_float(vector)), float)


def _transitions(matrices: Matrices) -> Matrices:
    """What dX/dτ = F X does to X in each step of an orbit, by the classical Runge-Kutta method."""
    begin, middle, end = matrices[:, :-2:2], matrices[:, 1:-1:2], matrices[:, 2::2]
    step, one = 2 * np.pi / begin.shape[1], np.eye(matrices.shape[-1])
    second = middle @ (one + step / 2 * begin)
    third = middle @ (one + step / 2 * second)
    return one + step / 6 * (begin + 2 * second + 2 * third + end @ (one + step * third))


def _products(matrices: Matrices, count: int) -> Matrices:
    """Of each so many that follow each other, the later on the left."""
    groups = matrices.reshape(matrices.shape[0], -1, count, *matrices.shape[-2:])
    product = groups[:, :, 0]
    for place in range(1, count):
        product = groups[:, :, place] @ product
    return product
