"""A gyrostat: a body with wheels that have friction and limits, under commands that are held.

Nothing is shared with jaxsat, nor are the variables: the total momentum in inertial axes, which
external torque alone changes, and the absolute momentum J_w (Ω + a·ω) of each rotor, which its
motor and friction alone change. Rates are what these and the attitude say. Wheels are followed one
event at a time: SciPy's events find the instants at which one comes to rest or to its limit or
leaves it, and what moves from there on is the one combination of all that is consistent.
Integration also ends where a wheel fails.
"""

import itertools

import numpy as np
from scipy.integrate import solve_ivp


def drive_of(momentum, command, wheel):
    """Return what the motor makes of a command."""
    if wheel.get("runaway"):
        command = np.inf if momentum < 0 else -np.inf
    return wheel.get("gain", 1.0) * np.clip(command, -wheel["torque_limit"], wheel["torque_limit"])


def failed(wheel, kind, amount):
    """Return a sound wheel after a failure, which replaces those before it."""
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
    """Return how a wheel of a body at rest moves: "stuck", "limited" or its momentum's side."""
    drive = drive_of(momentum, command, wheel)
    if momentum == 0:
        if abs(drive) <= wheel["coulomb"]:
            return "stuck"
        side = -np.sign(drive)
    else:
        side = np.sign(momentum)
    torque = wheel_torque(momentum, command, wheel, side)
    if abs(momentum) >= wheel["momentum_limit"] and torque * momentum < 0:
        return "limited"
    return float(side)


def wheel_torque(momentum, command, wheel, motion):
    """Return the torque of motor and friction on the body along the axis of a wheel, N m.

    That of a wheel that is held is zero here: it has the body's rate.
    """
    if motion in ("stuck", "limited"):
        return 0.0
    drive = drive_of(momentum, command, wheel)
    viscous = wheel["viscous"] / wheel["inertia"] if wheel["viscous"] else 0.0
    return drive + wheel["coulomb"] * motion + viscous * momentum


class Gyrostat:
    """A body whose wheels each move in a way that does not change.

    Its state is C (from inertial to body components), the total momentum in inertial axes, and of
    each wheel the absolute momentum of its rotor, or of one that is held that relative to the body.
    """

    def __init__(self, inertia, axes, wheels, command, motions, external):
        self.axes, self.wheels, self.command = axes, wheels, command
        self.motions, self.external = motions, external
        self.rotors = np.array([one["inertia"] for one in wheels])
        self.held = np.array([one in ("stuck", "limited") for one in motions])
        free = axes[:, ~self.held]
        self.reduced = inertia - free @ np.diag(self.rotors[~self.held]) @ free.T

    def seen(self, y):
        """Return C, ω and the momenta relative to the body."""
        c, total, p = y[:9].reshape(3, 3), y[9:12], y[12:]
        omega = np.linalg.solve(self.reduced, c @ total - self.axes @ p)
        return c, omega, p - np.where(self.held, 0, self.rotors * (self.axes.T @ omega))

    def torques(self, h):
        return np.array(
            [
                wheel_torque(*one)
                for one in zip(h, self.command, self.wheels, self.motions, strict=True)
            ]
        )

    def rate(self, t, y):
        c, omega, h = self.seen(y)
        x, z, w = omega
        cross = np.array([[0, -w, z], [w, 0, -x], [-z, x, 0]])
        return np.concatenate([(-cross @ c).ravel(), c.T @ self.external(t), -self.torques(h)])

    def drag(self, t, y):
        """Return what the rotor of each wheel takes to turn with the body, J_w a·dω/dt."""
        c, omega, h = self.seen(y)
        change = self.external(t) - np.cross(omega, c @ y[9:12]) + self.axes @ self.torques(h)
        return self.rotors * (self.axes.T @ np.linalg.solve(self.reduced, change))

    def growth(self, t, y):
        """Return how fast each momentum would grow that is not held, in its motion's direction."""
        h, found = self.seen(y)[2], []
        for k, drag in enumerate(self.drag(t, y)):
            motion = np.sign(h[k]) if self.motions[k] == "limited" else self.motions[k]
            if motion == "stuck":
                drive = drive_of(h[k], self.command[k], self.wheels[k])
                found.append(abs(drive + drag) - self.wheels[k]["coulomb"])
            else:
                made = wheel_torque(h[k], self.command[k], self.wheels[k], motion)
                found.append(-(made + drag) * motion)
        return np.array(found)


