"""The sampled switching loop: (38)-(39) while |ω3| is large, (41)-(42) otherwise.

Torque is held over each control period and the plant is integrated by classical RK4 substeps.
"""

import math
from typing import NamedTuple

import numpy as np

from . import rate_law
from . import three_axis_reference as algebra
from .common import choice, periodic
from .rigid_body import (
    RELATIONS,
    dcm_from_quaternion,
    dcm_from_wz,
    euler_rate,
    frame_rate,
    quaternion_from_wz,
    skew,
    wz_from_dcm,
)

THREE_AXIS, RATE = 0, 1


class SampledRun(NamedTuple):
    """States at the samples t_k = k h; torque[k] and mode[k] hold over [t_k, t_k + h)."""

    times: np.ndarray  # (n + 1,)
    dcm: np.ndarray  # (n + 1, 3, 3)
    w: np.ndarray  # (n + 1, 2)
    z: np.ndarray  # (n + 1,), in (−pi, pi]
    omega: np.ndarray  # (n + 1, 3)
    torque: np.ndarray  # (n, 2)
    mode: np.ndarray  # (n,), 0 three-axis law, 1 rate law
    reference: np.ndarray  # (n, 2), ω1d, ω2d or ω1a, ω2a
    slope: np.ndarray  # (n, 2), the clipped backward difference


class Controller:
    """The sampled law with its memory: mode and last reference."""

    def __init__(self, law, k1, k2, weight, enter, leave, slope_limits, torque_limit, period):
        self.law, self.k1, self.k2, self.weight = law, k1, k2, weight
        self.enter, self.leave = enter, leave
        self.slope_limits = {
            mode: np.broadcast_to(limit, (2,)) for mode, limit in slope_limits.items()
        }
        self.torque_limit, self.period = torque_limit, period
        self.mode, self.last = THREE_AXIS, None

    def next_mode(self, omega3):
        """Return the mode by hysteresis on |ω3|; both thresholds are strict."""
        if self.mode == THREE_AXIS and abs(omega3) > self.enter:
            return RATE
        if self.mode == RATE and abs(omega3) < self.leave:
            return THREE_AXIS
        return self.mode

    def step(self, w, z, omega):
        """Return the torque for the coming period, the reference and its slope."""
        mode = self.next_mode(omega[2])
        if mode != self.mode:
            self.mode, self.last = mode, None
        if mode == RATE:
            desired = np.array(rate_law.reference(self.law.inertia, self.k1, omega[2]))
        else:
            desired = np.array(algebra.reference(self.law, *w, z, omega[2])[:2])
        slope = np.zeros(2) if self.last is None else (desired - self.last) / self.period
        slope = np.clip(slope, -self.slope_limits[mode], self.slope_limits[mode])
        self.last = desired
        if mode == RATE:
            wanted = self._rate_torque(omega, desired, slope)
        else:
            wanted = algebra.torque(self.law, *w, z, omega, (0.0, 0.0), slope, self.weight)
        return np.clip(wanted, -self.torque_limit, self.torque_limit), desired, slope

    def _rate_torque(self, omega, desired, slope):
        j1, j2, j3 = self.law.inertia
        return (
            j1 * (slope[0] - self.k2 * (omega[0] - desired[0])) - (j2 - j3) * omega[1] * omega[2],
            j2 * (slope[1] - self.k2 * (omega[1] - desired[1])) - (j3 - j1) * omega[2] * omega[0],
        )


def _quaternion_rate(q, rate):
    """Return q' of a scalar-first quaternion for a rate in body axes."""
    scalar, vector = q[0], q[1:]
    return 0.5 * np.concatenate(
        [[-vector @ rate], scalar * rate + np.cross(vector, rate)],
    )


class _Attitude(NamedTuple):
    """Either parameterisation as a flat vector: its start, its rate and its map to C."""

    start: np.ndarray
    rate: object
    dcm: object


