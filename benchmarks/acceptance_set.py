"""How surely and how fast the settling laws settle, on one set of starts and dispersions.

    python benchmarks/acceptance_set.py --law three-slew --limit 5 --level mc --cases 200 --seed 7

Case i draws everything from fold_in(key(seed), i); case 0 starts as the paper does, all others at
random. A case has settled when |w| < 0.05, |z| < 0.05 rad and |ω - C (0, -ω0, 0)| < 1e-3 rad/s
hold from some time before 0.9 of the horizon to its end.
"""

import argparse
import json
import time
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxsat.attitude import WZ, Quaternion
from jaxsat.control import RippleObserver, oscillatory_settling, three_slew_settling
from jaxsat.dynamics import PlantState, RigidBody
from jaxsat.environment import ExactOrbit, PeriodicTorque
from jaxsat.metrics import Tolerances, wrapped
from jaxsat.vehicle import Spacecraft

INERTIA = (449.5, 264.6, 312.5)
ORBIT_RATE = 0.0011
AMPLITUDE, FREQUENCY = (0.01, 0.02, 0.001), (0.7, 0.8, 0.1)
HORIZON = {1: 2000.0, 5: 1200.0, 20: 1000.0}
PERIOD = 0.1


LAWS = {"oscillatory": oscillatory_settling, "three-slew": three_slew_settling}


class Level(NamedTuple):
    """Half-widths of uniform dispersions; noise as standard deviations of one sample."""

    moments: float
    misalignment: float  # degrees
    products: float  # of the smallest moment
    amplitude: float
    frequency: float
    rate_noise: float
    angle_noise: float


LEVELS = {
    "nominal": Level(0, 0, 0, 0, 0, 0, 0),
    "mc": Level(0.05, 0.2, 0.005, 0.5, 0, 1e-5, 5e-5),
    "hard": Level(0.10, 1.0, 0.02, 1.0, 0.2, 3e-5, 1e-4),
}


class Case(eqx.Module):
    plant: RigidBody
    torque_axes: jax.Array
    start: PlantState
    noise_key: jax.Array


def draw(seed, index, level: Level) -> Case:
    keys = jax.random.split(jax.random.fold_in(jax.random.key(seed), index), 10)

    def uniform(key, shape, half):
        return half * jax.random.uniform(key, shape, minval=-1.0, maxval=1.0)

    moments = jnp.array(INERTIA) * (1 + uniform(keys[0], (3,), level.moments))
    j12, j13, j23 = uniform(keys[1], (3,), level.products * min(INERTIA))
    inertia = jnp.diag(moments) + jnp.array([[0, j12, j13], [j12, 0, j23], [j13, j23, 0]])
    gain = 1 + uniform(keys[2], (2,), level.moments)
    lean = uniform(keys[3], (4,), np.deg2rad(level.misalignment))
    axes = jnp.array([[1, lean[0]], [lean[1], 1], [lean[2], lean[3]]]) * gain[None, :]
    amplitude = jnp.array(AMPLITUDE) * (1 + uniform(keys[4], (3,), level.amplitude))
    frequency = jnp.array(FREQUENCY) * (1 + uniform(keys[5], (3,), level.frequency))
    random_phase = uniform(keys[6], (3,), np.pi)
    phase = jnp.where(level.moments > 0, random_phase, 0.0)
    torque = PeriodicTorque(amplitude, frequency, phase)
    plant = RigidBody(Spacecraft(inertia), ExactOrbit(ORBIT_RATE), torque)
    q = jax.random.normal(keys[7], (4,))
    omega = uniform(keys[8], (3,), 0.1)
    paper = WZ([-1.0, 1.0], 1.27).as_quaternion().q
    q = jnp.where(index == 0, paper, q / jnp.linalg.norm(q))
    omega = jnp.where(index == 0, jnp.array([0.1, -0.11, 0.0]), omega)
    return Case(plant, axes, PlantState(Quaternion(q), omega), keys[9])


def measured(state, key, number, level: Level) -> PlantState:
    if level.rate_noise == 0:
        return state
    noise = jax.random.normal(jax.random.fold_in(key, number), (6,))
    turn = Quaternion(state.attitude.q).rate(level.angle_noise * noise[:3]).q
    attitude = Quaternion(state.attitude.q + turn).normalised()
    return PlantState(attitude, state.omega + level.rate_noise * noise[3:])


def advanced(plant, t, state, torque):
    """One classical Runge-Kutta step of a period."""

    def moved(rate, h):
        return jax.tree.map(lambda x, dx: x + h * dx, state, rate)

    h = PERIOD
    k1 = plant.rate(t, state, torque)
    k2 = plant.rate(t + h / 2, moved(k1, h / 2), torque)
    k3 = plant.rate(t + h / 2, moved(k2, h / 2), torque)
    k4 = plant.rate(t + h, moved(k3, h), torque)
    mean = jax.tree.map(lambda a, b, c, d: (a + 2 * b + 2 * c + d) / 6, k1, k2, k3, k4)
    following = moved(mean, h)
    return PlantState(following.attitude.normalised(), following.omega)


