"""A loop in numba: Dormand and Prince's 5(4) with steps of each case's own, cases in parallel."""

import functools
import math

import numpy as np

from contenders.contender import TOLERANCES, Contender, Run
from contenders.work import J1, J2, K3, K4, MU, SIZE, WIDTH2, A, final_state, is_smooth, starts
from jaxsat.studies.ensemble import Study

TIMES = np.array([0, 1 / 5, 3 / 10, 4 / 5, 8 / 9, 1, 1])
STAGES = np.zeros((7, 6))
for _stage, _row in enumerate(
    (
        (),
        (1 / 5,),
        (3 / 40, 9 / 40),
        (44 / 45, -56 / 15, 32 / 9),
        (19372 / 6561, -25360 / 2187, 64448 / 6561, -212 / 729),
        (9017 / 3168, -355 / 33, 46732 / 5247, 49 / 176, -5103 / 18656),
        (35 / 384, 0, 500 / 1113, 125 / 192, -2187 / 6784, 11 / 84),
    )
):
    STAGES[_stage, : len(_row)] = _row
ERROR = np.array([71 / 57600, 0, -71 / 16695, 71 / 1920, -17253 / 339200, 22 / 525, -1 / 40])
"""Dormand and Prince's tableau; the last stage is the first of the next step."""

SAFETY, LEAST, LARGEST, FIRST = 0.9, 0.2, 5.0, 0.01


def parameters(inputs) -> np.ndarray:
    """Amplitude, frequency and phase of d1 and d2 (cases, 6)."""
    return np.concatenate([np.asarray(entry)[:, :2] for entry in inputs[1:]], axis=1)


def _sharp(x):
    """sat(x) and its slope."""
    return min(max(x, -A), A), 1.0 if abs(x) < A else 0.0


def _smooth(x):
    """The same with the corners rounded."""
    bounded = math.tanh(x / A)
    return A * bounded, 1 - bounded * bounded


@functools.cache
def compiled_rate(smooth: bool):
    """The right-hand side in machine code."""
    import numba

    saturated = numba.njit(_smooth if smooth else _sharp)

    @numba.njit
    def rate(t, y, torque, slope):
        """`work.rate` number by number, into `slope`."""
        w1, w2, z, e1, e2, p1, p2, v1, v2 = y[0], y[1], y[2], y[3], y[4], y[5], y[6], y[7], y[8]
        square = w1 * w1 + w2 * w2
        below, whole = square + WIDTH2, 1.0 + square
        q = z / below
        bounded1, inside1 = saturated(q * w2)
        bounded2, inside2 = saturated(-q * w1)
        r1 = -K3 * w1 / whole + MU * bounded1 + e1
        r2 = -K3 * w2 / whole + MU * bounded2 + e2
        dw1 = (1 + w1 * w1 - w2 * w2) * r1 / 2 + w1 * w2 * r2
        dw2 = (1 - w1 * w1 + w2 * w2) * r2 / 2 + w1 * w2 * r1
        dz = w1 * r2 - w2 * r1
        dsquare = 2 * (w1 * dw1 + w2 * dw2)
        dq = (dz - q * dsquare) / below
        slope1 = -K3 * (dw1 - w1 * dsquare / whole) / whole + MU * inside1 * (dq * w2 + q * dw2)
        slope2 = -K3 * (dw2 - w2 * dsquare / whole) / whole - MU * inside2 * (dq * w1 + q * dw1)
        f1 = -w1 * whole + w2 * z - K4 * e1 - K4 * v1
        f2 = -w2 * whole - w1 * z - K4 * e2 - K4 * v2
        u1, u2 = f1 + J1 * slope1, f2 + J2 * slope2
        slope[0], slope[1], slope[2] = dw1, dw2, dz
        slope[3] = (f1 + torque[0] * math.sin(torque[2] * t + torque[4])) / J1
        slope[4] = (f2 + torque[1] * math.sin(torque[3] * t + torque[5])) / J2
        slope[5], slope[6] = v1, v2
        slope[7], slope[8] = e1 - torque[2] ** 2 * p1, e2 - torque[3] ** 2 * p2
        slope[9] = square + z * z + 100 * (r1 * r1 + r2 * r2) + 1e-3 * (u1 * u1 + u2 * u2)

    return rate


@functools.cache
def compiled_loop(smooth: bool):
    """The loop over cases in machine code, shared out to all processors."""
    import numba

    rate = compiled_rate(smooth)

    @numba.njit(fastmath={"contract"})
    def attempt(t, y, torque, step, k, inner, after, tolerance):
        """One step: the state after it, and its error in parts of what is tolerated."""
        for stage in range(1, 7):
            target = after if stage == 6 else inner
            for j in range(SIZE):
                total = 0.0
                for i in range(stage):
                    total += STAGES[stage, i] * k[i, j]
                target[j] = y[j] + step * total
            rate(t + TIMES[stage] * step, target, torque, k[stage])
        size = 0.0
        for j in range(SIZE):
            total = 0.0
            for i in range(7):
                total += ERROR[i] * k[i, j]
            scale = tolerance * (1 + max(abs(y[j]), abs(after[j])))
            size += (step * total / scale) ** 2
        return math.sqrt(size / SIZE)

    @numba.njit
    def one(y, torque, duration, tolerance):
        k, inner, after = np.empty((7, SIZE)), np.empty(SIZE), np.empty(SIZE)
        t, step, y = 0.0, FIRST, y.copy()
        rate(t, y, torque, k[0])
        while t < duration:
            step = min(step, duration - t)
            size = attempt(t, y, torque, step, k, inner, after, tolerance)
            if size <= 1 or step < 1e-9:
                t += step
                y[:] = after
                k[0] = k[6]
            step *= min(LARGEST, max(LEAST, SAFETY * max(size, 1e-12) ** -0.2))
        return y

    @numba.njit(parallel=True)
    def many(y, torque, duration, tolerance):
        found = np.empty_like(y)
        for i in numba.prange(len(y)):
            found[i] = one(y[i], torque[i], duration, tolerance)
        return found

    return many


def adaptive(study: Study, count: int, tolerance: float) -> Run:
    """All cases."""
    inputs = starts(study, count)
    y, torque = np.asarray(inputs[0]), parameters(inputs)
    duration = float(study.program.duration)
    smooth = is_smooth(study)
    loop = compiled_loop(smooth)
    return lambda: final_state(loop(y, torque, duration, tolerance), smooth)


def contenders() -> list[Contender]:
    """The loop."""
    return [Contender("numba by hand, Dopri5 adaptive", TOLERANCES, adaptive)]
