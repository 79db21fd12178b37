"""What the gradient of gains costs, as a multiple of the run itself.

    python benchmarks/gradients.py [--cases 1024] [--duration 100] [--only scan]

Forward mode, reverse mode and central differences of the printed gains' four numbers over N cases
of `benchmark-three-axis`, interleaved, best of three; compile times are
those of the first call. Adaptive steps of the scan engine have no reverse mode, so the rows with
fixed steps compare the modes alike.
"""

import argparse
import time

import jax
import numpy as np

jax.config.update("jax_enable_x64", True)

from jaxsat.scenario.build.load import load  # noqa: E402
from jaxsat.synthesis.tuning.build import build_plan  # noqa: E402

ROUNDS = 3
FIXED = ("simulation.solver.steps=fixed", "simulation.solver.step_s=0.05")
SMOOTH = ("control.saturation_width=0.3",)
WAYS = {
    "native, adaptive": ((), "native", ("forward", "differences")),
    "scan, adaptive": ((), "scan", ("forward", "differences")),
    "scan, fixed 0.05 s, smooth": ((*FIXED, *SMOOTH), "scan", ("forward", "reverse")),
    "diffrax, fixed 0.05 s, smooth": ((*FIXED, *SMOOTH), "diffrax", ("forward", "reverse")),
}


def contenders(overrides, engine, ways, args):
    common = [f"simulation.duration_s={args.duration:g}", *overrides]
    for way in ways:
        scenario = load(args.scenario, [*common, f"tuning.gradient={way}"])
        yield way, build_plan(scenario, engine=engine, batch_size=args.batch_size).exact


def timed(work):
    begin = time.perf_counter()
    work()
    return time.perf_counter() - begin


def measure(label, overrides, engine, ways, args):
    numbers = np.arange(args.cases)
    trials = dict(contenders(overrides, engine, ways, args))
    plain = next(iter(trials.values()))
    point = plain.space.to_search(np.array([[0.05, 1.0, 0.1, 0.01]]))
    works = {"primal": lambda: plain.evaluate(point, numbers)}
    for way, one in trials.items():
        works[way] = lambda one=one: one.differentiate(point, numbers)
    few = {name: timed(work) for name, work in works.items()}  # the first call of each compiles
    best = dict.fromkeys(works, np.inf)
    for _ in range(ROUNDS):
        for name, work in works.items():
            best[name] = min(best[name], timed(work))
    print(f"\n{label}: {args.cases} cases of {args.duration:g} s, {plain.space.size} gains")
    print(f"{'':<12} {'seconds':>9} {'x primal':>9} {'compile s':>10}")
    for name, seconds in best.items():
        ratio, compiling = seconds / best["primal"], few[name] - seconds
        print(f"{name:<12} {seconds:9.2f} {ratio:9.2f} {compiling:10.1f}", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", default="benchmark-three-axis")
    parser.add_argument("--cases", type=int, default=1024)
    parser.add_argument("--duration", type=float, default=100.0)
    parser.add_argument("--batch-size", type=int, default=64)
    parser.add_argument("--only", help="part of the label of what to measure", default="")
    args = parser.parse_args()
    for label, (overrides, engine, ways) in WAYS.items():
        if args.only in label:
            measure(label, overrides, engine, ways, args)


if __name__ == "__main__":
    main()
