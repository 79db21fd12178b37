"""When the spacecraft of a trajectory dataset settled."""

import jax
import numpy as np
import xarray as xr

from jaxsat.metrics import Tolerances, settling_time, within

_within = jax.jit(within)
_settling_time = jax.jit(settling_time)


def is_within(dataset: xr.Dataset, tolerances: Tolerances | None = None) -> np.ndarray:
    """At which times attitude and relative rate are all within the tolerances."""
    w, z, rate = (jax.numpy.asarray(dataset[name].values) for name in ("w", "z", "relative_rate"))
    return np.asarray(_within(w, z, rate, Tolerances() if tolerances is None else tolerances))


def time_to_settle(dataset: xr.Dataset, tolerances: Tolerances | None = None) -> float:
    """First time from which all tolerances hold to the end, s; infinite if there is none."""
    return _first_time(dataset, is_within(dataset, tolerances))


def time_at_rest(dataset: xr.Dataset, tolerances: Tolerances | None = None) -> float:
    """The same for the inertial rates alone, whatever the attitude: what a rate law can do, s."""
    tolerances = Tolerances() if tolerances is None else tolerances
    slow = np.linalg.norm(dataset["omega"].values, axis=1) < float(tolerances.relative_rate)
    return _first_time(dataset, slow)


def _first_time(dataset: xr.Dataset, good: np.ndarray) -> float:
    times = jax.numpy.asarray(dataset["time"].values)
    return float(_settling_time(times, jax.numpy.asarray(good)))
