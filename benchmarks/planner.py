"""Plans of least time for random starts in one batch: how long it takes, and how good they are.

    python benchmarks/planner.py --starts 1000 --bound 30

Uniform attitudes and rates up to 0.1 rad/s, the paper's spacecraft with its orbit and disturbance.
The native engine compiles the batch; every processor plans a part of it. DOP853 flies every plan
again. With `--bound` some are compared with the best of 12 starts of IPOPT, which needs CasADi.
"""

import argparse
import dataclasses
import json
import time
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np

from jaxsat.compiler import Mapped
from jaxsat.control.planning.planner import Plan, Planner, PlanStatus
from jaxsat.core.attitude import Quaternion
from jaxsat.core.process import processors
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.synthesis.comparison.front import arrives
from jaxsat.synthesis.optima.manoeuvre import manoeuvre_of
from jaxsat.synthesis.optima.search import best_of_starts
from jaxsat.synthesis.optima.transcription import BoundObjective


def starts(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Unit quaternions and rates (rad/s); case i does not depend on the number of cases."""
    drawn = [np.random.default_rng([seed, number]) for number in range(count)]
    quaternions = np.stack([one.normal(size=4) for one in drawn])
    omegas = np.stack([one.uniform(-0.1, 0.1, 3) for one in drawn])
    return quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True), omegas


def compiled(planner: Planner) -> Mapped:
    """Machine code that plans for one start; the numbers of the planner are its inputs."""

    def one(start, shared: Planner):
        quaternion, omega = start
        return tuple(shared.quickest(jnp.zeros(()), PlantState(Quaternion(quaternion), omega)))

    return Mapped(one, (np.zeros(4), np.zeros(3)), planner)


def in_parts(code: Mapped, cases: tuple[np.ndarray, np.ndarray], planner: Planner) -> Plan:
    """All cases, one part a processor."""
    count = min(processors(), len(cases[0]))
    parts = zip(*(np.array_split(array, count) for array in cases), strict=True)
    with ThreadPoolExecutor(count) as pool:
        found = list(pool.map(lambda part: code(part, planner), parts))
    return Plan(*(np.concatenate(arrays) for arrays in zip(*found, strict=True)))


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.split("\n", 1)[0])
    parser.add_argument("--torque-limit", type=float, default=5.0, help="N m")
    parser.add_argument("--starts", type=int, default=1000)
    parser.add_argument("--guesses", type=int, default=24)
    parser.add_argument("--bound", type=int, default=0, help="starts to compare with IPOPT")
    parser.add_argument("--seed", type=int, default=20260)
    parser.add_argument("--json", type=Path)
    chosen = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    run = build(load("acceptance-nominal", [f"spacecraft.torque_limit_N_m={chosen.torque_limit}"]))
    axes = run.loop.plant.effectors[0].torque_axes  # pyright: ignore[reportAttributeAccessIssue]
    planner = Planner(run.loop.plant, axes, chosen.torque_limit, guesses=chosen.guesses)
    cases = starts(chosen.starts, chosen.seed)

    begun = time.perf_counter()
    code = compiled(planner)
    code(tuple(array[:1] for array in cases), planner)
    compiling = time.perf_counter() - begun
    begun = time.perf_counter()
    plans = in_parts(code, cases, planner)
    seconds = time.perf_counter() - begun

    base = manoeuvre_of(run.loop, run.start)
    manoeuvres = [
        dataclasses.replace(base, quaternion=quaternion, omega=omega)
        for quaternion, omega in zip(*cases, strict=True)
    ]
    single = [Plan(*(array[number] for array in plans)) for number in range(chosen.starts)]
    flown = [arrives(*pair) for pair in zip(manoeuvres, single, strict=True)]
    ratios = []
    for number in range(min(chosen.bound, chosen.starts)):
        best = best_of_starts(manoeuvres[number], BoundObjective.TIME, 12, longest=600, seed=number)
        if best is not None:
            ratios.append(float(plans.duration[number]) / best.solution.value)
    found = {
        "torque_limit_N_m": chosen.torque_limit,
        "starts": chosen.starts,
        "guesses": chosen.guesses,
        "processors": processors(),
        "compiling_s": compiling,
        "planning_s": seconds,
        **{one.name.lower(): int(np.sum(plans.status == one)) for one in PlanStatus},
        "arrived": sum(flown),
        "median_s": float(np.median(plans.duration)),
        "ratios_to_ipopt": sorted(ratios),
        "within_2_percent": float(np.mean(np.array(ratios) < 1.02)) if ratios else None,
    }
    text = json.dumps(found, indent=1)
    print(text)
    if chosen.json is not None:
        chosen.json.write_text(text + "\n")


if __name__ == "__main__":
    main()
