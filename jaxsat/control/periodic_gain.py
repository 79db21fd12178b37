"""Linear-quadratic gain of magnetorquers and wheels over an orbit, by a Riccati equation.

The authority of magnetorquers depends on the Earth's field, which is periodic in orbit phase and
Earth rotation. A day is slow beside an orbit, so the gain is that of a periodic system for each
angle of the Earth: Wisniewski, Satellite Attitude Control Using Only Electromagnetic Actuation, PhD
thesis, Aalborg, 1996; Psiaki, J. Guidance, Control, and Dynamics 24(2), 2001.
"""

import pickle
from collections.abc import Iterable
from math import factorial

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Complex, Float

from jaxsat.control.linear_motion import PHASES, STEPS, TURNS, LinearMotion
from jaxsat.core.array_types import IntScalar, RealScalar, Vector
from jaxsat.core.checks import as_float
from jaxsat.core.once import latest
from jaxsat.spacecraft.environment.orbit import EARTH_ROTATION, place_on_circle

AT_ONCE = 4
"""Integration steps per step of the Riccati solution."""

FLOOR = 0.01
"""Share of a torque along the field that the design assumes to be available. It bounds the gains
where the field hardly turns: in orbits near the geomagnetic equator, for a part of a day."""

SETTLED, MOST_ORBITS = 1e-9, 400
"""Relative change per orbit of a converged Riccati solution, and the largest number of orbits."""

Matrices = Float[np.ndarray, "... _ _"]
"""Square matrices."""


class PeriodicGain(eqx.Module):
    """K of the torques -K (θ, ω_r, η, d), N m, bilinear between `gains` over an orbit and a day.

    θ is the rotation from the orbit frame (rad), ω_r the rate relative to it (rad/s), η the
    momentum of wheels beyond their bias along the columns of `basis` (N m s), and d a constant
    external torque (N m). The first three rows of K belong to rods, with no torque along `basis`,
    the others to wheels along `basis`. `gains` are for `turns` angles of the Earth and phases of
    the orbit, evenly spaced from time zero, behind the axes that `place` indexes; `rate` is ω0
    (rad/s).
    """

    gains: Float[Array, "*place turns phases u z"] = eqx.field(converter=as_float)
    basis: Float[Array, "3 p"] = eqx.field(converter=as_float)
    rate: RealScalar = eqx.field(converter=as_float)
    place: tuple[IntScalar, ...] = ()

    def torque(
        self, t: RealScalar, motion: Float[Array, "6"], momentum: Vector, constant: Vector
    ) -> Vector:
        """The commanded torque (N m) at `motion` (θ, ω_r), in body axes.

        `momentum` (N m s) is that of wheels beyond their bias.
        """
        errors = jnp.concatenate([motion, self.basis.T @ momentum, constant])
        torques = -self(t) @ errors
        return torques[:3] + self.basis @ torques[3:]

    def __call__(self, t: RealScalar) -> Float[Array, "u z"]:
        """K at time `t` (s)."""
        turns, phases = self.gains.shape[-4:-2]
        turn, late = place_on_circle(EARTH_ROTATION * t, turns)
        phase, share = place_on_circle(self.rate * t, phases)
        rows = jnp.stack([turn, _next(turn, turns)])[:, None]
        columns = jnp.stack([phase, _next(phase, phases)])
        corners = self.gains.at[(*self.place, rows, columns)].get(mode="promise_in_bounds")
        along = corners[:, 0] * (1 - share) + corners[:, 1] * share
        return along[0] * (1 - late) + along[1] * late


def _next(place: IntScalar, count: int) -> IntScalar:
    return jnp.where(place == count - 1, 0, place + 1)


