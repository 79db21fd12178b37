"""Least times of the random starts of the acceptance set, which `jaxsat compare` divides by.

    python benchmarks/least_times.py --seed 0 --seed 424243 --write least_times.json
    python benchmarks/least_times.py --seed 424243 --bound 5

To where a case begins to count as settled, and to rest: plans of least time with the whole torque
from the starts, by `jaxsat.control.planning.Planner` with 48
guesses, for the spacecraft and disturbance without dispersions. DOP853 flies every plan again; one
that does not arrive has no least time. The file belongs to `jaxsat/synthesis/comparison`. With
`--bound` some are compared with what `jaxsat bound` finds, the best of 12 random starts of IPOPT
and of the plan as a start, which needs CasADi: their ratio is never below 1.
"""

import argparse
import dataclasses
import itertools
import json
import math
from pathlib import Path

import jax
import numpy as np

from jaxsat.control.planning.planner import Plan, Planner, PlanStatus
from jaxsat.scenario.build.run import build, build_tolerances
from jaxsat.synthesis.comparison.acceptance import (
    LIMITS,
    ComparisonSetting,
    Start,
    comparison_scenario,
    comparison_study,
)
from jaxsat.synthesis.comparison.front import arrives
from jaxsat.synthesis.optima.manoeuvre import End, manoeuvre_of
from jaxsat.synthesis.optima.search import best_of_starts, solution_of
from jaxsat.synthesis.optima.transcription import BoundObjective
from planner import compiled, in_parts

GUESSES = 48
ENDS: tuple[End, ...] = ("rest", "settled")
SETTING = ComparisonSetting("nominal", LIMITS[0], "three-slew")
"""Starts are the same for every law, limit and level."""


def starts(count: int, seed: int) -> tuple[np.ndarray, np.ndarray]:
    """Quaternions and rates (rad/s) of the first cases of a seed."""
    study = comparison_study(SETTING, Start.RANDOM, count, seed)

    def one(case):
        start = study.case_factory(case).start
        return start.attitude.as_quaternion().q, start.omega

    quaternions, omegas = jax.vmap(one)(study.cases(np.arange(count)))
    return np.asarray(quaternions), np.asarray(omegas)


def main() -> None:
    parser = argparse.ArgumentParser(description="Least times of random starts.")
    parser.add_argument("--seed", type=int, action="append", required=True)
    parser.add_argument("--starts", type=int, default=200)
    parser.add_argument("--limit", type=float, action="append", help="N m; 1, 5 and 20 by default")
    parser.add_argument("--bound", type=int, default=0, help="starts to compare with IPOPT")
    parser.add_argument("--write", type=Path)
    chosen = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    codes, tables, known = {}, [], {}
    for end, limit in itertools.product(ENDS, chosen.limit or LIMITS):
        scenario = comparison_scenario(SETTING._replace(torque_limit=limit))
        run = build(scenario)
        tolerances = build_tolerances(scenario) if end == "settled" else None
        axes = run.loop.plant.effectors[0].torque_axes  # pyright: ignore[reportAttributeAccessIssue]
        keys = {"guesses": GUESSES, "tolerances": tolerances}
        planner = Planner(run.loop.plant, axes, limit, **keys)
        if end not in codes:
            codes[end] = compiled(planner)
        base = manoeuvre_of(run.loop, run.start, tolerances=tolerances)
        for seed in chosen.seed:
            cases = starts(chosen.starts, seed)
            plans = in_parts(codes[end], cases, planner)
            times, ratios = [], []
            for number in range(chosen.starts):
                plan = Plan(*(array[number] for array in plans))
                at = {"quaternion": cases[0][number], "omega": cases[1][number]}
                start = dataclasses.replace(base, **at)
                duration = float(plan.duration)
                duration = duration if arrives(start, plan) else math.inf
                # What comes to rest settles, too.
                duration = min(duration, known.get((seed, limit, number), math.inf))
                known[seed, limit, number] = duration
                times.append(round(duration, 3) if math.isfinite(duration) else None)
                if number < chosen.bound:
                    keys = {"longest": 600, "seed": number, "plans": [solution_of(plan)]}
                    best = best_of_starts(start, BoundObjective.TIME, 12, **keys)
                    assert best is not None
                    ratios.append(duration / best.solution.value)
            arriving = [one for one in times if one is not None]
            solved = int(np.sum(plans.status == PlanStatus.SOLVED))
            print(
                f"{limit:g} N m, {end}, seed {seed}: {solved} solved, {len(arriving)} arrive, "
                f"median {np.median(arriving):.2f} s, over that of `bound`: {np.round(ratios, 4)}",
                flush=True,
            )
            named = {"seed": seed, "torque_limit_N_m": limit, "end": end}
            tables.append({**named, "least_times_s": times})
    if chosen.write is not None:
        lines = ",\n ".join(json.dumps(table) for table in tables)
        chosen.write.write_text(f"[\n {lines}\n]\n")


if __name__ == "__main__":
    main()