class Outcome(NamedTuple):
    settling_time: jax.Array
    effort: jax.Array
    peak_rate: jax.Array
    peak_torque: jax.Array
    mode: jax.Array
    entered: jax.Array  # first time of each mode from 2 to 4


def fly(law, case: Case, level: Level, limit: float, samples: int) -> Outcome:
    tolerances = Tolerances()

    def one(carry, number):
        state, memory, out = carry
        t = number * PERIOD
        wz = state.attitude.as_wz()
        rate = case.plant.relative_rate(state)
        good = (
            (jnp.linalg.norm(wz.w) < tolerances.w)
            & (jnp.abs(wrapped(wz.z)) < tolerances.z)
            & (jnp.linalg.norm(rate) < tolerances.relative_rate)
        )
        seen = measured(state, case.noise_key, number, level)
        command, memory = law.step(t, seen, memory)
        thrust = jnp.clip(command, -limit, limit)
        torque = jnp.sum(case.torque_axes * thrust[None, :], axis=1)
        mode = law.mode(memory)
        first = jnp.isinf(out.entered) & (mode == jnp.arange(2, 5))
        out = Outcome(
            jnp.where(good, out.settling_time, t + PERIOD),
            out.effort + PERIOD * jnp.sum(jnp.abs(torque)),
            jnp.maximum(out.peak_rate, jnp.linalg.norm(state.omega)),
            jnp.maximum(out.peak_torque, jnp.max(jnp.abs(command))),
            mode,
            jnp.where(first, t, out.entered),
        )
        return (advanced(case.plant, t, state, torque), memory, out), None

    zero = jnp.zeros(())
    first = Outcome(zero, zero, zero, zero, jnp.array(0), jnp.full(3, jnp.inf))
    begin = (case.start, law.init(case.start), first)
    (_, _, out), _ = jax.lax.scan(one, begin, jnp.arange(samples + 1))
    horizon = samples * PERIOD
    settled = out.settling_time <= 0.9 * horizon
    return out._replace(settling_time=jnp.where(settled, out.settling_time, jnp.inf))


@eqx.filter_jit
def fly_all(law, seed, indices, level: Level, limit: float, samples: int) -> Outcome:
    def one(index):
        return fly(law, draw(seed, index, level), level, limit, samples)

    return jax.vmap(one)(indices)


def evaluate(law, seed, cases, level_name, limit, horizon=None) -> Outcome:
    samples = round((horizon or HORIZON[limit]) / PERIOD)
    # A plain tuple of floats is static to the compiler: the same program for every case.
    return fly_all(law, seed, jnp.arange(cases), LEVELS[level_name], float(limit), samples)


def interval(successes: int, n: int, z: float = 1.96) -> tuple[float, float]:
    """Wilson's interval of a fraction."""
    p, centre = successes / n, (successes + z**2 / 2) / (n + z**2)
    half = z / (n + z**2) * np.sqrt(n * p * (1 - p) + z**2 / 4)
    return max(0.0, centre - half), min(1.0, centre + half)


def summary(out: Outcome) -> dict:
    times = np.asarray(out.settling_time)
    settled = int(np.isfinite(times).sum())
    low, high = interval(settled, len(times))
    return {
        "cases": len(times),
        "settled": settled / len(times),
        "interval": [round(float(low), 4), round(float(high), 4)],
        "t50": float(np.quantile(times, 0.5, method="inverted_cdf")),
        "t90": float(np.quantile(times, 0.9, method="inverted_cdf")),
        "effort": float(np.median(out.effort)),
        "peak_rate": float(np.max(out.peak_rate)),
    }


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--law", choices=[*LAWS, "all"], default="all")
    parser.add_argument("--limit", type=int, choices=sorted(HORIZON), action="append")
    parser.add_argument("--level", choices=list(LEVELS), action="append")
    parser.add_argument("--cases", type=int, default=200)
    parser.add_argument("--seed", type=int, required=True)
    parser.add_argument("--ripple", choices=["filter", "observer", "none"], default="filter")
    parser.add_argument("--no-estimate", action="store_true")
    parser.add_argument("--out", type=Path)
    args = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    model = RigidBody(Spacecraft(list(INERTIA)), ExactOrbit(ORBIT_RATE))
    rows = []
    for limit in args.limit or sorted(HORIZON):
        for name in LAWS if args.law == "all" else [args.law]:
            law = LAWS[name](
                model,
                limit,
                observe=args.ripple != "none",
                estimate=not args.no_estimate,
                ripple=RippleObserver() if args.ripple == "observer" else None,
            )
            for level in args.level or list(LEVELS):
                begin = time.perf_counter()
                out = evaluate(law, args.seed, args.cases, level, limit)
                row = {"limit": limit, "law": name, "level": level, **summary(out)}
                row["seconds"] = round(time.perf_counter() - begin, 1)
                rows.append(row)
                print(json.dumps(row), flush=True)
    if args.out:
        args.out.write_text(json.dumps({"seed": args.seed, "rows": rows}, indent=1))


if __name__ == "__main__":
    main()
