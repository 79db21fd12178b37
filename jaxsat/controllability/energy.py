"""The energy claim (17)-(18) put to the test.

(18) says that the energy under T_d stays within C + Σ a_i. That adds a torque to an energy. What
follows from the equations is d/dt ½ωᵀJω = ω·T_d, and a search over phases finds motions beyond
the claim.
"""

from dataclasses import dataclass

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.environment import PeriodicTorque


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

    `excess` = max E − (E(0) + Σ a_i) in J, positive for a counterexample; `history` the best after
    each ascent step; `phases` (rad) and `omega` (rad/s) of the motion; `energies` (J) at `times`.
    """

    excess: float
    claimed: float
    phases: Float[np.ndarray, "3"]
    omega: Float[np.ndarray, "3"]
    history: Float[np.ndarray, " k"]
    times: Float[np.ndarray, " n"]
    energies: Float[np.ndarray, " n"]


@eqx.filter_jit
def _climb(inertia, omega, amplitude, frequency, step, count, starts, iterations):
    """Gradient ascent from many phases at once; the best phase and excess of each."""

    def excess(phase):
        torque = PeriodicTorque(amplitude, frequency, phase)
        energies = energy_history(inertia, omega, torque, step, count)
        return jnp.max(energies) - energies[0] - jnp.sum(jnp.abs(amplitude))

    def advance(carry, k):
        phase, best_phase, best = carry
        value = excess(phase)
        slope = jax.jacfwd(excess)(phase)
        better = value > best
        best_phase = jnp.where(better, phase, best_phase)
        best = jnp.maximum(value, best)
        # Phases are angles: steps of half a radian that shrink as 1/k.
        size = jnp.linalg.norm(slope)
        stride = 0.5 / (1.0 + k / 5.0)
        phase = phase + stride * slope / jnp.where(size > 0, size, 1.0)
        return (phase, best_phase, best), best

    def run(phase):
        first = (phase, phase, jnp.asarray(-jnp.inf, phase.dtype))
        last, history = jax.lax.scan(advance, first, jnp.arange(iterations, dtype=phase.dtype))
        return last[1], history

    return jax.vmap(run)(starts)


def energy_counterexample(
    inertia: Float[Array, "3 3"],
    omega: Float[Array, "3"],
    amplitude: Float[Array, "3"],
    frequency: Float[Array, "3"],
    *,
    step: float | int = 0.1,
    count: int = 2000,
    starts: int = 8,
    iterations: int = 40,
    seed: int = 0,
) -> EnergyCounterexample:
    """Search the phases of T_d for an energy beyond (18), by gradient ascent from many starts.

    `inertia` in kg m², `omega` (rad/s) the initial rate, `amplitude` in N m, `frequency` in rad/s;
    the motion runs over `count` steps of `step` s. A negative `excess` proves nothing; a positive
    one refutes (18) for that body, rate and disturbance.
    """
    phases = np.random.default_rng(seed).uniform(-np.pi, np.pi, size=(starts, 3))
    found, history = _climb(
        inertia, omega, amplitude, frequency, step, count, jnp.asarray(phases), iterations
    )
    winner = int(jnp.argmax(history[:, -1]))
    torque = PeriodicTorque(amplitude, frequency, found[winner])
    energies = np.asarray(energy_history(inertia, omega, torque, step, count))
    return EnergyCounterexample(
        excess=float(history[winner, -1]),
        claimed=float(energies[0] + np.sum(np.abs(np.asarray(amplitude)))),
        phases=np.asarray(found[winner]),
        omega=np.asarray(omega),
        history=np.asarray(history[winner]),
        times=step * np.arange(count + 1),
        energies=energies,
    )
