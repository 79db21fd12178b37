"""What the reference programs share: the periodic torque (2) and a landing DOP853."""

import math
from itertools import pairwise

import numpy as np
from scipy.integrate import DOP853

RTOL = 1e-13
ATOL = 1e-14
MAX_STEPS = 50_000  # more means a motion that slides on a discontinuity


def periodic(t, amplitude, frequency, phase):
    """Return the periodic torque (2) with phases, a_i sin(Omega_i t + phi_i), as three floats."""
    return tuple(
        a * math.sin(o * t + p) for a, o, p in zip(amplitude, frequency, phase, strict=True)
    )


def march(rhs, times, start, *, rtol=RTOL, atol=ATOL, max_step=math.inf):
    """Integrate y' = rhs(t, y) from times[0] and end a step on every one of `times`.

    Steps end on the times, so no interpolant enters the answer. Returns an array (n, len(start)).
    RuntimeError where the solver stalls or takes more than MAX_STEPS beyond one for each time.
    """
    times = np.asarray(times, float)
    y = np.array(start, float)
    rows = [y]
    step, count = None, 0
    for begin, end in pairwise(times):
        first = None if step is None else min(step, end - begin)
        solver = DOP853(
            rhs, begin, y, end, rtol=rtol, atol=atol, max_step=max_step, first_step=first
        )
        sizes = []
        while solver.status == "running":
            message = solver.step()
            sizes.append(solver.step_size)
            count += 1
            if count > MAX_STEPS + len(times):
                raise RuntimeError(f"More than {MAX_STEPS} steps to reach t = {solver.t!r}.")
        if solver.status == "failed":
            raise RuntimeError(f"DOP853 stopped at t = {solver.t!r}: {message}")
        y = solver.y
        rows.append(y)
        step = max(sizes[-2:])  # the last step is often cut short by the end of the interval
    return np.array(rows)


def choice(name, value, options):
    """Return `value` if it is one of `options`, else raise ValueError."""
    if value not in options:
        raise ValueError(f"Argument `{name}` must be one of {options}, but got {value!r}.")
    return value
