"""Simulated drift: its divergence (16), its returns, and the energy claim (17)-(18).

Without disturbance energy is constant, the energy surface is compact and the flow keeps volume, so
almost every state recurs (Poincaré): the drift is weakly positively Poisson stable. With T_d the
volume is still kept, but nothing bounds the region, and the theorem is silent.

(18) claims that the energy under T_d stays within C + Σ a_i, the sum of an energy and torques. The
equations imply d/dt ½ωᵀJω = ω·T_d instead, and a plain spin exceeds the claim within half a period
of the torque.
"""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.controllability.lie import DriftField, VectorField, pack
from jaxsat.core.array_types import Matrix, RealScalar, Vector
from jaxsat.spacecraft.environment.disturbances import PeriodicTorque


def divergence(field: VectorField, state: Float[Array, " n"]) -> RealScalar:
    """Compute the divergence (1/s) of a field on SO(3) × R³ for the invariant volume, as in (16).

    The trace of the derivative of the tangent coordinates along body rotations and rates; body
    rotations keep the invariant volume, so this trace is the divergence.
    """

    def coordinates(step: Float[Array, "6"]) -> Float[Array, "6"]:
        x, y, z = step[:3]
        zero = jnp.zeros_like(x)
        turn = jnp.stack(
            [jnp.stack([zero, -z, y]), jnp.stack([z, zero, -x]), jnp.stack([-y, x, zero])]
        )
        # exp(−turn) to first order: enough for one derivative at zero.
        attitude = state[:9].reshape(3, 3) - turn @ state[:9].reshape(3, 3)
        neighbour = jnp.concatenate([attitude.reshape(9), state[9:12] + step[3:], state[12:]])
        velocity = field(neighbour)
        rate = velocity[:9].reshape(3, 3)
        # Coordinates at the moved point, whose attitude is orthogonal to first order only.
        inverse = state[:9].reshape(3, 3).T + state[:9].reshape(3, 3).T @ turn
        spin = -rate @ inverse
        a = jnp.stack([spin[2, 1], spin[0, 2], spin[1, 0]])
        return jnp.concatenate([a, velocity[9:12]])

    return jnp.trace(jax.jacfwd(coordinates)(jnp.zeros(6, state.dtype)))


class DriftTrajectory(eqx.Module):
    """States (n, 12 or 13) of a drift at times (n,) in s."""

    times: Float[Array, " n"]
    states: Float[Array, "n d"]


@eqx.filter_jit
def drift_trajectory(
    field: VectorField, state: Float[Array, " d"], step: float | int | Array, count: int
) -> DriftTrajectory:
    """Take `count` steps of the classical fourth-order Runge-Kutta method from a flat state.

    `step` in s. The attitude matrix is integrated without orthogonalisation; `recurrence` reports
    its final deviation.
    """
    step = jnp.asarray(step, state.dtype)

    def advance(x, _):
        k1 = field(x)
        k2 = field(x + 0.5 * step * k1)
        k3 = field(x + 0.5 * step * k2)
        k4 = field(x + step * k3)
        new = x + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        return new, new

    _, states = jax.lax.scan(advance, state, None, length=count)
    states = jnp.concatenate([state[None], states])
    return DriftTrajectory(step * jnp.arange(count + 1, dtype=state.dtype), states)


@dataclass(frozen=True, eq=False)
class Recurrence:
    """Distances from the start, and the times of returns.

    `distances` (n,): the rotation angle (rad) and the rate error divided by the initial rate, as a
    Euclidean norm. `returns`: times (s) of entering the neighbourhood `radius` again after having
    left it to twice the radius. `drift`: largest deviation of attitude matrices from orthogonality.
    """

    times: Float[np.ndarray, " n"]
    distances: Float[np.ndarray, " n"]
    radius: float
    returns: Float[np.ndarray, " r"]
    drift: float


