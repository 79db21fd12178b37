"""Engines and other programs on one piece of work, at equal accuracy, in one interleaved run.

    python benchmarks/engines.py                                        # half an hour
    python benchmarks/engines.py --law smooth --within 1e-10
    python benchmarks/engines.py --cases 1 4 --duration 5 --rounds 1    # to see that it works

The work is the scenario benchmark-three-axis, as it is or with its sat smooth (a tanh). Of every
contender the loosest setting takes part for which 95 % of the cases are within 1e-6, or what
`--within` tells, of SciPy's DOP853 at its tightest. Paces are the best of several rounds in which
every contender takes its turn, with short runs again and again, so that what else the machine does
falls on all; ratios are to the first. Then every contender runs twice in a process of its own, with
caches that are empty and then full: time to make its machine code, and memory.
"""

import argparse
import datetime
import json
import math
import os
import platform
import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path
from typing import Any

import jax
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))

from contenders import all_contenders
from contenders.contender import LAWS, Contender, Run
from contenders.scipy_dop853 import truth
from contenders.work import errors, final_state, starts
from jaxsat.core.process import processors
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.store.provenance import machine
from jaxsat.studies.ensemble import Study

PERCENT = 95.0
PATIENCE = 60.0
"""Seconds; a contender whose first turn takes longer has no other, so that no run takes hours."""

TURN = 0.5
"""Seconds that a turn lasts at least. The time of a run of some milliseconds depends on what the
processors did before it."""

COLD_DURATION = 20.0
"""Seconds of flight where only making machine code and memory are of interest."""


def made_study(count: int, duration: float, law: str) -> Study:
    """The study of the work."""
    width = float(law == "smooth")
    changes = [f"simulation.duration_s={duration}", f"control.saturation_width={width}"]
    changes.append('simulation.coordinates="error"')  # as the sharp law has them, and `work.rate`
    scenario = load("benchmark-three-axis", changes)
    return build_study(scenario, count, seed=1, engine="scan")


def chosen_setting(
    contender: Contender, study: Study, true: np.ndarray, start: np.ndarray, within: float
) -> dict[str, float | None]:
    """The loosest setting that is accurate enough, else the tightest, its error, and the share
    of cases that are accurate enough."""
    error, share, setting = None, None, contender.settings[0]
    for setting in contender.settings:
        found = contender.prepare(study, len(true), setting)()
        if found is None:
            break
        every = errors(found, true, start)
        error, share = float(np.percentile(every, PERCENT)), float(np.mean(every <= within))
        if error <= within:
            break
    return {"setting": setting, "error": error, "share": share}


def accuracy(options: argparse.Namespace, contenders: list[Contender]) -> dict[str, Any]:
    """Setting and error of every contender; None as error of one that does other work."""
    study = made_study(options.truth, options.duration, options.law)
    true = truth(study, options.truth)
    start = final_state(starts(study, options.truth)[0], options.law == "smooth")
    found = {}
    print(f"\n{PERCENT:g} % of {options.truth} cases are within the error")
    print(f"{'':34} setting  error    share within {options.within:g}", flush=True)
    for contender in contenders:
        found[contender.name] = chosen_setting(contender, study, true, start, options.within)
        setting, error, share = found[contender.name].values()
        shown = "other work" if error is None else f"{error:.1e}  {share:.0%}"
        missed = error is not None and error > options.within
        print(
            f"{contender.name:34} {setting:<8.2g} {shown}{'  NOT ACCURATE ENOUGH' * missed}",
            flush=True,
        )
    return found


def seconds(run: Run) -> float:
    """Time of one run, the least in a turn."""
    best, begin = math.inf, time.perf_counter()
    now = begin
    while now - begin < TURN:
        run()
        before, now = now, time.perf_counter()
        best = min(best, now - before)
    return best


