"""The energy claim (17)-(18) put to the test.

(18) says that the energy under T_d stays within C + Σ a_i. That adds a torque to an energy. What
follows from the equations is d/dt ½ωᵀJω = ω·T_d, and a plain spin goes beyond the claim within
half a period of the torque.
"""

from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.spacecraft.environment import PeriodicTorque


def energy_history(
    inertia: Float[Array, "3 3"],
    omega: Float[Array, "3"],
    torque: PeriodicTorque,
    step: float | int | Array,
    count: int,
) -> Float[Array, " n"]:
    """Rotational energy ½ωᵀJω (J) after 0, 1, … steps (s) of the disturbed free body."""
    inverse = jnp.linalg.inv(inertia)

    def rate(time, w):
        return inverse @ (torque.at(time) - jnp.cross(w, inertia @ w))

    def advance(w, k):
        time = k * step
        k1 = rate(time, w)
        k2 = rate(time + 0.5 * step, w + 0.5 * step * k1)
        k3 = rate(time + 0.5 * step, w + 0.5 * step * k2)
        k4 = rate(time + step, w + step * k3)
        new = w + step / 6.0 * (k1 + 2.0 * k2 + 2.0 * k3 + k4)
        return new, 0.5 * new @ inertia @ new

    _, energies = jax.lax.scan(advance, omega, jnp.arange(count, dtype=omega.dtype))
    return jnp.concatenate([0.5 * (omega @ inertia @ omega)[None], energies])


def energy_bound(
    inertia: Float[Array, "3 3"],
    energy: float | int | Array,
    amplitude: Float[Array, "3"],
    times: Float[Array, " n"],
) -> Float[Array, " n"]:
    """The bound (J) that does follow: d/dt ½ωᵀJω = ω·T_d.

    |ω·T_d| ≤ √(2E/J_min)|a|, hence √E(t) ≤ √E(0) + |a| t/√(2 J_min): growth is possible, and no
    constant such as C + Σa_i (18) follows from the equations.
    """
    least = jnp.linalg.eigvalsh(inertia)[0]
    push = jnp.linalg.norm(amplitude) / jnp.sqrt(2.0 * least)
    return (jnp.sqrt(jnp.asarray(energy, times.dtype)) + push * times) ** 2


@dataclass(frozen=True, eq=False)
class EnergyCounterexample:
    """A disturbed free motion and how far its energy exceeds the claim (18).

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
    inertia: Float[Array, "3 3"],
    amplitude: Float[Array, "3"],
    frequency: Float[Array, "3"],
    *,
    spin: float | None = None,
    count: int = 2000,
) -> EnergyCounterexample:
    """A spin whose energy passes (18) within half a period of T_d as printed, without phases.

    `inertia` in kg m², `amplitude` in N m, `frequency` in rad/s. A body that spins with ω about an
    axis with the torque a sin Ωt does not notice that torque at first, which does the work
    ∫ω a sin Ωt dt = 2 ω a/Ω in the time π/Ω, where (18) allows Σ a_i. The axis is that of the
    largest a/Ω, `spin` (rad/s) is 1, or what makes that work 1.5 Σ a_i if that is quicker. The
    motion is integrated in `count` steps. Raises ValueError where no torque oscillates.
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
    claimed = float(energies[0] + size.sum())
    return EnergyCounterexample(
        excess=float(energies.max() - claimed),
        gain=float(energies.max() - energies[0]),
        claimed=claimed,
        omega=omega,
        times=step * np.arange(count + 1),
        energies=energies,
    )
