"""Linear motion of a body with magnetorquers and wheels about rest in the orbit frame.

The authority of magnetorquers depends on the Earth's field, which is periodic in orbit phase and
Earth rotation.
"""

from collections.abc import Iterator
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from jaxsat.spacecraft.environment.orbit import AbstractMagneticField
from jaxsat.spacecraft.magnetorquers import NEAREST

TURNS, PHASES = 8, 32
"""Numbers of the Earth's angles and of orbit phases for which gains are stored."""

STEPS = 16
"""Integration steps from one phase to the next."""

ANY_DIPOLE = np.eye(3)
"""P of magnetorquers along three independent axes."""

NO_DIPOLE = np.zeros((3, 3))
"""Q of them."""


class LinearMotion(NamedTuple):
    """dx/dτ = `free` x + `rods` u + `wheels` c about rest in the orbit frame, τ = ω0 t.

    x = (θ, ω_r / ω0, η): θ (rad) is the small turn from the orbit frame, ω_r the relative rate, and
    η the momentum of wheels beyond their bias along the columns of E, the orthonormal `basis` of
    wheel torques. Torques are in units of J0 ω0², momenta of J0 ω0, J0 = `moment` (kg m²) the
    geometric mean of the principal moments; `inverse` is J0 J⁻¹. c are the torques of wheels along
    E. Rods make M (u - k E η), with N u = u, N = 1 - E Eᵀ, and `unloading` k over ω0. M x is P D
    (b × x) × b with b = B / |B| and D of `linear_motion`: if rods span all axes, M is 1 - b bᵀ.
    Wheels absorb the part along E, so that

        J dω/dt + ω × (J ω + h + E η) = N M (u - k E η) + E c,
        dη/dt = Eᵀ M (u - k E η) - c.

    h is the momentum of wheels at their bias and `stiffness` 1 + |h| / (J0 ω0). `state` is the
    constant part, and `across` M at n equal steps of an orbit and in their middles, for each angle
    of the Earth.
    """

    moment: float
    rate: float
    inverse: Float[np.ndarray, "3 3"]
    basis: Float[np.ndarray, "3 p"]
    unloading: float
    stiffness: float
    state: Float[np.ndarray, "x x"]
    across: Float[np.ndarray, "turns halves 3 3"]

    @property
    def phases(self) -> "Iterator[LinearMotion]":
        """The motion from each phase to the next."""
        for begin in range(0, self.across.shape[1] - 1, 2 * STEPS):
            yield self._replace(across=self.across[:, begin : begin + 2 * STEPS + 1])

    @property
    def unmade(self) -> Float[np.ndarray, "3 3"]:
        """N, the projection on torques that wheels cannot produce."""
        return np.eye(3) - self.basis @ self.basis.T

    @property
    def _made(self) -> Float[np.ndarray, "turns halves x 3"]:
        """Effect of a magnetic torque on dx/dτ."""
        parts = [np.zeros((3, 3)), self.inverse @ self.unmade, self.basis.T]
        return np.concatenate(parts) @ self.across

    @property
    def rods(self) -> Float[np.ndarray, "turns halves x 3"]:
        """Effect of the rods' torque u on dx/dτ."""
        return self._made @ self.unmade

    @property
    def wheels(self) -> Float[np.ndarray, "x p"]:
        """Effect of the wheels' torques c on dx/dτ."""
        count = self.basis.shape[1]
        return np.concatenate([np.zeros((3, count)), self.inverse @ self.basis, -np.eye(count)])

    @property
    def free(self) -> Float[np.ndarray, "turns halves x x"]:
        """Effect of errors and unloading on dx/dτ."""
        free = np.broadcast_to(self.state, (*self.across.shape[:2], *self.state.shape)).copy()
        free[..., 6:] -= self.unloading * self._made @ self.basis
        return free


