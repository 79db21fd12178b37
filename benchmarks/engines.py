"""Engines on one fixed piece of work, in one interleaved run, with the accuracy of each.

    python benchmarks/engines.py --cases 256 --duration 200

The work is the scenario benchmark-three-axis. Accuracy is against SciPy's DOP853 at 1e-12 on some
of the cases: the 95 % point over cases of the largest error of the final state and the cost, each
scaled by its largest value over the cases. Times are the best of several rounds in which every
engine takes its turn, so that what else the machine does falls on all; ratios are to the first.
"""

import argparse
import time
from collections.abc import Callable

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
from scipy.integrate import solve_ivp

from jaxsat.engine import ReferenceEngine, ScanEngine, Tolerance
from jaxsat.scenario import load
from jaxsat.scenario.study import build_study
from jaxsat.simulation import adaptive, fixed

J1, J2 = 449.5, 264.6
K3, MU, A, K4, WIDTH2 = 0.05, 1.0, 0.1, 0.01, 1e-4
ORBIT_RATE = 0.0011


def by_hand(t, y, amplitude, frequency, phase, np=jnp):
    """The same equations written out: w1 w2 z, η1 η2, α, dα/dt, cost; ω3 held at zero."""
    w1, w2, z, e1, e2, p1, p2, v1, v2 = y[:9]
    square = w1 * w1 + w2 * w2
    below, whole = square + WIDTH2, 1 + square
    q = z / below
    s1, s2 = q * w2, -q * w1
    r1 = -K3 * w1 / whole + MU * np.clip(s1, -A, A) + e1
    r2 = -K3 * w2 / whole + MU * np.clip(s2, -A, A) + e2
    dw1 = (1 + w1 * w1 - w2 * w2) * r1 / 2 + w1 * w2 * r2
    dw2 = (1 - w1 * w1 + w2 * w2) * r2 / 2 + w1 * w2 * r1
    dz = w1 * r2 - w2 * r1
    dsquare = 2 * (w1 * dw1 + w2 * dw2)
    dq = (dz - q * dsquare) / below
    inside1, inside2 = np.abs(s1) < A, np.abs(s2) < A
    slope1 = (-K3 * (dw1 - w1 * dsquare / whole) / whole) + np.where(
        inside1, MU * (dq * w2 + q * dw2), 0.0
    )
    slope2 = (-K3 * (dw2 - w2 * dsquare / whole) / whole) - np.where(
        inside2, MU * (dq * w1 + q * dw1), 0.0
    )
    f1 = -w1 * whole + w2 * z - K4 * e1 - K4 * v1
    f2 = -w2 * whole - w1 * z - K4 * e2 - K4 * v2
    d1, d2 = (amplitude[i] * np.sin(frequency[i] * t + phase[i]) for i in range(2))
    u1, u2 = f1 + J1 * slope1, f2 + J2 * slope2
    cost = square + z * z + 100 * (r1 * r1 + r2 * r2) + 1e-3 * (u1 * u1 + u2 * u2)
    return np.stack(
        [
            dw1,
            dw2,
            dz,
            (f1 + d1) / J1,
            (f2 + d2) / J2,
            v1,
            v2,
            e1 - frequency[0] ** 2 * p1,
            e2 - frequency[1] ** 2 * p2,
            cost,
        ]
    )


def starts(study, count):
    """Start and disturbance of the cases in the variables of `by_hand`."""
    copies = jax.vmap(study.copies)(study.cases(np.arange(count)))
    attitude = copies.start.attitude
    error = copies.drawn["rate_error"]
    zero = jnp.zeros((count, 5))
    y = jnp.concatenate([attitude.w, attitude.z[:, None], error, zero], axis=1)
    torque = copies.loop.plant.disturbance
    return y, torque.amplitude, torque.frequency, torque.phase


def final_rates(y):
    """w1 w2 z, ω1 ω2 and the cost from the last state of `by_hand`."""
    w1, w2, z, e1, e2 = y.T[:5]
    square = w1 * w1 + w2 * w2
    q = z / (square + WIDTH2)
    r1 = -K3 * w1 / (1 + square) + MU * np.clip(q * w2, -A, A) + e1
    r2 = -K3 * w2 / (1 + square) + MU * np.clip(-q * w1, -A, A) + e2
    return np.stack([w1, w2, z, r1, r2 - ORBIT_RATE, y.T[9]], axis=1)