def _attitude(kind, w0, z0):
    if kind == "dcm":
        return _Attitude(
            dcm_from_wz(w0, z0).ravel(),
            lambda y, rate: (-skew(rate) @ y.reshape(3, 3)).ravel(),
            lambda y: y.reshape(3, 3),
        )
    return _Attitude(quaternion_from_wz(w0, z0), _quaternion_rate, dcm_from_quaternion)


def _rk4(rhs, t, y, step):
    a = rhs(t, y)
    b = rhs(t + step / 2, y + step / 2 * a)
    c = rhs(t + step / 2, y + step / 2 * b)
    d = rhs(t + step, y + step * c)
    return y + step / 6 * (a + 2 * b + 2 * c + d)


def simulate_switched_sampled(
    *,
    period,
    steps,
    substeps,
    inertia,
    k1,
    k2,
    k3,
    mu,
    a,
    k4,
    enter,
    leave,
    w0,
    z0,
    omega0,
    orbit_rate,
    slope_limit_three_axis=(math.inf, math.inf),
    slope_limit_rate=(math.inf, math.inf),
    attitude_weight=1.0,
    torque_limit=math.inf,
    model_inertia=None,
    relation="exact",
    model_relation=None,
    model_orbit_rate=None,
    amplitude=(0.0, 0.0, 0.0),
    frequency=(1.0, 1.0, 1.0),
    phase=(0.0, 0.0, 0.0),
    attitude="quaternion",
    smooth=False,
    width=0.0,
):
    """Run the loop for `steps` periods from t = 0, ω3 free, state measured without error.

    `inertia` of the plant is (3,) or (3, 3); the law knows the diagonal `model_inertia` (by
    default the plant's diagonal), `model_relation` and `model_orbit_rate` (by default the
    plant's). k4 (2,) is per axis; the limits are per axis or one number. The law's references
    have no derivative at the first sample and at the first after a change of mode.
    """
    plant = np.asarray(inertia, float)
    plant = np.diag(plant) if plant.ndim == 1 else plant
    known = np.diag(plant) if model_inertia is None else model_inertia
    seen = choice(
        "model_relation", relation if model_relation is None else model_relation, RELATIONS
    )
    law = algebra.Law(
        inertia=tuple(float(j) for j in known),
        k3=k3,
        k4=tuple(float(k) for k in np.broadcast_to(k4, (2,))),
        mu=mu,
        a=a,
        orbit_rate=orbit_rate if model_orbit_rate is None else model_orbit_rate,
        exact=seen == "exact",
        held=False,
        smooth=smooth,
        width=width,
    )
    slope_limits = {THREE_AXIS: slope_limit_three_axis, RATE: slope_limit_rate}
    controller = Controller(
        law, k1, k2, attitude_weight, enter, leave, slope_limits, torque_limit, period
    )
    maps = _attitude(choice("attitude", attitude, ("quaternion", "dcm")), w0, z0)
    size = len(maps.start)

    def rhs(t, y, u):
        relative = y[size:] - frame_rate(maps.dcm(y[:size]), orbit_rate, relation)
        total = np.array([u[0], u[1], 0.0]) + periodic(t, amplitude, frequency, phase)
        return np.concatenate([maps.rate(y[:size], relative), euler_rate(plant, y[size:], total)])

    y = np.concatenate([maps.start, omega0])
    states, log = [y], []
    for k in range(steps):
        w, z = wz_from_dcm(maps.dcm(y[:size]))
        u, desired, slope = controller.step(w, z, y[size:])
        log.append((u, controller.mode, desired, slope))
        for i in range(substeps):
            start = k * period + i * period / substeps
            y = _rk4(lambda t, y, u=u: rhs(t, y, u), start, y, period / substeps)
        states.append(y)
    return _result(period, maps, size, states, log)


def _result(period, maps, size, states, log):
    dcm = np.array([maps.dcm(y[:size]) for y in states])
    wz = [wz_from_dcm(c) for c in dcm]
    columns = [np.array(column) for column in zip(*log, strict=True)]
    return SampledRun(
        period * np.arange(len(states)),
        dcm,
        np.array([w for w, _ in wz]),
        np.array([z for _, z in wz]),
        np.array([y[size:] for y in states]),
        *columns,
    )
