"""Algebra of the three-axis law (40)-(42): the reference rates and their derivative, by hand.

Written for scalars so that the integrators stay quick. The law's model is the plant without
disturbance: relation (11) exact or with C_bo taken as 1, third rate free or held.
"""

import math
from typing import NamedTuple


class Law(NamedTuple):
    """Gains and model of (40)-(42); `smooth` replaces sat by a tanh(x/a), `width` guards |w|."""

    inertia: tuple
    k3: float
    k4: tuple
    mu: float
    a: float
    orbit_rate: float
    exact: bool
    held: bool
    smooth: bool = False
    width: float = 0.0


def frame_rate(law, w1, w2, z):
    """Return the orbit frame's rate in body axes, −ω0 C[:, 1] or −ω0 (0, 1, 0)."""
    if not law.exact:
        return 0.0, -law.orbit_rate, 0.0
    s, c = math.sin(z), math.cos(z)
    scale = -law.orbit_rate / (1.0 + w1 * w1 + w2 * w2)
    return (
        scale * ((1.0 + w1 * w1 - w2 * w2) * s + 2.0 * w1 * w2 * c),
        scale * (2.0 * w1 * w2 * s + (1.0 - w1 * w1 + w2 * w2) * c),
        scale * 2.0 * (w2 * s - w1 * c),
    )


def kinematics(w1, w2, r1, r2, r3):
    """Return dw1/dt, dw2/dt, dz/dt of (36)."""
    return (
        r3 * w2 + 0.5 * (1.0 + w1 * w1 - w2 * w2) * r1 + w1 * w2 * r2,
        -r3 * w1 + 0.5 * (1.0 - w1 * w1 + w2 * w2) * r2 + w1 * w2 * r1,
        r3 + w1 * r2 - w2 * r1,
    )


def sat(law, x):
    """Return sat(x, a) and its slope; the corner counts as inside."""
    if law.smooth:
        value = math.tanh(x / law.a)
        return law.a * value, 1.0 - value * value
    if abs(x) <= law.a:
        return x, 1.0
    return math.copysign(law.a, x), 0.0


def reference(law, w1, w2, z, omega3):
    """Return ω1d, ω2d of (41), their slopes in ω3, and the frame rate e.

    ω_id = ω_rid + e_i with ω_rid of (40), saturated, and q = (z + (ω3 − e3)/μ)/(|w|² + width²).
    """
    e = frame_rate(law, w1, w2, z)
    n = w1 * w1 + w2 * w2
    guarded = n + law.width**2
    q = (z + (omega3 - e[2]) / law.mu) / guarded
    value1, slope1 = sat(law, q * w2)
    value2, slope2 = sat(law, q * w1)
    desired1 = -law.k3 * w1 / (1.0 + n) + law.mu * value1 + e[0]
    desired2 = -law.k3 * w2 / (1.0 + n) - law.mu * value2 + e[1]
    return desired1, desired2, slope1 * w2 / guarded, -slope2 * w1 / guarded, e


def model_third_acceleration(law, omega1, omega2):
    """Return the law's model of dω3/dt, without disturbance."""
    j1, j2, j3 = law.inertia
    return 0.0 if law.held else (j1 - j2) * omega1 * omega2 / j3


def reference_derivative(law, w1, w2, z, omega):
    """Return dω1d/dt, dω2d/dt along the law's model, by the chain rule."""
    e1, e2, e3 = frame_rate(law, w1, w2, z)
    r1, r2, r3 = omega[0] - e1, omega[1] - e2, omega[2] - e3
    w1_rate, w2_rate, z_rate = kinematics(w1, w2, r1, r2, r3)
    if law.exact:  # a vector fixed in the orbit frame turns as e' = −ω_r × e
        e_rate = (e2 * r3 - e3 * r2, e3 * r1 - e1 * r3, e1 * r2 - e2 * r1)
    else:
        e_rate = (0.0, 0.0, 0.0)
    n = w1 * w1 + w2 * w2
    n_rate = 2.0 * (w1 * w1_rate + w2 * w2_rate)
    guarded = n + law.width**2
    q = (z + r3 / law.mu) / guarded
    r3_rate = model_third_acceleration(law, omega[0], omega[1]) - e_rate[2]
    q_rate = (z_rate + r3_rate / law.mu - q * n_rate) / guarded
    slope1 = sat(law, q * w2)[1]
    slope2 = sat(law, q * w1)[1]
    pull1 = -law.k3 * (w1_rate - w1 * n_rate / (1.0 + n)) / (1.0 + n)
    pull2 = -law.k3 * (w2_rate - w2 * n_rate / (1.0 + n)) / (1.0 + n)
    return (
        pull1 + law.mu * slope1 * (q_rate * w2 + q * w2_rate) + e_rate[0],
        pull2 - law.mu * slope2 * (q_rate * w1 + q * w1_rate) + e_rate[1],
    )


def attitude_terms(w1, w2, z):
    """Return the attitude terms of u10 and u20 in (42)."""
    n = 1.0 + w1 * w1 + w2 * w2
    return -w1 * n + w2 * z, -w2 * n - w1 * z


def torque(law, w1, w2, z, omega, alpha_dot, slope=None, weight=1.0):
    """Return u1, u2 of (42); `slope` replaces dω_d/dt and `weight` scales the attitude terms."""
    j1, j2, j3 = law.inertia
    desired1, desired2, _, _, _ = reference(law, w1, w2, z, omega[2])
    if slope is None:
        slope = reference_derivative(law, w1, w2, z, omega)
    pull1, pull2 = attitude_terms(w1, w2, z)
    return (
        weight * pull1
        - law.k4[0] * (omega[0] - desired1 + alpha_dot[0])
        - (j2 - j3) * omega[1] * omega[2]
        + j1 * slope[0],
        weight * pull2
        - law.k4[1] * (omega[1] - desired2 + alpha_dot[1])
        - (j3 - j1) * omega[2] * omega[0]
        + j2 * slope[1],
    )