def paces(runs: dict[str, Run], count: int, rounds: int) -> dict[str, float]:
    """Cases a second of every contender, the best of its turns.

    The first, in which machine code is made, counts only where it is so long that it is the last.
    """
    best = {name: seconds(run) for name, run in runs.items()}
    quick = [name for name in runs if best[name] <= PATIENCE]
    best |= dict.fromkeys(quick, math.inf)
    for _ in range(rounds):
        for name in quick:
            best[name] = min(best[name], seconds(runs[name]))
    return {name: count / best[name] for name in runs}


def rows(
    options: argparse.Namespace, contenders: list[Contender], settings: dict[str, float]
) -> dict[str, dict[str, float]]:
    """Paces of the contenders by number of cases."""
    found = {}
    for count in options.cases:
        study = made_study(count, options.duration, options.law)
        print(f"\n{count} cases", flush=True)
        for contender in contenders:
            if count > contender.most:
                print(f"{contender.name}: not beyond {contender.most} cases, {contender.why}")
        taking_part = [c for c in contenders if count <= c.most]
        runs = {c.name: c.prepare(study, count, settings[c.name]) for c in taking_part}
        found[str(count)] = paces(runs, count, options.rounds)
        base = next(iter(found[str(count)].values()))
        print(f"{'':34}   cases/s   ratio")
        for name, pace in found[str(count)].items():
            print(f"{name:34} {pace:9.1f} {pace / base:7.2f}", flush=True)
    return found


def peak_memory() -> float:
    """The largest memory of this process so far, MB."""
    try:
        lines = Path("/proc/self/status").read_text(encoding="ascii").splitlines()
        return next(int(line.split()[1]) for line in lines if line.startswith("VmHWM")) / 1024
    except (OSError, StopIteration):  # elsewhere; on Linux it begins with that of the parent
        unit = 2**20 if sys.platform == "darwin" else 2**10
        return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / unit


def first_result(contender: Contender, count: int, setting: float, law: str) -> dict[str, float]:
    """Seconds until a first result beyond those of a second one, and memory in MB, here."""
    study = made_study(count, COLD_DURATION, law)
    jax.block_until_ready(starts(study, count))
    before = peak_memory()
    begin = time.perf_counter()
    run = contender.prepare(study, count, setting)
    run()
    first = time.perf_counter() - begin
    again = seconds(run)
    peak = peak_memory()
    return {"compile": first - again, "peak": peak, "own": peak - before}


def cold(
    options: argparse.Namespace, contenders: list[Contender], settings: dict[str, float]
) -> dict[str, dict[str, float]]:
    """What the first result of every contender costs, cold and with full caches."""
    count = options.cold_cases
    print(f"\n{count} cases of {COLD_DURATION:g} s, each contender in processes of its own")
    print(f"{'':34} compile s: cold  cached   peak MB   beyond the start", flush=True)
    every = {}
    for contender in contenders:
        command = [sys.executable, __file__, "--alone", contender.name]
        command += ["--setting", repr(settings[contender.name]), "--cold-cases", str(count)]
        command += ["--law", options.law]
        found = []
        with tempfile.TemporaryDirectory() as cache:
            flags = {
                "JAX_COMPILATION_CACHE_DIR": cache,
                "JAX_PERSISTENT_CACHE_MIN_COMPILE_TIME_SECS": "0",
                "JAXSAT_CACHE_DIR": cache,
                "NUMBA_CACHE_DIR": cache,
            }
            for _ in range(2):
                run = subprocess.run(
                    command, env=os.environ | flags, capture_output=True, text=True, check=True
                )
                found.append(json.loads(run.stdout.splitlines()[-1]))
        first, second = found
        entry = {"cold": first["compile"], "cached": second["compile"]}
        entry |= {"peak_MB": first["peak"], "own_MB": first["own"]}
        every[contender.name] = entry
        line = f"{entry['cold']:16.1f} {entry['cached']:7.1f} {entry['peak_MB']:9.0f}"
        print(f"{contender.name:34}{line} {entry['own_MB']:11.0f}", flush=True)
    return every


