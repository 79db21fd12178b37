"""The rate law (38)-(39) on the plant (37), integrated exactly through zeros of omega_3.

The reference rates hold √|ω3|, so the right-hand side is not Lipschitz where ω3 crosses zero and,
with a d3 the law does not know, infinite there. Two changes of variable remove both:
    s = sgn(ω3) √|ω3|,   η_i = ω_i − ω_ia,   dt = g dτ,   g = |s|/(|s| + m/v),   m = √(F² + (c s²)²)
with F = dω3/dt. Then ds/dτ = F/(2 (|s| + m/v)) passes through zero at a finite speed and every rate
is analytic while the sign of s is fixed, so a run is a chain of pieces between located zeros.
Where ω3 decays without a crossing (d3 = 0), m = O(s²) and τ is as good as t.
"""

import math
from typing import NamedTuple

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq

from .common import periodic

SPEED = 0.1  # v above, √(rad/s) per second
DECAY = 1.0  # c above, 1/s
MAX_STEP = 0.25  # s; keeps the interpolant as good as the steps


class RateRun(NamedTuple):
    """A run of the rate law; `crossings` are the times at which ω3 changes sign."""

    times: np.ndarray  # (n,)
    omega: np.ndarray  # (n, 3)
    torque: np.ndarray  # (n, 2)
    crossings: np.ndarray  # (m,)


def reference(inertia, k1, omega3):
    """Return ω1a, ω2a of (38)."""
    root = math.sqrt(abs(omega3))
    sign = math.copysign(1.0, inertia[0] - inertia[1]) if inertia[0] != inertia[1] else 0.0
    return -sign * math.copysign(root, omega3), k1 * root


def reference_derivative(inertia, k1, omega3, omega3_rate):
    """Return the derivative of (38) along a given dω3/dt, zero at ω3 = 0."""
    if omega3 == 0.0:
        return 0.0, 0.0
    half = omega3_rate / (2.0 * math.sqrt(abs(omega3)))
    sign = math.copysign(1.0, inertia[0] - inertia[1]) if inertia[0] != inertia[1] else 0.0
    return -sign * half, k1 * math.copysign(half, omega3 * omega3_rate)


def torque(inertia, k1, k2, omega, disturbance, measured):
    """Return u1, u2 of (39); `disturbance` enters on the axes that `measured` marks."""
    j1, j2, j3 = inertia
    d1, d2, d3 = (d if m else 0.0 for d, m in zip(disturbance, measured, strict=True))
    desired1, desired2 = reference(inertia, k1, omega[2])
    third = ((j1 - j2) * omega[0] * omega[1] + d3) / j3
    slope1, slope2 = reference_derivative(inertia, k1, omega[2], third)
    return (
        -k2 * j1 * (omega[0] - desired1) - (j2 - j3) * omega[1] * omega[2] - d1 + j1 * slope1,
        -k2 * j2 * (omega[1] - desired2) - (j3 - j1) * omega[2] * omega[0] - d2 + j2 * slope2,
    )


def direct_rate(t, omega, *, inertia, k1, k2, amplitude, frequency, phase, measured):
    """Return dω/dt of (37) under (39) in plain variables, as a cross-check."""
    j1, j2, j3 = inertia
    d = periodic(t, amplitude, frequency, phase)
    u1, u2 = torque(inertia, k1, k2, omega, d, measured)
    o1, o2, o3 = omega
    return (
        ((j2 - j3) * o2 * o3 + u1 + d[0]) / j1,
        ((j3 - j1) * o3 * o1 + u2 + d[1]) / j2,
        ((j1 - j2) * o1 * o2 + d[2]) / j3,
    )


