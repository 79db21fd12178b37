"""A gyrostat: a body with wheels that have friction and limits, under commands that are held.

Nothing is shared with jaxsat. Wheels are followed one event at a time: SciPy's events find the
instants at which one comes to rest or to its limit, and an explicit list says how each moves.
"""

import numpy as np
from scipy.integrate import solve_ivp


def wheel_motion(momentum, command, wheel):
    """Return how a wheel moves: "stuck", "limited" or the sign of its momentum's side."""
    drive = np.clip(command, -wheel["torque_limit"], wheel["torque_limit"])
    if momentum == 0:
        if abs(drive) <= wheel["coulomb"]:
            return "stuck"
        side = -np.sign(drive)
    else:
        side = np.sign(momentum)
    torque = drive + wheel["coulomb"] * side + wheel["viscous"] / wheel["inertia"] * momentum
    if abs(momentum) >= wheel["momentum_limit"] and torque * momentum < 0:
        return "limited"
    return float(side)


def wheel_torque(momentum, command, wheel, motion):
    """Return the torque on the body along the axis of a wheel that moves so, N m."""
    if motion in ("stuck", "limited"):
        return 0.0
    drive = np.clip(command, -wheel["torque_limit"], wheel["torque_limit"])
    return drive + wheel["coulomb"] * motion + wheel["viscous"] / wheel["inertia"] * momentum


def rate(t, y, inertia, axes, torques, external):
    """Return d(C, ω, h)/dt; C takes inertial components to body components."""
    c, omega, h = y[:9].reshape(3, 3), y[9:12], y[12:]
    cross = np.array([[0, -omega[2], omega[1]], [omega[2], 0, -omega[0]], [-omega[1], omega[0], 0]])
    u = torques(h)
    total = external(t) + axes @ u - np.cross(omega, inertia @ omega + axes @ h)
    return np.concatenate([(-cross @ c).ravel(), np.linalg.solve(inertia, total), -u])


def fly(start, omega, momenta, commands, period, *, inertia, axes, wheels, external):
    """Return C, ω, h after each command has been held for `period` seconds, and the edges met."""
    y = np.concatenate([np.ravel(start), omega, momenta])
    rows, edges = [y], []
    for number, command in enumerate(commands):
        t, end = number * period, (number + 1) * period
        while t < end:
            motions = [
                wheel_motion(h, c, w) for h, c, w in zip(y[12:], command, wheels, strict=True)
            ]

            def torques(h, command=command, motions=motions):
                return np.array(
                    [wheel_torque(*x) for x in zip(h, command, wheels, motions, strict=True)]
                )

            events = []
            for k, (motion, wheel) in enumerate(zip(motions, wheels, strict=True)):
                if motion in ("stuck", "limited"):
                    continue
                targets = [0.0] if y[12 + k] != 0 and wheel["coulomb"] else []
                growing = -torques(y[12:])[k]
                if np.isfinite(wheel["momentum_limit"]):
                    targets.append(np.sign(growing) * wheel["momentum_limit"])
                for target in targets:
                    if y[12 + k] == target:
                        continue
                    event = lambda t, y, k=k, target=target: y[12 + k] - target  # noqa: E731
                    event.terminal, event.found = True, (k, target)
                    events.append(event)
            run = solve_ivp(
                lambda t, y: rate(t, y, inertia, axes, torques, external),
                (t, end),
                y,
                method="DOP853",
                rtol=1e-13,
                atol=1e-15,
                events=events,
            )
            t, y = run.t[-1], run.y[:, -1].copy()
            for event, times in zip(events, run.t_events or [], strict=True):
                if len(times):
                    k, target = event.found
                    y[12 + k] = target
                    edges.append((times[0], k))
        rows.append(y)
    return np.array(rows), edges
