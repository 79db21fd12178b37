"""The histories that a study keeps of its cases, if it was asked to."""

from collections.abc import Mapping
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    import xarray as xr

HISTORY = "history_"
"""Prefix of the columns that hold a case's history, (times, components)."""

TIME = HISTORY + "time"


def with_history_time(dataset: "xr.Dataset", identity: Mapping[str, Any]) -> "xr.Dataset":
    """The results of a study, its histories over their common times (s), which the identity has."""
    import xarray as xr  # takes its time, and a study that is computed has no use for it

    times = identity.get("history")
    if times is None:
        return dataset
    names = [str(name) for name in dataset if str(name).startswith(HISTORY)]
    over_time = {name: dataset[name].rename({f"{name}_0": TIME}) for name in names}
    label = {"units": "s", "long_name": "time since the start"}
    return dataset.assign(over_time).assign_coords({TIME: xr.Variable(TIME, times, label)})