def recurrence(
    field: VectorField,
    state: Float[Array, " d"],
    *,
    radius: float | int = 0.1,
    step: float | int,
    count: int,
) -> Recurrence:
    """Follow a drift from a state and search for its returns (Poisson stability).

    A simulation shows returns; that almost all states return is Poincaré's theorem, for T_d = 0.
    `radius` dimensionless, `step` in s. Raises ValueError for a start at rest, which never leaves.
    """
    speed = float(np.linalg.norm(np.asarray(state[9:12])))
    if speed == 0.0:
        raise ValueError("Argument `state` must have a body rate other than zero, but got zero")
    path = drift_trajectory(field, state, step, count)
    states = np.asarray(path.states)
    attitudes = states[:, :9].reshape(-1, 3, 3)
    start = np.asarray(state)
    # |R − R0| = 2√2 sin(angle/2) keeps small angles accurate.
    chord = np.linalg.norm(attitudes - start[:9].reshape(3, 3), axis=(1, 2))
    angles = 2.0 * np.arcsin(np.minimum(chord / np.sqrt(8.0), 1.0))
    rates = np.linalg.norm(states[:, 9:12] - start[9:12], axis=1) / speed
    distances = np.hypot(angles, rates)
    returns, away = [], False
    for time, distance in zip(np.asarray(path.times), distances, strict=True):
        if away and distance < radius:
            returns.append(float(time))
            away = False
        away = away or distance > 2.0 * radius
    some = attitudes[:: max(1, count // 100)]
    products = np.einsum("nij,nkj->nik", some, some)
    return Recurrence(
        times=np.asarray(path.times),
        distances=distances,
        radius=radius,
        returns=np.array(returns),
        drift=float(np.max(np.abs(products - np.eye(3)))),
    )


def energy_history(
    inertia: Matrix, omega: Vector, torque: PeriodicTorque, step: float | int | Array, count: int
) -> Float[Array, " n"]:
    """Return the energy ½ωᵀJω (J) after 0, 1, … steps (s) of the disturbed free body."""
    start = pack(jnp.eye(3), omega, 0.0)
    path = drift_trajectory(DriftField(inertia, disturbance=torque.at), start, step, count)
    rates = path.states[:, 9:12]
    return 0.5 * jnp.sum((rates @ inertia) * rates, axis=1)


def energy_bound(
    inertia: Matrix, energy: float | int | Array, amplitude: Vector, times: Float[Array, " n"]
) -> Float[Array, " n"]:
    """Return the bound (J) that follows from d/dt ½ωᵀJω = ω·T_d.

    |ω·T_d| ≤ √(2E/J_min)|a|, hence √E(t) ≤ √E(0) + |a| t/√(2 J_min): growth is possible, and no
    constant such as C + Σa_i (18) follows from the equations.
    """
    least = jnp.linalg.eigvalsh(inertia)[0]
    push = jnp.linalg.norm(amplitude) / jnp.sqrt(2.0 * least)
    return (jnp.sqrt(jnp.asarray(energy, times.dtype)) + push * times) ** 2


@dataclass(frozen=True, eq=False)
class EnergyCounterexample:
    """A disturbed free motion and the excess of its energy over the claim (18).

    `excess` = max E − (E(0) + Σ a_i) in J, positive for a counterexample; `gain` = max E − E(0);
    `claimed` = E(0) + Σ a_i; `omega` (rad/s) the initial rate; `energies` (J) at `times` (s).
    """

    excess: float
    gain: float
    claimed: float
    omega: Float[np.ndarray, "3"]
    times: Float[np.ndarray, " n"]
    energies: Float[np.ndarray, " n"]


def energy_counterexample(
    inertia: Matrix,
    amplitude: Vector,
    frequency: Vector,
    *,
    spin: float | None = None,
    count: int = 2000,
) -> EnergyCounterexample:
    """Return a spin whose energy exceeds (18) within half a period of T_d without phases.

    `inertia` in kg m², `amplitude` in N m, `frequency` in rad/s. The torque a sin Ωt about the spin
    axis hardly changes a fast spin ω at first, and does the work ∫ω a sin Ωt dt = 2 ω a/Ω in the
    time π/Ω, where (18) allows Σ a_i. The axis is that of the largest a/Ω; `spin` (rad/s) is by
    default 1, or the rate with the work 1.5 Σ a_i if that is faster. The motion is integrated in
    `count` steps. Raises ValueError where no torque oscillates.
    """
    size, rate = np.abs(np.asarray(amplitude)), np.abs(np.asarray(frequency))
    works = np.where(rate > 0, size / np.where(rate > 0, rate, 1.0), 0.0)
    axis = int(np.argmax(works))
    if works[axis] == 0:
        raise ValueError(
            "Arguments `amplitude` and `frequency` must be of a torque that oscillates, but got "
            f"{size.tolist()} N m at {rate.tolist()} rad/s."
        )
    spin = max(1.0, float(0.75 * size.sum() / works[axis])) if spin is None else spin
    sign = np.sign(np.asarray(amplitude)[axis] * np.asarray(frequency)[axis])
    omega = spin * sign * np.eye(3)[axis]
    step = np.pi / rate[axis] / count
    torque = PeriodicTorque(amplitude, frequency, jnp.zeros(3))
    energies = np.asarray(energy_history(inertia, jnp.asarray(omega), torque, step, count))
    claim = float(energies[0] + size.sum())
    return EnergyCounterexample(
        excess=float(energies.max() - claim),
        gain=float(energies.max() - energies[0]),
        claimed=claim,
        omega=omega,
        times=step * np.arange(count + 1),
        energies=energies,
    )
