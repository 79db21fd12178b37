"""A rigid body in a circular orbit: attitude maps, kinematics (10), (11), (36) and Euler's (1).

The attitude C takes orbit-frame components to body components, v_b = C v_o. The reference
integrates all nine entries of C; (w, z) is integrated separately from (36).
"""

import math

import numpy as np

from .common import choice, march

RELATIONS = ("exact", "small-angle")


def skew(x):
    """Return the matrix of the usual cross product, skew(x) y = x × y."""
    return np.array([[0.0, -x[2], x[1]], [x[2], 0.0, -x[0]], [-x[1], x[0], 0.0]])


def dcm_from_wz(w, z):
    """Return C = C2(w) C1(z).

    C1 is the frame rotation by z about axis 3. C2 is the one about (w1, w2, 0) by 2 atan|w|,
    which has the Gibbs vector (w1, w2, 0) and so the Cayley form (1 + P)⁻¹ (1 − P).
    """
    cross = skew((w[0], w[1], 0.0))
    tilt = np.linalg.solve(np.eye(3) + cross, np.eye(3) - cross)
    turn = np.array(
        [[math.cos(z), math.sin(z), 0.0], [-math.sin(z), math.cos(z), 0.0], [0.0, 0.0, 1.0]]
    )
    return tilt @ turn


def wz_from_dcm(dcm):
    """Return (w (2,), z) of C, with z in (−pi, pi]; singular where C[2, 2] = −1."""
    third = dcm[:, 2]
    w = np.array([third[1], -third[0]]) / (1.0 + third[2])
    turn = dcm_from_wz(w, 0.0).T @ dcm
    return w, math.atan2(turn[0, 1], turn[0, 0])


def quaternion_product(p, q):
    """Return Hamilton's product of two scalar-first quaternions."""
    p0, p1, p2, p3 = p
    q0, q1, q2, q3 = q
    return np.array(
        [
            p0 * q0 - p1 * q1 - p2 * q2 - p3 * q3,
            p0 * q1 + p1 * q0 + p2 * q3 - p3 * q2,
            p0 * q2 - p1 * q3 + p2 * q0 + p3 * q1,
            p0 * q3 + p1 * q2 - p2 * q1 + p3 * q0,
        ]
    )


def quaternion_from_wz(w, z):
    """Return the scalar-first quaternion of the frame rotation: first C1(z), then C2(w)."""
    turn = (math.cos(z / 2), 0.0, 0.0, math.sin(z / 2))
    tilt = np.array((1.0, w[0], w[1], 0.0)) / math.sqrt(1.0 + w[0] ** 2 + w[1] ** 2)
    return quaternion_product(turn, tilt)


def dcm_from_quaternion(quaternion):
    """Return C of a scalar-first quaternion: rows are the body axes seen from the orbit frame."""
    q = np.asarray(quaternion, float) / np.linalg.norm(quaternion)
    conjugate = q * (1.0, -1.0, -1.0, -1.0)
    columns = [
        quaternion_product(quaternion_product(conjugate, (0.0, *axis)), q)[1:] for axis in np.eye(3)
    ]
    return np.array(columns).T


def wz_rate(w, z, omega_relative):
    """Return (dw/dt (2,), dz/dt) of (36) for the rate relative to the orbit frame."""
    w1, w2 = w
    r1, r2, r3 = omega_relative
    rate1 = r3 * w2 + (1.0 + w1**2 - w2**2) * r1 / 2 + w1 * w2 * r2
    rate2 = -r3 * w1 + (1.0 - w1**2 + w2**2) * r2 / 2 + w1 * w2 * r1
    return np.array([rate1, rate2]), r3 + w1 * r2 - w2 * r1


def frame_rate(dcm, orbit_rate, relation):
    """Return the orbit frame's angular velocity in body axes, as (11) or with C_bo taken as 1."""
    matrix = dcm if choice("relation", relation, RELATIONS) == "exact" else np.eye(3)
    return -orbit_rate * matrix[:, 1]


def constraint_torque(inertia, omega, torque):
    """Return the torque about body axis 3 that makes d(omega_3)/dt zero.

    J ω' = N + λ e3 with N = T − ω × Jω and ω3' = 0 leaves the upper 2×2 block of J for ω1', ω2';
    the third row then gives λ = J31 ω1' + J32 ω2' − N3.
    """
    net = torque - np.cross(omega, inertia @ omega)
    plane = np.linalg.solve(inertia[:2, :2], net[:2])
    return float(inertia[2, :2] @ plane - net[2])


def euler_rate(inertia, omega, torque, held_third_rate=False):
    """Return dω/dt of (1) under a body torque, with ω3 held by an ideal torque if asked."""
    net = torque - np.cross(omega, inertia @ omega)
    if held_third_rate:
        net = net + np.array([0.0, 0.0, constraint_torque(inertia, omega, torque)])
    return np.linalg.solve(inertia, net)


def _torque_at(torque, t, omega):
    return np.zeros(3) if torque is None else np.asarray(torque(t, omega), float)


def _check_held(held_third_rate, omega0):
    if held_third_rate and omega0[2] != 0.0:
        raise ValueError(f"Argument `omega0` must have a zero third entry, but got {omega0!r}.")


def integrate_free(
    times,
    *,
    inertia,
    dcm0,
    omega0,
    orbit_rate,
    relation="exact",
    torque=None,
    held_third_rate=False,
):
    """Integrate C by (10) and ω by (1) under `torque(t, omega)` -> (3,) in body axes.

    Returns C (n, 3, 3) and ω (n, 3) at `times`, the first of which is the start.
    """
    inertia = np.asarray(inertia, float)
    _check_held(held_third_rate, omega0)

    def rhs(t, y):
        dcm, omega = y[:9].reshape(3, 3), y[9:]
        relative = omega - frame_rate(dcm, orbit_rate, relation)
        omega_rate = euler_rate(inertia, omega, _torque_at(torque, t, omega), held_third_rate)
        return np.concatenate([(-skew(relative) @ dcm).ravel(), omega_rate])

    states = march(rhs, times, np.concatenate([np.ravel(dcm0), omega0]))
    return states[:, :9].reshape(-1, 3, 3), states[:, 9:]


def integrate_wz(
    times,
    *,
    inertia,
    w0,
    z0,
    omega0,
    orbit_rate,
    relation="exact",
    torque=None,
    held_third_rate=False,
):
    """Integrate (w, z) by (36) and ω by (1) under `torque(t, omega)` -> (3,) in body axes.

    Returns w (n, 2), z (n,), unwrapped, and ω (n, 3). Singular upside down.
    """
    inertia = np.asarray(inertia, float)
    _check_held(held_third_rate, omega0)

    def rhs(t, y):
        w, z, omega = y[:2], y[2], y[3:]
        relative = omega - frame_rate(dcm_from_wz(w, z), orbit_rate, relation)
        w_rate, z_rate = wz_rate(w, z, relative)
        omega_rate = euler_rate(inertia, omega, _torque_at(torque, t, omega), held_third_rate)
        return np.concatenate([w_rate, [z_rate], omega_rate])

    states = march(rhs, times, np.concatenate([w0, [z0], omega0]))
    return states[:, :2], states[:, 2], states[:, 3:]