def periodic_gain(
    motion: LinearMotion, weight: float, wheel_weight: float = 1.0
) -> PeriodicGain | None:
    """K of S, the solution of -dS/dτ = AᵀS + SA + Q - S Γ S, for each angle of the Earth.

    Γ = J⁻¹ N (M + f) N J⁻¹ / r + C Cᵀ / s, C the effect of `wheels`; r is the `weight` over the
    square of the stiffness g of the motion, s the `wheel_weight`. Except for the `FLOOR` f and the
    rods' torque along wheel axes, the gain minimises ∫ |θ|² + |ω_r / g ω0|² + r |m|² + s |c|² dτ,
    where dipoles m × b produce M u: with momentum in wheels precession takes torques of g J0 ω0²,
    and nutation has rates of g ω0 for the same angle. Momentum of wheels costs nothing, as
    unloading removes it. The state of A, S and Q includes the constant torque d, which has no
    weight. None where S of all other states does not become periodic.
    """
    gains = _gains(pickle.dumps((motion, weight, wheel_weight)))
    return None if gains is None else PeriodicGain(gains, motion.basis, motion.rate)


@latest(32)
def _gains(design: bytes) -> Float[np.ndarray, "turns phases u z"] | None:
    """`periodic_gain` of its pickled arguments: scenarios with other changes share their gains."""
    motion, weight, wheel_weight = pickle.loads(design)
    by_rods = motion.inverse @ motion.unmade / (weight / motion.stiffness**2)
    costs = np.repeat([1.0, motion.stiffness**-2, 0.0], [3, 3, motion.basis.shape[1]])
    wheels = motion.wheels / wheel_weight
    riccati = _periodic_riccati(
        _products(_transitions(_hamiltonian(phase, costs, by_rods, wheels)), AT_ONCE)
        for phase in motion.phases
    )
    if riccati is None:
        return None
    gains = [by_rods.T @ riccati[..., 3:6, :], wheels.T @ riccati]
    return np.concatenate(gains, axis=-2) * _units(motion)


def _hamiltonian(
    motion: LinearMotion,
    costs: Float[np.ndarray, " x"],
    by_rods: Float[np.ndarray, "3 3"],
    by_wheels: Float[np.ndarray, "x p"],
) -> Float[np.ndarray, "turns halves y y"]:
    """Matrices F of dy/dτ = F y for y = (x, d, λ), with λ = S (x, d) the costate of x.

    `costs` are the diagonal of Q for x; `by_rods` is J⁻¹ N / r, `by_wheels` C / s.
    """
    size, free = motion.state.shape[0], motion.free
    whole = np.zeros((*free.shape[:2], 2 * size + 3, 2 * size + 3))
    states, torque, costates = slice(size), slice(size, size + 3), slice(size + 3, None)
    whole[..., states, states], whole[..., costates, costates] = free, -np.swapaxes(free, -1, -2)
    whole[..., states, costates] = -by_wheels @ motion.wheels.T
    across = motion.across + FLOOR * np.eye(3)
    whole[..., 3:6, size + 6 : size + 9] -= by_rods @ across @ motion.unmade @ motion.inverse.T
    whole[..., costates, states] = -np.diag(costs)
    whole[..., 3:6, torque] = motion.inverse
    return whole


