"""Thrusters that push, by SciPy: linear programming, event times, DOP853 between breakpoints.

Every thruster's thrust is a piecewise linear function of time over the whole run, made first. It
shares no code with the package.
"""

from itertools import pairwise

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq, linprog


def least_propellant(torque, cost, wanted):
    """Duties up to 1 by HiGHS, of the greatest part of a torque that can be made."""
    most = linprog(
        np.append(0 * cost, -1.0),
        A_eq=np.column_stack([torque, -np.asarray(wanted)]),
        b_eq=np.zeros(3),
        bounds=(0, 1),
    )
    assert most.status == 0
    made = torque @ most.x[:-1] if most.x[-1] < 1 else wanted
    found = linprog(cost, A_eq=torque, b_eq=made, bounds=(0, 1), method="highs-ds")
    assert found.status == 0
    return found.x


def pulse_width(duties, period, min_on):
    """Commands [(time, level)] of one thruster over all periods."""
    events = []
    for number, duty in enumerate(duties):
        width = duty * period
        if width >= min_on and width > 0:
            events += [(number * period, 1.0), (number * period + width, 0.0)]
    return events


def throttle(duties, period, min_on):
    del min_on
    return [(number * period, duty) for number, duty in enumerate(duties)]


def delta_sigma(duties, period, min_on):
    events, owed = [], 0.0
    for number, duty in enumerate(duties):
        owed += duty * period
        pulses = int(np.floor(min(owed, period) / min_on + 1e-9))
        owed = min(owed - pulses * min_on, period)
        if pulses:
            events += [(number * period, 1.0), (number * period + pulses * min_on, 0.0)]
    return events


def schmitt_trigger(duties, period, min_on, *, gain, lag, high, low):
    """PWPF: the lag by its exact solution, switchings by a root finder on a fine grid."""
    del min_on
    events, output, is_open = [], 0.0, False
    for number, duty in enumerate(duties):
        now = 0.0
        while True:
            end = gain * (duty - is_open)
            level = low if is_open else high

            def excess(s, output=output, end=end, level=level):
                return end + (output - end) * np.exp(-s / lag) - level

            grid = np.linspace(0, period - now, 4001)
            values = excess(grid) * (-1 if is_open else 1)
            ahead = np.nonzero(values[1:] >= 0)[0]
            if values[0] > 1e-12:
                wait = 0.0
            elif ahead.size:
                wait = brentq(excess, grid[ahead[0]], grid[ahead[0] + 1], xtol=1e-15)
            else:
                output = end + (output - end) * np.exp(-(period - now) / lag)
                break
            output, now, is_open = level, now + wait, not is_open
            events.append((number * period + now, float(is_open)))
    return events


def shifted_by(events, delay):
    """Return commands as valves that are late by `delay` follow them."""
    return [(time + delay, level) for time, level in events]


def delayed(events, delay, more, since, period):
    """Return commands of a valve that is later by `more` from the first sample after `since` on."""
    sample = period * np.ceil(since / period - 1e-9)
    before = [one for one in shifted_by(events, delay) if one[0] < sample]
    after = shifted_by(events, min(delay + more, period))
    passed = [level for time, level in after if time <= sample]
    now = (sample, passed[-1] if passed else 0.0)
    return [*before, now, *[one for one in after if one[0] > sample]]


def works(begin, since, share, period):
    """Return whether an intermittent thruster works, which is told at each sample."""
    sample = period * np.floor(begin / period + 1e-9)
    return sample < since or (sample - since) % 10.0 >= 10.0 * share


def thrust(events, end, *, period, delay=0.0, rise=0.0, fall=0.0, failure=None):
    """Breakpoints [(time, level before, level after)] of one thruster's level.

    `failure` is (time, kind, amount).
    """
    at, kind, amount = (np.inf, None, 0.0) if failure is None else failure
    if kind == "delayed":
        shifted = delayed(events, delay, amount, at, period)
    else:
        shifted = shifted_by(events, delay)
    samples = period * np.arange(round(end / period)) if kind == "intermittent" else ()
    instants = {0.0, *[time for time, _ in shifted if time < end], *samples, min(at, end), end}
    times = sorted(instants)
    level, points = 0.0, []
    for begin, stop in pairwise(times):
        commanded = [value for time, value in shifted if time <= begin]
        target = commanded[-1] if commanded else 0.0
        if begin >= at:
            target = {
                "dead": 0.0,
                "degraded": amount * target,
                "stuck-on": 1.0,
                "stuck-at": amount,
                "leaking": max(amount, target),
                "delayed": target,
                "turned": target,
                "intermittent": target if works(begin, at, amount, period) else 0.0,
            }[kind]
        before = level
        duration = rise if target > level else fall
        if duration == 0:
            level = target
        points.append((begin, before, level))
        if level != target:
            arrival = begin + abs(target - level) * duration
            if arrival < stop:
                points.append((arrival, target, target))
                level = target
            else:
                level += np.sign(target - level) * (stop - begin) / duration
    points.append((end, level, level))
    return points


def level_at(points, begin, stop):
    """Levels at the begin and at the end of a time without breakpoint inside."""
    times = np.array([time for time, _, _ in points])
    first = np.searchsorted(times, begin, side="right") - 1
    (left, _, low), (right, high, _) = points[first], points[first + 1]
    slope = (high - low) / (right - left)
    return low + slope * (begin - left), low + slope * (stop - left)


def fly(inertia, torque, profiles, omega, end, samples, turned=(np.inf, None)):
    """ω at the samples, and the propellant's ∫ level dt of every thruster there.

    `turned` is a time and the torques from then on.
    """
    inertia = np.asarray(inertia, float)
    times = sorted({*[t for points in profiles for t, _, _ in points], *samples})
    state, history, used, on_time = np.array(omega, float), [], [], np.zeros(len(profiles))
    for begin, stop in pairwise(times):
        if begin in samples:
            history.append(state)
            used.append(on_time.copy())
        if stop - begin < 1e-14:
            continue
        levels = np.array([level_at(points, begin, stop) for points in profiles])
        now = turned[1] if begin >= turned[0] else torque
        first, last = now @ levels[:, 0], now @ levels[:, 1]

        def rate(t, omega, begin=begin, stop=stop, first=first, last=last):
            share = (t - begin) / (stop - begin)
            applied = first + share * (last - first)
            return np.linalg.solve(inertia, applied - np.cross(omega, inertia @ omega))

        found = solve_ivp(rate, (begin, stop), state, "DOP853", rtol=1e-12, atol=1e-14)
        state, on_time = found.y[:, -1], on_time + (stop - begin) * levels.mean(axis=1)
    return np.array([*history, state]), np.array([*used, on_time])
