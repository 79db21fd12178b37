"""The compiled engine against C written by hand, on the same work, taking turns.

    python benchmarks/native/compare.py --cases 1024 --duration 200
    python benchmarks/native/compare.py --work sampled --cases 256 --duration 600
    python benchmarks/native/compare.py --work pulsed --cases 256 --duration 100

The work is the scenario benchmark-three-axis: RK4 with 20 steps a second, the same with the
derivatives of the cost by four gains, and adaptive 5(4) steps with located switches; or, with
`--work sampled`, the scenario acceptance-hard with the oscillatory law: sensor noise, Kalman filter
and least squares ten times a second; or, with `--work pulsed`, that with six thrusters that push,
pulse widths, allocation and a failure. The results are compared first. Times are processor seconds
(of all threads), the least of several turns, so that what else the machine does counts little;
ratios are paces in parts of that of C. Needs a C compiler; says so where there is none.
"""

import argparse
import sys
import time
from collections.abc import Callable
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import ClassVar

import diffrax
import jax
import numpy as np

sys.path.insert(0, str(Path(__file__).parent))
sys.path.insert(0, str(Path(__file__).parents[1]))

from hand_written import Adaptive, FixedSteps, compiler
from sampled_work import Sampled, pulsed_study, sampled_engine, sampled_study

from contenders.work import K3, K4, MU, A, starts
from engines import made_study
from jaxsat.simulation.engine.adaptive import AdaptiveStepper, Tolerance
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.interface import AbstractEngine
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.studies.ensemble import Study

SUBSTEPS = 20
GAINS = {"k3": K3, "mu": MU, "a": A, "k4": K4}
LIMITS = np.array([0.05, 0.05, 1e-3])
PIECE = 256
"""Cases that a thread takes at a time."""


class RK4(diffrax.AbstractERK):
    """The classical method, which diffrax does not have."""

    tableau: ClassVar = diffrax.ButcherTableau(
        a_lower=(np.array([0.5]), np.array([0.0, 0.5]), np.array([0.0, 0.0, 1.0])),
        b_sol=np.array([1, 2, 2, 1]) / 6,
        b_error=np.array([1, -4, 2, 1]) / 6,
        c=np.array([0.5, 0.5, 1.0]),
    )
    interpolation_cls = diffrax.LocalLinearInterpolation

    def order(self, terms) -> int:
        """Four."""
        del terms
        return 4


def arrays(study: Study, count: int) -> tuple[np.ndarray, np.ndarray]:
    """Start (cases, 9) and disturbance (cases, 6) for the C programs."""
    y, *torque = (np.asarray(x) for x in starts(study, count))
    columns = [x[:, i] for x in torque for i in range(2)]
    return np.ascontiguousarray(y[:, :9]), np.ascontiguousarray(np.stack(columns, axis=1))


def by_hand(program, study: Study, count: int, threads: int) -> Callable[[], np.ndarray]:
    """A run of a C program, pieces shared out to threads."""
    sampled = isinstance(program, Sampled)
    start, torque = (None, None) if sampled else arrays(study, count)
    gains = np.array(list(GAINS.values()))
    results = np.zeros((count, program.columns))

    def piece(begin: int) -> None:
        program.run(start, torque, gains, results, begin, min(begin + PIECE, count))

    def run() -> np.ndarray:
        with ThreadPoolExecutor(threads) as pool:
            list(pool.map(piece, range(0, count, PIECE)))
        return results

    return run


def by_engine(engine: AbstractEngine, study: Study, count: int, *, gradient: bool = False):
    """A run of an engine."""
    cases = study.cases(np.arange(count))
    gains = {name: np.asarray(value) for name, value in GAINS.items()}

    def run():
        if not gradient:
            return engine.evaluate(study.program, cases)
        return engine.gradient(study.program, cases, gains)

    return run


def times(runs: dict[str, Callable], rounds: int) -> dict[str, tuple[float, float]]:
    """Seconds of the processor and of the clock, the least of all rounds, and of the first run."""
    best = {}
    for name, run in runs.items():
        begin = time.perf_counter()
        run()
        print(f"    {name:24} first run {time.perf_counter() - begin:6.2f} s", flush=True)
        best[name] = (np.inf, np.inf)
    for _ in range(rounds):
        for name, run in runs.items():
            begin, clock = time.process_time(), time.perf_counter()
            run()
            taken = time.process_time() - begin, time.perf_counter() - clock
            best[name] = tuple(map(min, best[name], taken))
    return best


def differences(found, results: np.ndarray) -> str:
    """By how much an engine's outputs and those of C differ."""
    pairs = {"cost": (found.cost, 9), "effort": (found.effort, 10), "peak": (found.peak_rate, 11)}
    parts = [
        f"{name} {np.nanmax(np.abs(value / results[:, column] - 1)):.0e}"
        for name, (value, column) in pairs.items()
    ]
    return ", ".join(parts)


