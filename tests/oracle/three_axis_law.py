"""The three-axis law (40)-(43): error coordinates with hard sat, torque level with smooth sat."""

import math
from typing import NamedTuple

import numpy as np

from . import three_axis_reference as algebra
from .common import ATOL, RTOL, choice, march, periodic
from .rigid_body import RELATIONS

THIRD_RATES = ("held", "free")


class ThreeAxisRun(NamedTuple):
    """A run of the three-axis law; `lyapunov` is V of the proof after (43)."""

    times: np.ndarray  # (n,)
    w: np.ndarray  # (n, 2)
    z: np.ndarray  # (n,)
    omega: np.ndarray  # (n, 3)
    torque: np.ndarray  # (n, 2)
    eta: np.ndarray  # (n, 2)
    alpha: np.ndarray  # (n, 2)
    alpha_dot: np.ndarray  # (n, 2)
    lyapunov: np.ndarray  # (n,)


def lyapunov(law, w, z, eta, alpha, alpha_dot, t, amplitude, frequency, phase, model_frequency):
    """Return V of the proof after (43); the theta terms only with an internal model.

    k4 θ' = k4 α' − d and θ'' + Ω² θ = η make α − θ the integral of d/k4 that solves the free
    oscillator: θ = α + a cos(Ωt + φ)/(k4 Ω). `model_frequency` None means no internal model.
    """
    value = w[0] ** 2 + w[1] ** 2 + 0.5 * z**2
    for i in range(2):
        value += 0.5 * law.inertia[i] * eta[i] ** 2
        if model_frequency is None or law.k4[i] == 0.0:
            continue
        angle = frequency[i] * t + phase[i]
        theta, theta_dot = alpha[i], alpha_dot[i]
        if amplitude[i] != 0.0:
            theta_dot -= amplitude[i] * math.sin(angle) / law.k4[i]
            if frequency[i] != 0.0:  # otherwise the term's factor Ω² vanishes
                theta += amplitude[i] * math.cos(angle) / (law.k4[i] * frequency[i])
        value += 0.5 * law.k4[i] * (theta_dot**2 + (model_frequency[i] * theta) ** 2)
    return value


def _law(inertia, k3, k4, mu, a, orbit_rate, relation, third_rate, **smoothing):
    return algebra.Law(
        inertia=tuple(float(j) for j in inertia),
        k3=k3,
        k4=tuple(float(k) for k in np.broadcast_to(k4, (2,))),
        mu=mu,
        a=a,
        orbit_rate=orbit_rate,
        exact=choice("relation", relation, RELATIONS) == "exact",
        held=choice("third_rate", third_rate, THIRD_RATES) == "held",
        **smoothing,
    )


def _internal_model(internal_model, internal_model_frequency, frequency):
    if not internal_model:
        return None
    chosen = frequency[:2] if internal_model_frequency is None else internal_model_frequency
    return tuple(float(f) for f in chosen)


def _oscillators(model_frequency, eta, states):
    """Return d/dt of (α1, α1', α2, α2') of (42), zero without an internal model."""
    if model_frequency is None:
        return 0.0, 0.0, 0.0, 0.0
    return (
        states[1],
        eta[0] - model_frequency[0] ** 2 * states[0],
        states[3],
        eta[1] - model_frequency[1] ** 2 * states[2],
    )


def _plain(states):
    return [float(value) for value in states]


def simulate_three_axis(
    times,
    *,
    inertia,
    k3,
    k4,
    mu,
    a,
    w0,
    z0,
    omega0,
    orbit_rate,
    relation="small-angle",
    third_rate="held",
    amplitude=(0.0, 0.0, 0.0),
    frequency=(1.0, 1.0, 1.0),
    phase=(0.0, 0.0, 0.0),
    internal_model=True,
    internal_model_frequency=None,
    rtol=RTOL,
    atol=ATOL,
    max_step=math.inf,
):
    """Integrate (w, z, η1, η2, ω3, α, α') with the hard sat by component and unlimited torque.

    With (42) on the plant, J_i η_i' = attitude terms − k4 (η_i + α_i') + d_i
    + J_i (ω_id' of the law's model − ω_id' of the plant). Model and plant differ only in
    ω3' by d3/J3, so the last bracket is −(∂ω_id/∂ω3) d3/J3, and zero when ω3 is held.
    """
    law = _law(inertia, k3, k4, mu, a, orbit_rate, relation, third_rate)
    oscillator = _internal_model(internal_model, internal_model_frequency, frequency)
    j1, j2, j3 = law.inertia
    k41, k42 = law.k4

    def rhs(t, y):
        w1, w2, z, eta1, eta2, omega3, *alphas = _plain(y)
        desired1, desired2, slope1, slope2, e = algebra.reference(law, w1, w2, z, omega3)
        omega1, omega2 = eta1 + desired1, eta2 + desired2
        rates = algebra.kinematics(w1, w2, omega1 - e[0], omega2 - e[1], omega3 - e[2])
        d1, d2, d3 = periodic(t, amplitude, frequency, phase)
        unseen = 0.0 if law.held else d3 / j3
        pull1, pull2 = algebra.attitude_terms(w1, w2, z)
        return (
            *rates,
            (pull1 - k41 * (eta1 + alphas[1]) + d1) / j1 - slope1 * unseen,
            (pull2 - k42 * (eta2 + alphas[3]) + d2) / j2 - slope2 * unseen,
            algebra.model_third_acceleration(law, omega1, omega2) + unseen,
            *_oscillators(oscillator, (eta1, eta2), alphas),
        )

    desired = algebra.reference(law, *_plain((*w0, z0, omega0[2])))
    eta0 = (omega0[0] - desired[0], omega0[1] - desired[1])
    start = (*w0, z0, *eta0, omega0[2], 0.0, 0.0, 0.0, 0.0)
    states = march(rhs, times, start, rtol=rtol, atol=atol, max_step=max_step)
    omega = states[:, 3:6].copy()
    for i, y in enumerate(states):
        omega[i, :2] += algebra.reference(law, *_plain((*y[:3], y[5])))[:2]
    return _result(law, times, states, omega, (amplitude, frequency, phase), oscillator, math.inf)


