"""A gyrostat with magnetorquers, its steering and quaternion feedback; SciPy between the samples.

Nothing is shared with jaxsat. Attitudes are rotation matrices, C takes orbit to body components.
"""

from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import null_space
from scipy.optimize import linprog
from scipy.spatial.transform import Rotation

from oracle import orbital_torques as earth


def field(t, orbit):
    """Return the field in orbit axes, T, in closed form: (R/r)³ (3 (m·r̂) r̂ - m)."""
    position, velocity = earth.place(t, *orbit[:4])
    spin = Rotation.from_euler("Z", orbit[4] + earth.EARTH_ROTATION * t)
    m = spin.apply([earth.G11, earth.H11, earth.G10])
    r = np.linalg.norm(position)
    up = position / r
    inertial = (earth.A / r) ** 3 * (3 * (m @ up) * up - m)
    return earth.orbit_axes(position, velocity) @ inertial


def cross(x):
    """Return the matrix of x × ."""
    return np.array([[0, -x[2], x[1]], [x[2], 0, -x[0]], [-x[1], x[0], 0]])


def law(c, omega, inertia, rate, frequency, damping):
    """Return the torque of quaternion feedback, N m."""
    frame = c @ [0, -rate, 0]
    relative = omega - frame
    x, y, z, w = Rotation.from_matrix(c.T).as_quat()
    wanted = -(frequency / damping) * np.sign(w) * np.array([x, y, z])
    pull = 2 * damping * frequency * (relative - wanted)
    return np.cross(omega, inertia @ omega) + inertia @ (np.cross(frame, relative) - pull)


def dipole_of(command, b, axes, limits, working):
    """Return what is asked of each magnetorquer for what of a torque τ is across the field b.

    As much of it as the limits allow, by the least sum of squares of dipole over limit: what three
    of them may change without an effect on the torque is along one direction.
    """
    asked = np.zeros(axes.shape[1])
    asked[working] = np.linalg.pinv(axes[:, working]) @ np.cross(b, command) / (b @ b)
    idle = np.zeros(axes.shape[1])
    made = cross(b / np.linalg.norm(b)) @ axes[:, working]
    idle[working] = null_space(made, rcond=1e-9).sum(axis=1)
    if not np.any(idle):
        return asked * min(1.0, *(limits / np.maximum(np.abs(asked), 1e-300)))
    bounds = np.concatenate([limits, limits])
    changes = np.column_stack([asked, idle])
    found = linprog(
        [-1.0, 0.0], np.vstack([changes, -changes]), bounds, bounds=[(0, 1), (None, None)]
    )
    assert found.status == 0
    part = found.x[0]
    ends = (np.array([[-1.0], [1.0]]) * limits - part * asked)[:, idle != 0] / idle[idle != 0]
    low, high = np.max(ends.min(axis=0), initial=-np.inf), np.min(ends.max(axis=0), initial=np.inf)
    least = -part * np.sum(asked * idle / limits**2) / np.sum((idle / limits) ** 2)
    return part * asked + np.clip(least, low, max(low, high)) * idle


def after(asked, limits, failures, t):
    """Return the dipoles that failed magnetorquers make."""
    made = np.clip(asked, -limits, limits)
    for at, which, kind, amount in failures:
        if t >= at:
            made[which] = {
                "dead": 0.0,
                "degraded": amount * made[which],
                "stuck-at": amount * limits[which],
                "reversed": -made[which],
            }[kind]
    return made


def fly(c, omega, momenta, count, period, *, inertia, orbit, torquers, wheels, gains, failures=()):
    """Return rows of C, ω, h at each sample, and the dipoles there.

    `torquers` are axes and limits, `wheels` axes (3, n) and the unloading gain; `gains` those of
    the law. Wheels make what they can of the law's torque, by least squares.
    """
    (axes, limits), (spun, unloading) = torquers, wheels
    everyone = np.arange(axes.shape[1])
    share = np.linalg.pinv(spun) if spun.size else np.zeros((0, 3))
    left = np.eye(3) - spun @ share
    y = np.concatenate([np.ravel(c), omega, momenta])
    rows, dipoles = [y], []
    for number in range(count):
        t, end = number * period, (number + 1) * period
        c, omega, h = y[:9].reshape(3, 3), y[9:12], y[12:]
        torque = law(c, omega, inertia, orbit[0], *gains) + np.cross(omega, spun @ h)
        b = c @ field(t, orbit)
        asked = dipole_of(left @ torque - unloading * spun @ h, b, axes, limits, everyone)
        u = share @ (torque - np.cross(axes @ asked, b))
        edges = [t, *sorted(at for at, *_ in failures if t < at < end), end]
        dipoles.append(after(asked, limits, failures, t))
        for begin, stop in pairwise(edges):
            m = axes @ after(asked, limits, failures, begin)

            def rate(now, y, m=m, u=u):
                c, omega, h = y[:9].reshape(3, 3), y[9:12], y[12:]
                total = np.cross(m, c @ field(now, orbit)) + spun @ u
                total = total - np.cross(omega, inertia @ omega + spun @ h)
                turning = cross(omega - c @ [0, -orbit[0], 0])
                return np.concatenate([(-turning @ c).ravel(), np.linalg.solve(inertia, total), -u])

            run = solve_ivp(rate, (begin, stop), y, method="DOP853", rtol=1e-12, atol=1e-16)
            y = run.y[:, -1]
        rows.append(y)
    return np.array(rows), np.array(dipoles)
