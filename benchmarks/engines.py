"""Engines and other programs on one piece of work, at equal accuracy, in one interleaved run.

    python benchmarks/engines.py --cases 32 1024 --duration 200
    python benchmarks/engines.py --compile

The work is the scenario benchmark-three-axis. Of every contender the loosest setting takes part
for which 95 % of the cases are within 1e-6 of SciPy's DOP853 at 1e-12. Paces are the best of
several rounds in which every contender takes its turn, so that what else the machine does falls
on all; ratios are to the first. With `--compile` every contender runs twice in a process of its
own with a fresh compilation cache: time to the first result, cold and cached, and memory.
"""

import argparse
import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import jax
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from contenders import all_contenders
from contenders.contender import Contender, Run
from contenders.scipy_dop853 import truth
from contenders.work import errors, final_state, starts
from jaxsat.montecarlo import Study
from jaxsat.processors import processors
from jaxsat.scenario import load
from jaxsat.scenario.study import build_study

WANTED = 1e-6
PERCENT = 95.0


def made_study(count: int, duration: float) -> Study:
    """The study of the work."""
    scenario = load("benchmark-three-axis", [f"simulation.duration_s={duration}"])
    return build_study(scenario, count, seed=1)


def chosen_setting(
    contender: Contender, study: Study, true: np.ndarray, start: np.ndarray
) -> tuple[float, float | None]:
    """The loosest setting that is accurate enough, else the tightest, and its error."""
    error = None
    for setting in contender.settings:
        found = contender.prepare(study, len(true), setting)()
        if found is None:
            return setting, None
        error = float(np.percentile(errors(found, true, start), PERCENT))
        if error <= WANTED:
            return setting, error
    return contender.settings[-1], error


def paces(runs: dict[str, Run], count: int, rounds: int) -> dict[str, float]:
    """Cases a second of every contender, the best of its turns."""
    best = dict.fromkeys(runs, np.inf)
    for run in runs.values():
        run()
    for _ in range(rounds):
        for name, run in runs.items():
            begin = time.perf_counter()
            run()
            best[name] = min(best[name], time.perf_counter() - begin)
    return {name: count / seconds for name, seconds in best.items()}


def compare(options: argparse.Namespace, contenders: list[Contender]) -> None:
    """Print accuracy, then pace and ratio for every number of cases."""
    checked = made_study(options.truth, options.duration)
    true = truth(checked, options.truth)
    start = final_state(starts(checked, options.truth)[0])
    settings = {}
    print(f"{options.duration:g} s of flight, {processors()} processors; error: {PERCENT:g} % of")
    print(f"{options.truth} cases are within it")
    for contender in contenders:
        settings[contender.name], error = chosen_setting(contender, checked, true, start)
        shown = "other work" if error is None else f"{error:.1e}"
        missed = "  NOT ACCURATE ENOUGH" if error is not None and error > WANTED else ""
        print(f"{contender.name:34} {settings[contender.name]:<8g} {shown}{missed}", flush=True)
    for count in options.cases:
        study = made_study(count, options.duration)
        taking_part = [c for c in contenders if count <= c.most]
        runs = {c.name: c.prepare(study, count, settings[c.name]) for c in taking_part}
        found = paces(runs, count, options.rounds)
        base = next(iter(found.values()))
        print(f"\n{count} cases {'':24} cases/s   ratio")
        for name, pace in found.items():
            print(f"{name:34} {pace:9.1f} {pace / base:7.2f}", flush=True)
    for contender in contenders:
        if contender.note:
            print(f"\n{contender.name}: {contender.note}")


def first_result(contender: Contender, count: int, duration: float) -> dict[str, float]:
    """Seconds to the first result, and by how much the process grew (MB), here."""
    study = made_study(count, duration)
    jax.block_until_ready(starts(study, count))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    begin = time.perf_counter()
    run = contender.prepare(study, count, contender.settings[len(contender.settings) // 2])
    run()
    first = time.perf_counter() - begin
    run()
    again = time.perf_counter() - begin - first
    grown = (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before) / 1024
    return {"compile": first - again, "memory": grown}


def compile_times(options: argparse.Namespace, contenders: list[Contender]) -> None:
    """Print for every contender what its first result costs, cold and with a filled cache."""
    count = options.cases[0]
    print(f"{count} cases{'':26} compile s: cold  cached   memory MB")
    for contender in contenders:
        with tempfile.TemporaryDirectory() as cache:
            command = [sys.executable, __file__, "--alone", contender.name, "--cases", str(count)]
            command += ["--duration", str(options.duration)]
            flags = {
                "JAX_COMPILATION_CACHE_DIR": cache,
                "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
                "NUMBA_CACHE_DIR": cache,
            }
            found = []
            for _ in range(2):
                run = subprocess.run(
                    command,
                    env=os.environ | flags,
                    capture_output=True,
                    text=True,
                    check=True,
                )
                found.append(json.loads(run.stdout.splitlines()[-1]))
        cold, cached = (entry["compile"] for entry in found)
        memory = found[0]["memory"]
        print(f"{contender.name:34} {cold:13.1f} {cached:7.1f} {memory:11.0f}", flush=True)


def main() -> None:
    """Compare, or measure compilation."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, nargs="+", default=[1, 32, 1024])
    parser.add_argument("--truth", type=int, default=20)
    parser.add_argument("--duration", type=float, default=1000.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", nargs="*", help="parts of names of contenders")
    parser.add_argument("--compile", action="store_true")
    parser.add_argument("--alone", help=argparse.SUPPRESS)
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    contenders = all_contenders()
    if options.only:
        contenders = [c for c in contenders if any(part in c.name for part in options.only)]
    if options.alone:
        (contender,) = (c for c in contenders if c.name == options.alone)
        print(json.dumps(first_result(contender, options.cases[0], options.duration)))
    elif options.compile:
        compile_times(options, contenders)
    else:
        compare(options, contenders)


if __name__ == "__main__":
    main()
