"""The results of a study as a labelled dataset."""

import json
from pathlib import Path

import xarray as xr

from jaxsat.results.histories import with_history_time


def open_study(path: str | Path) -> xr.Dataset:
    """The results of a study as a dataset over `case`, read when used; `status` is 1 where done.

    Histories, where there are any, are over `history_time` (s) as well. The attributes `identity`
    and `runs` are JSON.
    """
    dataset = xr.open_zarr(path, consolidated=False, chunks=None, decode_times=False)
    dataset = with_history_time(dataset, dataset.attrs["identity"])
    for name in ("identity", "runs"):
        dataset.attrs[name] = json.dumps(dataset.attrs[name])
    return dataset