def report(title: str, runs: dict[str, Callable], count: int, rounds: int) -> None:
    """Print a table of paces."""
    print(f"\n{title}")
    found = times(runs, rounds)
    base = found["C"][0]
    for name, (cpu, clock) in found.items():
        print(
            f"    {name:24} {count / cpu:10.0f} cases a processor second, {base / cpu:5.2f} of C;"
            f" {count / clock:10.0f} a second"
        )


def compare(options: argparse.Namespace) -> None:
    """All tables."""
    count, duration = options.cases, options.duration
    study = made_study(count, duration, "sharp")
    steps = (LIMITS, 1.0, round(duration), SUBSTEPS)
    fixed, both = FixedSteps(*steps), FixedSteps(*steps, gradient=True)
    engine = NativeEngine(FixedStepper(RK4(), SUBSTEPS), workers=1)
    scan = ScanEngine(FixedStepper(RK4(), SUBSTEPS), 256)

    results = by_hand(fixed, study, count, 1)()
    print("native and C differ by:", differences(by_engine(engine, study, count)(), results))
    for threads in options.threads:
        native = NativeEngine(FixedStepper(RK4(), SUBSTEPS), workers=threads)
        runs = {
            "C": by_hand(fixed, study, count, threads),
            "native": by_engine(native, study, count),
        }
        if threads == 1 and not options.quick:
            runs["scan"] = by_engine(scan, study, count)
        report(f"RK4, 20 steps a second, {threads} threads", runs, count, options.rounds)

    results = by_hand(both, study, count, 1)()
    found = by_engine(engine, study, count, gradient=True)()
    for i, name in enumerate(GAINS):
        size = np.abs(results[:, 13 + i]).max()
        off = np.abs(found.derivatives[name] - results[:, 13 + i]).max() / size
        print(f"derivative by {name}: differs by {off:.0e}")
    runs = {
        "C": by_hand(both, study, count, 1),
        "native": by_engine(engine, study, count, gradient=True),
    }
    report("RK4 with derivatives by four gains", runs, count, options.rounds)

    judged = Tolerance(options.tolerance, options.tolerance)
    walker = Adaptive(LIMITS, 1.0, round(duration), judged)
    native = NativeEngine(AdaptiveStepper(tolerance=judged), workers=1)
    results = by_hand(walker, study, count, 1)()
    print("native and C differ by:", differences(by_engine(native, study, count)(), results))
    print(f"steps tried by C: {results[:, 13].mean():.0f} in the mean")
    runs = {"C": by_hand(walker, study, count, 1), "native": by_engine(native, study, count)}
    report(f"Tsit5, tolerance {options.tolerance:g}, 1 thread", runs, count, options.rounds)


def compare_sampled(options: argparse.Namespace) -> None:
    """The table of the sampled loop."""
    count = options.cases
    pulsed = options.work == "pulsed"
    study = (pulsed_study if pulsed else sampled_study)(count, options.duration)
    program = Sampled(study, count)
    results = by_hand(program, study, count, 1)()
    found = sampled_engine(1).evaluate(study.program, study.cases(np.arange(count)))
    for name, column in (("cost", 0), ("effort", 1), ("peak_rate", 2)):
        off = np.abs(getattr(found, name) / results[:, column] - 1)
        print(f"{name}: native and C differ by {np.median(off):.0e}, at most {off.max():.0e}")
    if pulsed:
        for name, column in (("propellant", 11), ("valve_openings", 12)):
            values = np.asarray(found.parts[name]).reshape(count, -1).sum(axis=1)
            off = np.abs(values - results[:, column]) / np.maximum(results[:, column], 1e-30)
            print(f"{name}: native and C differ by {np.median(off):.0e}, at most {off.max():.0e}")
    late = np.isinf(found.settling_time), np.isinf(results[:, 3])
    print(f"settled: native {count - late[0].sum()}, C {count - late[1].sum()} of {count} cases")
    for threads in options.threads:
        runs = {
            "C": by_hand(program, study, count, threads),
            "native": by_engine(sampled_engine(threads), study, count),
        }
        title = f"Oscillatory law{' by pulses' * pulsed}, 10 samples a second, {threads} threads"
        report(title, runs, count, options.rounds)


def main() -> None:
    """Compare, where there is a compiler."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--work", choices=["three-axis", "sampled", "pulsed"], default="three-axis")
    parser.add_argument("--cases", type=int, default=1024)
    parser.add_argument("--duration", type=float, default=200.0)
    parser.add_argument("--tolerance", type=float, default=1e-7)
    parser.add_argument("--rounds", type=int, default=5)
    parser.add_argument("--threads", type=int, nargs="+", default=[1, 2])
    parser.add_argument("--quick", action="store_true", help="without the scan engine")
    if compiler() is None:
        sys.exit("There is no C compiler here, so there is nothing to compare with.")
    jax.config.update("jax_enable_x64", True)
    options = parser.parse_args()
    (compare if options.work == "three-axis" else compare_sampled)(options)


if __name__ == "__main__":
    main()
