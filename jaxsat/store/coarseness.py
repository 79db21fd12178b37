"""Whether an attitude is saved often enough for a reader to interpolate it."""

import numpy as np
import xarray as xr

MOST_TURN = 2 * np.pi / 3
"""Between two records (rad): from half a turn on, nobody can tell which way it went."""


def coarseness(dataset: xr.Dataset) -> str:
    """What to say where a body turns too far between two saved times; nothing where it does not.

    The turn is that of the saved attitudes or, where it is more, that of the saved rates.
    """
    if not {"time", "quaternion", "omega"} <= set(dataset.variables) or len(dataset["time"]) < 2:
        return ""
    times, q = dataset["time"].values, dataset["quaternion"].values
    steps = np.diff(times)
    rates = np.linalg.norm(dataset["omega"].values, axis=1)
    by_rates = np.maximum(rates[1:], rates[:-1]) * steps
    by_attitudes = 2 * np.arccos(np.clip(np.abs(np.sum(q[1:] * q[:-1], axis=1)), 0, 1))
    turns = np.nan_to_num(np.maximum(by_rates, by_attitudes))
    worst = int(np.argmax(turns))
    if turns[worst] <= MOST_TURN:
        return ""
    enough = steps[worst] * MOST_TURN / turns[worst]
    return (
        f"the attitude is saved too coarsely to be interpolated: the body turns by "
        f"{turns[worst] / (2 * np.pi):.3g} of a turn between {times[worst]:g} and "
        f"{times[worst + 1]:g} s; save it at least every {enough:.2g} s "
        "(simulation.save_every_s)"
    )
