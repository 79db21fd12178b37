"""The work, written out by hand: scenario benchmark-three-axis in its error coordinates.

The state is w1 w2 z, η1 η2, the internal model's p1 p2 v1 v2 and the cost; ω3 is held at zero.
The law is the printed one, whose sat has corners, or with `saturation_width` 1 the smooth one, in
which a tanh(x / a) takes its place.
Equations (11), (40)-(42) of Wang, Jia, Jin, Xu, Acta Astronautica 83 (2013) 44-53.
"""

import jax
import jax.numpy as jnp
import numpy as np

from jaxsat.studies.ensemble import Study

J1, J2 = 449.5, 264.6
K3, MU, A, K4, WIDTH2 = 0.05, 1.0, 0.1, 0.01, 1e-4
GAINS = (K3, MU, A, K4)
ORBIT_RATE = 0.0011
SIZE = 10


def is_smooth(study: Study) -> bool:
    """Whether the study's law is the smooth one."""
    width = study.case_factory.loop.law.saturation_width
    assert width is None or float(width) == 1.0
    return width is not None


def saturated(x, smooth: bool, a=A):
    """sat(x) and its slope in JAX."""
    if smooth:
        bounded = jnp.tanh(x / a)
        return a * bounded, 1 - bounded**2
    return jnp.clip(x, -a, a), jnp.where(jnp.abs(x) < a, 1.0, 0.0)


def rate(t, y, amplitude, frequency, phase, smooth: bool, gains=GAINS):
    """dy/dt in JAX; `gains` are k3, mu, a and k4."""
    k3, mu, a, k4 = gains
    w1, w2, z, e1, e2, p1, p2, v1, v2 = y[:9]
    square = w1 * w1 + w2 * w2
    below, whole = square + WIDTH2, 1 + square
    q = z / below
    bounded1, inside1 = saturated(q * w2, smooth, a)
    bounded2, inside2 = saturated(-q * w1, smooth, a)
    r1 = -k3 * w1 / whole + mu * bounded1 + e1
    r2 = -k3 * w2 / whole + mu * bounded2 + e2
    dw1 = (1 + w1 * w1 - w2 * w2) * r1 / 2 + w1 * w2 * r2
    dw2 = (1 - w1 * w1 + w2 * w2) * r2 / 2 + w1 * w2 * r1
    dz = w1 * r2 - w2 * r1
    dsquare = 2 * (w1 * dw1 + w2 * dw2)
    dq = (dz - q * dsquare) / below
    slope1 = -k3 * (dw1 - w1 * dsquare / whole) / whole + mu * inside1 * (dq * w2 + q * dw2)
    slope2 = -k3 * (dw2 - w2 * dsquare / whole) / whole - mu * inside2 * (dq * w1 + q * dw1)
    f1 = -w1 * whole + w2 * z - k4 * e1 - k4 * v1
    f2 = -w2 * whole - w1 * z - k4 * e2 - k4 * v2
    d1, d2 = (amplitude[i] * jnp.sin(frequency[i] * t + phase[i]) for i in range(2))
    u1, u2 = f1 + J1 * slope1, f2 + J2 * slope2
    cost = square + z * z + 100 * (r1 * r1 + r2 * r2) + 1e-3 * (u1 * u1 + u2 * u2)
    return jnp.stack(
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


def reference(y, gains=GAINS):
    """The smooth law's reference rate (2,) in states (10,), without the orbit's."""
    k3, mu, a, _ = gains
    w1, w2, z = y[:3]
    square = w1 * w1 + w2 * w2
    q = z / (square + WIDTH2)
    bounded = saturated(q * jnp.stack([w2, -w1]), True, a)[0]
    return mu * bounded - k3 / (1 + square) * y[:2]


def starts(study: Study, count: int):
    """Start (cases, 10) and amplitude, frequency and phase (cases, 3) of the first cases."""
    copies = jax.jit(jax.vmap(study.case_factory))(study.cases(np.arange(count)))
    attitude = copies.start.attitude
    error = copies.drawn["rate_error"]
    zero = jnp.zeros((count, 5))
    y = jnp.concatenate([attitude.w, attitude.z[:, None], error, zero], axis=1)
    torque = copies.loop.plant.disturbance
    return y, torque.amplitude, torque.frequency, torque.phase


def final_state(y, smooth: bool):
    """w1 w2 z, ω1 ω2 and the cost (cases, 6) from states of `rate`."""
    y = np.asarray(y)
    w1, w2, z, e1, e2 = y.T[:5]
    square = w1 * w1 + w2 * w2
    q = z / (square + WIDTH2)
    bound = (lambda x: A * np.tanh(x / A)) if smooth else (lambda x: np.clip(x, -A, A))
    r1 = -K3 * w1 / (1 + square) + MU * bound(q * w2) + e1
    r2 = -K3 * w2 / (1 + square) + MU * bound(-q * w1) + e2
    return np.stack([w1, w2, z, r1, r2 - ORBIT_RATE, y.T[9]], axis=1)


def errors(found, truth, start):
    """Every case's error: attitude and rates in parts of the size at the start, cost of itself."""
    off = np.abs(found - truth)
    attitude = off[:, :3].max(axis=1) / np.linalg.norm(start[:, :3], axis=1)
    rates = off[:, 3:5].max(axis=1) / np.linalg.norm(start[:, 3:5], axis=1)
    return np.max([attitude, rates, off[:, 5] / truth[:, 5]], axis=0)
