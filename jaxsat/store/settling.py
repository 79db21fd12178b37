"""When the spacecraft of a trajectory dataset settled."""

import jax
import numpy as np
import xarray as xr

from jaxsat.core.tolerances import Tolerances, within

_within = jax.jit(within)


def is_within(dataset: xr.Dataset, tolerances: Tolerances | None = None) -> np.ndarray:
    """At which of the saved times attitude and relative rate are all within the tolerances."""
    w, z, rate = (jax.numpy.asarray(dataset[name].values) for name in ("w", "z", "relative_rate"))
    return np.asarray(_within(w, z, rate, Tolerances() if tolerances is None else tolerances))


def time_to_settle(dataset: xr.Dataset) -> float:
    """The instant from which all tolerances hold to the end, s; infinite if there is none.

    It was judged during the run, on the integrator's steps, by the tolerances of `simulate`: the
    saved times do not matter.
    """
    return _total(dataset, "settled_from")


def time_at_rest(dataset: xr.Dataset) -> float:
    """The same for the inertial rates alone, whatever the attitude: what a rate law can do, s."""
    return _total(dataset, "at_rest_from")


def _total(dataset: xr.Dataset, name: str) -> float:
    if name not in dataset:
        raise ValueError(
            f"Argument `dataset` must hold {name}, which the run itself tells, but got one with "
            f"{', '.join(map(str, dataset.data_vars))}; simulate again."
        )
    return float(dataset[name])