def dop853(study, count, duration):
    """The truth."""
    y, *rest = map(np.asarray, starts(study, count))
    found = []
    for i in range(count):
        own = [entry[i] for entry in rest]
        run = solve_ivp(
            lambda t, y, own=own: by_hand(t, y, *own, np=np),
            (0, duration),
            y[i],
            "DOP853",
            rtol=1e-12,
            atol=1e-12,
        )
        found.append(run.y[:, -1])
    return final_rates(np.array(found))


def hand_written_scan(study, count, duration, step):
    """RK4 in a `lax.scan`, vmapped: what a person in a hurry would write."""

    def run(y, *rest):
        def body(y, k):
            t = k * step
            a = by_hand(t, y, *rest)
            b = by_hand(t + step / 2, y + step / 2 * a, *rest)
            c = by_hand(t + step / 2, y + step / 2 * b, *rest)
            d = by_hand(t + step, y + step * c, *rest)
            return y + step / 6 * (a + 2 * b + 2 * c + d), None

        return jax.lax.scan(body, y, jnp.arange(round(duration / step)))[0]

    compiled = jax.jit(jax.vmap(run))
    inputs = starts(study, count)
    return lambda: final_rates(np.asarray(compiled(*inputs)))


def with_engine(study, cases, engine):
    """A run of the engine as a function of nothing."""

    def run():
        found = engine.evaluate(study.program, cases)
        rates = found.omega[:, :2]
        return np.concatenate([found.w, found.z[:, None], rates, found.cost[:, None]], axis=1)

    return run


def main():
    """Compare."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=256)
    parser.add_argument("--lanes", type=int, default=512)
    parser.add_argument("--truth", type=int, default=16)
    parser.add_argument("--duration", type=float, default=200.0)
    parser.add_argument("--rounds", type=int, default=3)
    parser.add_argument("--only", nargs="*")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    overrides = [f"simulation.duration_s={options.duration}"]
    study = build_study(load("benchmark-three-axis", overrides), options.cases, seed=1)
    cases, width = study.cases(np.arange(options.cases)), options.cases
    tsit5, dopri8 = diffrax.Tsit5(), diffrax.Dopri8()
    candidates: dict[str, Callable[[], np.ndarray]] = {
        "lax.scan RK4 0.05 by hand": hand_written_scan(
            study, options.cases, options.duration, 0.05
        ),
        "jaxsat scan Tsit5 0.05": with_engine(
            study, cases, ScanEngine(tsit5, 20, lanes=min(width, options.lanes))
        ),
        "diffrax Tsit5 0.05": with_engine(study, cases, ReferenceEngine(fixed(0.05, tsit5), width)),
    }
    lanes = min(width, options.lanes)
    for tolerance in (1e-8, 1e-9):
        judged = Tolerance(tolerance, tolerance)
        candidates[f"jaxsat scan Tsit5 {tolerance:g}"] = with_engine(
            study, cases, ScanEngine(tsit5, lanes=lanes, tolerance=judged)
        )
        candidates[f"diffrax Tsit5 {tolerance:g}"] = with_engine(
            study, cases, ReferenceEngine(adaptive(tolerance, tolerance, tsit5), width)
        )
        candidates[f"diffrax Dopri8 {tolerance:g}"] = with_engine(
            study, cases, ReferenceEngine(adaptive(tolerance, tolerance, dopri8), width)
        )
    if options.only:
        candidates = {n: c for n, c in candidates.items() if any(o in n for o in options.only)}
    truth = dop853(study, options.truth, options.duration)
    first, best, found = {}, {}, {}
    for name, run in candidates.items():
        begin = time.perf_counter()
        found[name] = run()
        first[name] = time.perf_counter() - begin
        print(f"{name}: compiled in {first[name]:.1f} s", flush=True)
    for _ in range(options.rounds):
        for name, run in candidates.items():
            begin = time.perf_counter()
            run()
            best[name] = min(best.get(name, np.inf), time.perf_counter() - begin)
    scale = np.abs(truth).max(axis=0)
    base = best[next(iter(candidates))]
    print(f"{'':28} traj/s   ratio  first s  error 95 %")
    for name in candidates:
        error = np.abs(found[name][: options.truth] - truth) / scale
        worst = np.percentile(error.max(axis=1), 95)
        pace = options.cases / best[name]
        print(f"{name:28} {pace:7.1f} {base / best[name]:6.2f} {first[name]:7.1f}  {worst:.1e}")


if __name__ == "__main__":
    main()