def _piece(y0, side, end, inertia, k1, k2, disturbance, measured, rtol, atol):
    """Integrate (s, η1, η2, t) over τ while s keeps the sign `side`, or to t = `end`.

    With ω3' unknown by d3/J3 to the law, η_i' holds −ω_ia'(ω3) d3/J3; times g = |s|/(…) the
    1/(2|s|) of ω_ia' cancels.
    """
    j1, j2, j3 = inertia
    sign = math.copysign(1.0, j1 - j2) if j1 != j2 else 0.0

    def rates(tau, y):
        s, eta1, eta2, t = (float(value) for value in y)
        size = side * s
        d1, d2, d3 = periodic(t, *disturbance)
        force = ((j1 - j2) * (eta1 - sign * s) * (eta2 + k1 * size) + d3) / j3
        spread = size + math.hypot(force, DECAY * s * s) / SPEED
        left1 = 0.0 if measured[0] else d1 / j1
        left2 = 0.0 if measured[1] else d2 / j2
        left3 = 0.0 if measured[2] else d3 / (2.0 * j3)
        return (
            force / (2.0 * spread),
            (size * (left1 - k2 * eta1) + sign * left3) / spread,
            (size * (left2 - k2 * eta2) - k1 * side * left3) / spread,
            size / spread,
        )

    def zero(tau, y):
        return y[0]

    def over(tau, y):
        return y[3] - end

    zero.terminal, zero.direction = True, -side
    over.terminal, over.direction = True, 1.0
    return solve_ivp(
        rates,
        (0.0, math.inf),
        y0,
        method="DOP853",
        rtol=rtol,
        atol=atol,
        max_step=MAX_STEP,
        dense_output=True,
        events=(zero, over),
    )


def _start_side(s0, y0, inertia, disturbance):
    """Return the sign of s just after the start."""
    if s0 != 0.0:
        return math.copysign(1.0, s0)
    j1, j2, _ = inertia
    force = (j1 - j2) * y0[1] * y0[2] + periodic(y0[3], *disturbance)[2]
    if force == 0.0:
        raise ValueError("Argument `omega0` must not start with ω3 = 0 and dω3/dt = 0.")
    return math.copysign(1.0, force)


def _collect(solution, times):
    """Return the states of one piece at `times`, by inverting its t(τ)."""
    nodes, clock = solution.t, solution.y[3]
    rows = []
    for t in times:
        k = int(np.clip(np.searchsorted(clock, t) - 1, 0, len(nodes) - 2))
        low, high = nodes[k], nodes[k + 1]
        offset = [solution.sol(x)[3] - t for x in (low, high)]
        if offset[0] >= 0.0:
            tau = low
        elif offset[1] <= 0.0:
            tau = high
        else:
            tau = brentq(lambda x, t=t: solution.sol(x)[3] - t, low, high, xtol=1e-15, rtol=1e-14)
        rows.append(solution.sol(tau))
    return rows


def simulate_rate_law(
    times,
    *,
    inertia,
    k1,
    k2,
    omega0,
    amplitude=(0.0, 0.0, 0.0),
    frequency=(1.0, 1.0, 1.0),
    phase=(0.0, 0.0, 0.0),
    measured=(True, True, False),
    rtol=1e-13,
    atol=1e-15,
):
    """Integrate ω of (37) under the hard law (38)-(39) from times[0].

    `measured[i]` for i = 0, 1 feeds −d_i forward in (39); `measured[2]` lets d3 enter the law's
    ω3' in the derivative of the reference. That derivative is zero at ω3 = 0.
    """
    inertia = tuple(float(j) for j in inertia)
    times = np.asarray(times, float)
    disturbance = (amplitude, frequency, phase)
    desired = reference(inertia, k1, omega0[2])
    s0 = math.copysign(math.sqrt(abs(omega0[2])), omega0[2])
    y = np.array([s0, omega0[0] - desired[0], omega0[1] - desired[1], times[0]])
    side = _start_side(s0, y, inertia, disturbance)
    end = math.nextafter(times[-1], math.inf)
    rows, crossings = [y.copy()], []
    while len(rows) < len(times):
        run = _piece(y, side, end, inertia, k1, k2, disturbance, measured, rtol, atol)
        if run.status != 1:
            raise RuntimeError(f"DOP853 stopped: {run.message}")
        y = run.y[:, -1].copy()
        waiting = times[len(rows) :]
        rows += _collect(run, waiting[waiting <= y[3]])
        if run.t_events[0].size:
            crossings.append(y[3])
            y[0], side = 0.0, -side
    s, eta = np.array(rows)[:, 0], np.array(rows)[:, 1:3]
    omega = np.column_stack([eta, s * np.abs(s)])
    for i in range(len(times)):
        omega[i, :2] += reference(inertia, k1, omega[i, 2])
    u = [
        torque(inertia, k1, k2, row, periodic(t, *disturbance), measured)
        for t, row in zip(times, omega, strict=True)
    ]
    return RateRun(times, omega, np.array(u), np.array(crossings))