def _periodic_riccati(
    transitions: Iterable[Matrices],
) -> Float[np.ndarray, "turns phases x z"] | None:
    """S of (x, d), its rows for x, at each phase; None where they do not become periodic.

    `transitions` of (x, d, λ) are those of some steps each, phase by phase.
    """
    onwards = np.concatenate(list(transitions), axis=1)
    size = (onwards.shape[-1] - 3) // 2
    upper, lower = onwards[..., :size, :], onwards[..., size + 3 :, :]
    solution = np.broadcast_to(np.eye(size, size + 3), (TURNS, size, size + 3))
    for _ in range(MOST_ORBITS):
        before, rows = solution, []
        for place in reversed(range(onwards.shape[1])):
            later = solution[..., :size] @ upper[:, place] - lower[:, place]
            later[..., size : size + 3] += solution[..., size:]
            try:
                solution = np.linalg.solve(-later[..., size + 3 :], later[..., : size + 3])
            except np.linalg.LinAlgError:
                return None
            solution[..., :size] += np.swapaxes(solution[..., :size], 1, 2).copy()
            solution[..., :size] /= 2
            rows.append(solution)
        change, largest = np.abs(solution - before).max(), np.abs(solution).max()
        if not np.isfinite(largest):
            return None
        if change <= SETTLED * largest:
            return np.stack(rows[::-1], axis=1)[:, :: STEPS // AT_ONCE]
    return None


def _units(motion: LinearMotion) -> Float[np.ndarray, " z"]:
    """Units of a gain's columns: N m for rad, N m s, 1/s for momenta of wheels, and 1."""
    momentum = motion.moment * motion.rate
    units = [momentum * motion.rate, momentum, motion.rate, 1.0]
    return np.repeat(units, [3, 3, motion.basis.shape[1], 3])


def floquet_multipliers(motion: LinearMotion, gain: PeriodicGain) -> Complex[np.ndarray, "turns x"]:
    """Floquet multipliers of the linear closed loop over one orbit at each fixed Earth angle.

    Multipliers in decreasing size; errors decay if all sizes are below one.
    """
    return _multipliers(pickle.dumps((motion, np.asarray(gain.gains, float))))


@latest(32)
def _multipliers(closed_loop: bytes) -> Complex[np.ndarray, "turns x"]:
    """`floquet_multipliers` of a pickled motion and its gains: scenarios share them as gains."""
    motion, gains = pickle.loads(closed_loop)
    gains = (gains / _units(motion))[..., :-3]
    place = np.arange(motion.across.shape[1]) / (2 * STEPS)
    low = place.astype(int) % PHASES
    share = (place % 1)[:, None, None]
    gains = gains[:, low] * (1 - share) + gains[:, (low + 1) % PHASES] * share
    closed = motion.free - motion.rods @ gains[..., :3, :]
    closed -= motion.wheels @ gains[..., 3:, :]
    grown = _products(_transitions(closed), PHASES * STEPS)[:, 0]
    values = np.linalg.eigvals(grown).astype(complex)
    return np.take_along_axis(values, np.argsort(-np.abs(values), axis=1), axis=1)


def _transitions(matrices: Matrices) -> Matrices:
    """State transitions of dX/dτ = F X in successive steps: e^Ω, Ω by Magnus to the fourth order.

    For fast motion, such as nutation about the momentum of wheels, they preserve the size (Blanes,
    Casas, Oteo and Ros, Physics Reports 470, 2009). The series of e^Ω to the ninth order applies to
    a part of Ω with a norm below one half, and is squared.
    """
    begin, middle, end = matrices[:, :-2:2], matrices[:, 1:-1:2], matrices[:, 2::2]
    step = 2 * np.pi / (PHASES * STEPS)
    change = step / 6 * (begin + 4 * middle + end)
    change -= step**2 / 12 * (begin @ end - end @ begin)
    halvings = max(0, int(np.ceil(np.log2(2 * np.abs(change).sum(axis=-1).max()))))
    part, one = change / 2**halvings, np.eye(matrices.shape[-1])
    square = part @ part
    cube = square @ part
    first, second, third = (
        one / factorial(order) + part / factorial(order + 1) + square / factorial(order + 2)
        for order in (0, 3, 6)
    )
    grown = first + cube @ (second + cube @ (third + cube / factorial(9)))
    for _ in range(halvings):
        grown = grown @ grown
    return grown


def _products(matrices: Matrices, count: int) -> Matrices:
    """Products of `count` successive matrices each, the later on the left."""
    groups = matrices.reshape(matrices.shape[0], -1, count, *matrices.shape[-2:])
    product = groups[:, :, 0]
    for place in range(1, count):
        product = groups[:, :, place] @ product
    return product
