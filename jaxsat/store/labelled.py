"""Arrays with named axes and units, as results contain them.

xarray is slow to import, and a single run has no use for it. Names are those of xarray, so that
code which reads results takes either.
"""

from collections.abc import Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import TYPE_CHECKING, Any, NamedTuple, TypeAlias

import numpy as np

if TYPE_CHECKING:
    import xarray as xr

Dataset: TypeAlias = "LabelledArrays | xr.Dataset"


class LabelledArray(NamedTuple):
    """An array, the names of its axes, and attributes; xarray takes it as a variable."""

    dims: tuple[str, ...]
    values: np.ndarray
    attrs: Mapping[str, Any] = MappingProxyType({})


@dataclass(frozen=True)
class LabelledArrays:
    """Arrays by name, with the coordinates of their axes, and attributes of all."""

    data_vars: Mapping[str, LabelledArray]
    coords: Mapping[str, LabelledArray]
    attrs: dict[str, Any]

    def __getitem__(self, name: str) -> LabelledArray:
        return self.data_vars[name] if name in self.data_vars else self.coords[name]

    def __contains__(self, name: str) -> bool:
        return name in self.data_vars or name in self.coords

    @property
    def variables(self) -> dict[str, LabelledArray]:
        """Arrays and coordinates."""
        return {**self.data_vars, **self.coords}

    @property
    def sizes(self) -> dict[str, int]:
        """Length of each axis."""
        every = self.variables.values()
        return {
            axis: size
            for one in every
            for axis, size in zip(one.dims, np.shape(one.values), strict=True)
        }

    def isel(self, *, time: "slice | np.ndarray") -> "LabelledArrays":
        """Return the same at these places of the axis `time`, the first of arrays that have it."""

        def part(arrays: Mapping[str, LabelledArray]) -> dict[str, LabelledArray]:
            return {
                name: one._replace(values=one.values[time]) if "time" in one.dims else one
                for name, one in arrays.items()
            }

        return replace(self, data_vars=part(self.data_vars), coords=part(self.coords))

    def dataset(self) -> "xr.Dataset":
        """Return the same as a dataset of xarray."""
        import xarray as xr

        return xr.Dataset(self.data_vars, self.coords, self.attrs)