def simulate_three_axis_smooth(
    times,
    *,
    inertia,
    k3,
    k4,
    mu,
    a,
    w0,
    z0,
    omega0,
    orbit_rate,
    width,
    relation="small-angle",
    third_rate="held",
    amplitude=(0.0, 0.0, 0.0),
    frequency=(1.0, 1.0, 1.0),
    phase=(0.0, 0.0, 0.0),
    internal_model=True,
    internal_model_frequency=None,
    torque_limit=math.inf,
    rtol=RTOL,
    atol=ATOL,
    max_step=math.inf,
):
    """Integrate (w, z, ω, α, α') with u of (42) applied to the plant (37).

    sat(x, a) is a tanh(x/a), |w|² in q is |w|² + width², and u is clipped to ±torque_limit.
    """
    law = _law(inertia, k3, k4, mu, a, orbit_rate, relation, third_rate, smooth=True, width=width)
    oscillator = _internal_model(internal_model, internal_model_frequency, frequency)
    j1, j2, j3 = law.inertia

    def rhs(t, y):
        w1, w2, z, *rest = _plain(y)
        omega, alphas = rest[:3], rest[3:]
        desired1, desired2, _, _, e = algebra.reference(law, w1, w2, z, omega[2])
        wz_rates = algebra.kinematics(w1, w2, omega[0] - e[0], omega[1] - e[1], omega[2] - e[2])
        wanted = algebra.torque(law, w1, w2, z, omega, (alphas[1], alphas[3]))
        u1, u2 = (min(max(u, -torque_limit), torque_limit) for u in wanted)
        d1, d2, d3 = periodic(t, amplitude, frequency, phase)
        third = algebra.model_third_acceleration(law, omega[0], omega[1])
        return (
            *wz_rates,
            ((j2 - j3) * omega[1] * omega[2] + u1 + d1) / j1,
            ((j3 - j1) * omega[2] * omega[0] + u2 + d2) / j2,
            third + (0.0 if law.held else d3 / j3),
            *_oscillators(oscillator, (omega[0] - desired1, omega[1] - desired2), alphas),
        )

    start = (*w0, z0, *omega0, 0.0, 0.0, 0.0, 0.0)
    states = march(rhs, times, start, rtol=rtol, atol=atol, max_step=max_step)
    disturbance = (amplitude, frequency, phase)
    return _result(law, times, states, states[:, 3:6], disturbance, oscillator, torque_limit)


def _result(law, times, states, omega, disturbance, oscillator, limit):
    """Derive torque, η and V at the output times from integrated states."""
    w, z = states[:, :2], states[:, 2]
    alpha, alpha_dot = states[:, [6, 8]], states[:, [7, 9]]
    torque, eta, value = np.empty((len(z), 2)), np.empty((len(z), 2)), np.empty(len(z))
    for i, t in enumerate(times):
        place = _plain((*w[i], z[i]))
        torque[i] = algebra.torque(law, *place, _plain(omega[i]), _plain(alpha_dot[i]))
        eta[i] = omega[i, :2] - algebra.reference(law, *place, float(omega[i, 2]))[:2]
        value[i] = lyapunov(
            law, w[i], z[i], eta[i], alpha[i], alpha_dot[i], t, *disturbance, oscillator
        )
    torque = np.clip(torque, -limit, limit)
    times = np.asarray(times, float)
    return ThreeAxisRun(times, w, z, omega, torque, eta, alpha, alpha_dot, value)