def ways(momentum, wheel):
    """Return how a wheel may move."""
    side = float(np.sign(momentum))
    if wheel.get("stopped"):
        return ["stuck"]
    if momentum == 0 and wheel["coulomb"]:
        return ["stuck", 1.0, -1.0]
    return ["limited", side] if abs(momentum) >= wheel["momentum_limit"] else [side]


def moving(c, omega, h, t, inertia, axes, wheels, command, external, excluded=()):
    """Return the gyrostat of the motions that are consistent at an instant, and its state."""
    total = c.T @ (inertia @ omega + axes @ h)
    choices = [
        [one for one in ways(*x) if (k, one) not in excluded]
        for k, x in enumerate(zip(h, wheels, strict=True))
    ]
    for motions in itertools.product(*choices):
        body = Gyrostat(inertia, axes, wheels, command, motions, external)
        p = np.where(body.held, h, h + body.rotors * (axes.T @ omega))
        y = np.concatenate([c.ravel(), total, p])
        growth, fits = body.growth(t, y), True
        for k, motion in enumerate(motions):
            at_limit = abs(h[k]) >= wheels[k]["momentum_limit"]
            if motion == "stuck":
                fits &= growth[k] <= 0 or bool(wheels[k].get("stopped"))
            elif motion == "limited":
                fits &= growth[k] >= 0
            elif h[k] == 0 and wheels[k]["coulomb"]:
                fits &= growth[k] > -1e-12
            elif at_limit:
                fits &= growth[k] < 1e-12
        if fits:
            return body, y
    raise AssertionError("no combination of motions is consistent")


def fly(start, omega, momenta, commands, period, *, inertia, axes, wheels, external, failures=()):
    """Return C, ω, h after each command has been held for `period` seconds, and the edges met.

    `failures` are (time, wheel, kind, amount) in the order of their times.
    """
    c, omega, h = np.array(start, float), np.array(omega, float), np.array(momenta, float)
    rows, edges = [np.concatenate([c.ravel(), omega, h])], []
    sound, wheels, ahead = list(wheels), list(wheels), list(failures)
    rotors = np.array([one["inertia"] for one in wheels])
    for number, command in enumerate(commands):
        t, last, excluded = number * period, (number + 1) * period, ()
        while t < last:
            while ahead and ahead[0][0] <= t:
                _, which, kind, amount = ahead.pop(0)
                wheels[which] = failed(sound[which], kind, amount)
                if kind == "stopped":  # by an impulse along its axis, all at once
                    others = [k for k, one in enumerate(wheels) if not one.get("stopped")]
                    absolute = h + rotors * (axes.T @ omega)
                    total = inertia @ omega + axes @ h
                    free = axes[:, others]
                    body = inertia - free @ np.diag(rotors[others]) @ free.T
                    omega = np.linalg.solve(body, total - free @ absolute[others])
                    h = np.zeros_like(h)
                    h[others] = absolute[others] - rotors[others] * (free.T @ omega)
            end = min([last, *[one[0] for one in ahead[:1]]])
            body, y = moving(c, omega, h, t, inertia, axes, wheels, command, external, excluded)
            events = _events(body, h)
            run = solve_ivp(
                body.rate, (t, end), y, method="DOP853", rtol=1e-13, atol=1e-15, events=events
            )
            t, excluded = run.t[-1], ()
            c, omega, h = body.seen(run.y[:, -1])
            for event, times in zip(events, run.t_events or [], strict=True):
                if len(times):
                    k, target = event.found
                    edges.append((times[0], k))
                    if target is None:
                        excluded = ((k, body.motions[k]),)
                    else:
                        h[k] = target
        rows.append(np.concatenate([c.ravel(), omega, h]))
    return np.array(rows), edges


def _events(body, h):
    """Return what ends the motions: rest, limits, and what lets go of a wheel that is held."""
    found = []
    for k, (motion, wheel) in enumerate(zip(body.motions, body.wheels, strict=True)):
        if wheel.get("stopped"):
            continue
        if motion in ("stuck", "limited"):
            if not wheel["inertia"]:
                continue  # its command alone holds it
            event = lambda t, y, k=k: body.growth(t, y)[k]  # noqa: E731
            event.direction = 1 if motion == "stuck" else -1
            event.terminal, event.found = True, (k, None)
            found.append(event)
            continue
        targets = [0.0] if h[k] != 0 and wheel["coulomb"] else []
        if np.isfinite(wheel["momentum_limit"]):
            targets += [x for x in (-wheel["momentum_limit"], wheel["momentum_limit"]) if x != h[k]]
        for target in targets:
            event = lambda t, y, k=k, target=target: body.seen(y)[2][k] - target  # noqa: E731
            event.terminal, event.found = True, (k, target)
            found.append(event)
    return found