def table(found: dict[str, Any]) -> str:
    """Everything as one table in Markdown, paces as ratios to the first contender's."""
    counts = list(found["rows"])
    head = ["", "setting", "error", *(f"N = {count}" for count in counts)]
    head += ["compile s", "cached", "MB"]
    lines = [head, ["---"] * len(head)]
    for name, entry in found["accuracy"].items():
        error = "other work" if entry["error"] is None else f"{entry['error']:.0e}"
        line = [name, f"{entry['setting']:.2g}", error]
        for count in counts:
            row = found["rows"][count]
            base = next(iter(row.values()))
            line.append(f"{row[name] / base:.2f}" if name in row else "")
        alone = found["cold"].get(name)
        numbers = ("cold", "cached", "own_MB")
        line += [f"{alone[key]:.{int(key != 'own_MB')}f}" for key in numbers] if alone else [""] * 3
        lines.append(line)
    bases = [f"{next(iter(found['rows'][count].values())):.3g}/s" for count in counts]
    lines.append([f"{lines[2][0]}, cases a second", "", "", *bases, "", "", ""])
    return "\n".join(f"| {' | '.join(line)} |" for line in lines)


def compare(options: argparse.Namespace, contenders: list[Contender]) -> None:
    """Accuracy, paces, and what a first result costs; printed, and written as JSON if asked."""
    where = f"{machine()['processor']}, {processors()} processors"
    print(f"{where}; {options.duration:g} s of flight, {options.law} law")
    found: dict[str, Any] = {
        "machine": machine(),
        "processors": processors(),
        "python": platform.python_version(),
        "date": datetime.datetime.now(datetime.UTC).isoformat(timespec="seconds"),
        "duration": options.duration,
        "law": options.law,
        "within": options.within,
    }
    if options.judged is not None:
        found["accuracy"] = json.loads(options.judged.read_text(encoding="utf-8"))["accuracy"]
        contenders = [c for c in contenders if c.name in found["accuracy"]]
    else:
        found["accuracy"] = accuracy(options, contenders)
    settings = {name: entry["setting"] for name, entry in found["accuracy"].items()}
    found["rows"] = rows(options, contenders, settings)
    found["cold"] = {} if options.warm else cold(options, contenders, settings)
    print(f"\n{table(found)}")
    for contender in contenders:
        if contender.note:
            print(f"\n{contender.name}: {contender.note}")
    if options.json is not None:
        options.json.write_text(json.dumps(found, indent=1) + "\n", encoding="utf-8")


def main() -> None:
    """Compare, or be one contender alone."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, nargs="*", default=[1, 32, 1024, 16384])
    parser.add_argument("--truth", type=int, default=20, help="cases that accuracy is judged by")
    parser.add_argument("--duration", type=float, default=1000.0, help="s")
    parser.add_argument("--law", choices=LAWS, default=LAWS[0], help="sat as printed, or a tanh")
    parser.add_argument("--within", type=float, default=1e-6, help="accuracy of 95 %% of cases")
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", nargs="*", help="parts of names of contenders")
    parser.add_argument("--warm", action="store_true", help="paces alone")
    parser.add_argument("--cold-cases", type=int, default=1024)
    parser.add_argument("--judged", type=Path, help="JSON of a run that has judged accuracy")
    parser.add_argument("--json", type=Path, help="file to write everything to")
    parser.add_argument("--alone", help=argparse.SUPPRESS)
    parser.add_argument("--setting", type=float, help=argparse.SUPPRESS)
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    contenders = [c for c in all_contenders() if options.law in c.laws]
    if options.alone:
        (contender,) = (c for c in contenders if c.name == options.alone)
        print(json.dumps(first_result(contender, options.cold_cases, options.setting, options.law)))
        return
    if options.only:
        contenders = [c for c in contenders if any(part in c.name for part in options.only)]
    compare(options, contenders)


if __name__ == "__main__":
    main()
