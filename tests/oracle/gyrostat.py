"""A gyrostat: a body with wheels that have friction and limits, under commands that are held.

Nothing is shared with jaxsat. Wheels are followed one event at a time: SciPy's events find the
instants at which one comes to rest or to its limit, and an explicit list says how each moves.
Integration also ends where a wheel fails.
"""

import numpy as np
from scipy.integrate import solve_ivp


def drive_of(momentum, command, wheel):
    """Return what the motor makes of a command."""
    if wheel.get("runaway"):
        command = np.inf if momentum < 0 else -np.inf
    return wheel.get("gain", 1.0) * np.clip(command, -wheel["torque_limit"], wheel["torque_limit"])


def failed(wheel, kind, amount):
    """Return the wheel after a failure."""
    if kind == "dead":
        return wheel | {"gain": 0.0}
    if kind == "degraded":
        return wheel | {"gain": amount}
    if kind == "stopped":
        return wheel | {"gain": 0.0, "stopped": True}
    if kind == "runaway":
        return wheel | {"runaway": True}
    if kind == "friction-by":
        return wheel | {key: wheel[key] * amount for key in ("viscous", "coulomb")}
    assert kind == "friction-to"
    return wheel | {"coulomb": max(amount, wheel["coulomb"])}


def wheel_motion(momentum, command, wheel):
    """Return how a wheel moves: "stuck", "limited" or the sign of its momentum's side."""
    drive = drive_of(momentum, command, wheel)
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
    drive = drive_of(motion, command, wheel)
    return drive + wheel["coulomb"] * motion + wheel["viscous"] / wheel["inertia"] * momentum


def rate(t, y, inertia, axes, torques, external):
    """Return d(C, ω, h)/dt; C takes inertial components to body components."""
    c, omega, h = y[:9].reshape(3, 3), y[9:12], y[12:]
    cross = np.array([[0, -omega[2], omega[1]], [omega[2], 0, -omega[0]], [-omega[1], omega[0], 0]])
    u = torques(h)
    total = external(t) + axes @ u - np.cross(omega, inertia @ omega + axes @ h)
    return np.concatenate([(-cross @ c).ravel(), np.linalg.solve(inertia, total), -u])


def fly(start, omega, momenta, commands, period, *, inertia, axes, wheels, external, failures=()):
    """Return C, ω, h after each command has been held for `period` seconds, and the edges met.

    `failures` are (time, wheel, kind, amount) in the order of their times.
    """
    y = np.concatenate([np.ravel(start), omega, momenta])
    rows, edges, wheels, ahead = [y], [], list(wheels), list(failures)
    for number, command in enumerate(commands):
        t, last = number * period, (number + 1) * period
        while t < last:
            while ahead and ahead[0][0] <= t:
                _, which, kind, amount = ahead.pop(0)
                wheels[which] = failed(wheels[which], kind, amount)
                if kind == "stopped":
                    y = y.copy()
                    y[9:12] += np.linalg.solve(inertia, axes[:, which] * y[12 + which])
                    y[12 + which] = 0.0
            end = min([last, *[one[0] for one in ahead[:1]]])
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
