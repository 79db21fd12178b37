"""SciPy's `solve_ivp`, DOP853, with the right-hand side compiled by numba; and the truth."""

import numpy as np
from scipy.integrate import solve_ivp

from contenders.contender import TOLERANCES, Contender, Run
from contenders.work import SIZE, final_state, is_smooth, starts
from jaxsat.studies.ensemble import Study


def prepared(study: Study, count: int, tolerance: float) -> Run:
    """A run of the first cases, one after the other on one processor."""
    from contenders.numba_loop import compiled_rate, parameters

    smooth = is_smooth(study)
    rate = compiled_rate(smooth)
    inputs = starts(study, count)
    y, torques = np.asarray(inputs[0]), parameters(inputs)
    duration = float(study.program.duration)

    def slope(t, y, torque):
        found = np.empty(SIZE)
        rate(t, y, torque, found)
        return found

    def run():
        found = np.empty_like(y)
        for i, (start, own) in enumerate(zip(y, torques, strict=True)):
            bounds = {"rtol": tolerance, "atol": tolerance}
            solution = solve_ivp(slope, (0, duration), start, "DOP853", args=(own,), **bounds)
            found[i] = solution.y[:, -1]
        return final_state(found, smooth)

    return run


def truth(study: Study, count: int) -> np.ndarray:
    """The final states at the tightest tolerance that SciPy takes, but for a third."""
    found = prepared(study, count, 3e-14)()
    assert found is not None
    return found


def contenders() -> list[Contender]:
    """DOP853."""
    return [Contender("SciPy DOP853, numba", TOLERANCES, prepared, most=32)]