def linear_motion(
    inertia: Float[np.ndarray, "3 3"],
    field: AbstractMagneticField,
    unmade: Float[np.ndarray, "3 3"],
    momentum: Float[np.ndarray, "3"],
    *,
    dipoles: Float[np.ndarray, "3 3"] = ANY_DIPOLE,
    missing: Float[np.ndarray, "3 3"] = NO_DIPOLE,
    unloading: float = 0.0,
    gravity_gradient: bool,
) -> LinearMotion:
    """The motion of a body (kg m²) in a field, with N = `unmade`, the projection on magnetic
    torques.

    N is orthogonal. The `momentum` h (N m s), in body axes, is that of wheels at their bias,
    `unloading` k in 1/s; `dipoles` is P, of rods that work, and `missing` Q projects on what the
    axes of all that are commanded do not span. Of a dipole m they make D m = m - b (Qb·m) /
    (|Qb|² + `NEAREST`²), as `MagneticSteering.turned`. Gravity gradient adds 3 ω0² n × Jn.
    """
    rate = float(field.circle.rate)
    moment = reference_moment(inertia)
    scaled, stored = inertia / moment, momentum / (moment * rate)
    vectors, values, _ = np.linalg.svd(np.eye(3) - unmade)
    basis = vectors[:, values > 0.5]
    state = small_motion(scaled, basis, stored, gravity_gradient=gravity_gradient)
    instants = np.arange(2 * PHASES * STEPS + 1) * np.pi / (PHASES * STEPS * rate)
    turns = np.arange(TURNS) * 2 * np.pi / TURNS
    there = field.sampled(instants, turns[:, None])
    units = there / np.linalg.norm(there, axis=-1, keepdims=True)
    turning = np.cross(units[..., None, :], np.eye(3))  # b × x is x @ turning
    beyond = units @ missing
    square = np.sum(beyond**2, axis=-1) + NEAREST**2
    turned = np.eye(3) - units[..., :, None] * (beyond / square[..., None])[..., None, :]
    across = turning @ dipoles @ turned @ np.swapaxes(turning, -1, -2)
    stiffness = 1 + float(np.linalg.norm(stored))
    inverse = np.linalg.inv(scaled)
    return LinearMotion(moment, rate, inverse, basis, unloading / rate, stiffness, state, across)


def reference_moment(inertia: Float[np.ndarray, "3 3"]) -> float:
    """The cube root of det J, kg m², which scales by powers of two without rounding."""
    size = np.abs(inertia).max()
    return float(size * np.cbrt(np.linalg.det(inertia / size)))


def small_motion(
    inertia: Float[np.ndarray, "3 3"],
    basis: Float[np.ndarray, "3 p"],
    momentum: Float[np.ndarray, "3"],
    *,
    gravity_gradient: bool,
) -> Float[np.ndarray, "x x"]:
    """Effect of small errors x = (θ, ω_r / ω0, η) on dx/dτ in the orbit frame, see `LinearMotion`.

    `inertia` J / J0 of the body, `basis` E of wheels, `momentum` h / (J0 ω0) at their bias.
    """
    frame, nadir = np.array([0.0, -1.0, 0.0]), np.array([0.0, 0.0, 1.0])
    inverse, turning = np.linalg.inv(inertia), _cross(frame)
    spin = inverse @ (_cross(inertia @ frame + momentum) - turning @ inertia)  # by a change of ω
    state = np.zeros((6 + basis.shape[1], 6 + basis.shape[1]))
    state[:3, 3:6] = np.eye(3)
    state[3:6, 3:6] = spin - turning
    state[3:6, :3] = spin @ turning
    state[3:6, 6:] = -inverse @ turning @ basis
    if gravity_gradient:
        pull = _cross(nadir) @ inertia - _cross(inertia @ nadir)
        state[3:6, :3] += 3 * inverse @ pull @ _cross(nadir)
    return state


def _cross(vector: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3 3"]:
    return np.cross(vector, np.eye(3)).T
