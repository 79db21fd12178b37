"""Random bodies and torque axes under the law of one torque.

    python benchmarks/one_torque_family.py --level hard

Prints the fraction at rest before 0.9 of the horizon, and the times within which that is reached.
"""

import argparse
import dataclasses
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxsat.core.inertia import torque_axis_frame
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import Run, build
from jaxsat.simulation.engine.single import simulate
from jaxsat.spacecraft.spacecraft import Spacecraft

LEVELS = {"nominal": (0.0, 0.0, 0.0, 0.0, 1.0), "hard": (0.1, 0.0175, 0.02, 3e-5, 2.0)}
"""Errors of inertia and torque, of the axis (rad), products, noise (rad/s), largest disturbance."""

MASS, LIMIT, HORIZON = 450.0, 5.625, 1500.0


def random_body(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """Moments and torque axis that the law is verified for."""
    while True:
        moments = rng.uniform(0.3, 1, 3)
        axis = rng.normal(size=3)
        axis = axis / np.linalg.norm(axis)
        _, mobility = torque_axis_frame(np.diag(moments), axis)
        real = 2 * moments.max() < 0.95 * moments.sum()
        if real and mobility[0, 2] >= 0.1 * mobility[0, 0]:
            return MASS * moments, axis


def dispersed(rng: np.random.Generator, level: str) -> Run:
    """A run whose plant is not what its law believes."""
    error, lean, product, noise, disturbance = LEVELS[level]
    moments, axis = random_body(rng)
    run = build(
        load(
            "one-torque-damping",
            [
                f"spacecraft.inertia_kg_m2={moments.tolist()}",
                f"spacecraft.thruster_torque_axes=[{axis.tolist()}]",
                "spacecraft.failed_thrusters=[]",
                f"spacecraft.torque_limit_N_m={LIMIT}",
                f"initial.omega_rad_s={rng.uniform(-0.1, 0.1, 3).tolist()}",
                f"sampling.rate_noise_rad_s={noise}",
                f"simulation.duration_s={HORIZON}",
            ],
        )
    )
    inertia = np.diag(moments * (1 + error * rng.uniform(-1, 1, 3)))
    for row, column in ((0, 1), (0, 2), (1, 2)):
        inertia[row, column] = inertia[column, row] = product * moments.min() * rng.uniform(-1, 1)
    loop = cast(Any, run.loop)
    periodic = loop.plant.disturbance
    periodic = dataclasses.replace(
        periodic,
        amplitude=periodic.amplitude * rng.uniform(0, disturbance, 3),
        phase=jnp.asarray(rng.uniform(0, 2 * np.pi, 3)),
    )
    leans, gains = rng.uniform(-lean, lean, (1, 2)), rng.uniform(-error, error, 1)
    actuators = loop.plant.effectors[0].misaligned(jnp.asarray(leans)).stronger(jnp.asarray(gains))
    plant = dataclasses.replace(
        loop.plant, spacecraft=Spacecraft(inertia), disturbance=periodic, effectors=(actuators,)
    )
    return dataclasses.replace(run, loop=dataclasses.replace(loop, plant=plant))


def main() -> None:
    """Fly them all at once."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--cases", type=int, default=256)
    parser.add_argument("--level", choices=list(LEVELS), default="hard")
    given = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    rng = np.random.default_rng(7)
    runs = [dispersed(rng, given.level) for _ in range(given.cases)]
    first = runs[0]
    parts = [eqx.partition((run.loop, run.start), eqx.is_array) for run in runs]
    stacked = jax.tree.map(lambda *leaves: jnp.stack(leaves), *[part[0] for part in parts])

    def at_rest(arrays):
        loop, start = eqx.combine(arrays, parts[0][1])
        period = cast(Any, first.loop).controller.period  # known, as the number of samples is
        loop = eqx.tree_at(lambda loop: loop.controller.period, loop, period)
        run = simulate(loop, start, first.times, method=first.method)
        return run.assessment.at_rest_from, jnp.max(jnp.abs(run.signals.omega))

    times, largest = jax.jit(jax.vmap(at_rest))(stacked)
    times = np.sort(np.asarray(times))
    shown = ", ".join(
        f"{part} %: {times[min(int(part / 100 * len(times)), len(times) - 1)]:.0f} s"
        for part in (50, 90, 95)
    )
    print(
        f"at rest {np.isfinite(times).mean():.1%}; {shown}; |omega_i| to {largest.max():.2f} rad/s"
    )


if __name__ == "__main__":
    main()
