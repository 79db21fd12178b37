"""What a claim of the paper is, how it is judged, and how datasets are read for it."""

import enum
import tomllib
from collections.abc import Mapping
from typing import Any, NamedTuple

import numpy as np
import xarray as xr

SMALL_RATE = 1e-3
"""rad/s. A rate below this counts as zero, as in the definition of settled."""

Datasets = Mapping[str, xr.Dataset]
"""Trajectories by the names in `jaxsat.report.reproduction.RUNS`."""


class ClaimVerdict(enum.Enum):
    """What became of a claim."""

    HOLDS = "holds"
    ONLY_IF = "holds only if"
    FAILS = "does not hold"


class Claim(NamedTuple):
    """A claim of the paper and what simulation says of it."""

    source: str
    statement: str
    found: str
    verdict: ClaimVerdict
    condition: str = ""

    @property
    def verdict_text(self) -> str:
        """The verdict with its condition."""
        return f"{self.verdict.value} {self.condition}".strip()


def decide(holds: bool, holds_if: bool, condition: str) -> tuple[ClaimVerdict, str]:
    """The verdict, with the condition where the claim needs it."""
    if holds:
        return ClaimVerdict.HOLDS, ""
    return (ClaimVerdict.ONLY_IF, condition) if holds_if else (ClaimVerdict.FAILS, "")


def scenario_of(dataset: xr.Dataset) -> dict[str, Any]:
    """The scenario that a trajectory was made with."""
    return tomllib.loads(dataset.attrs["scenario"])


def last(dataset: xr.Dataset, span: float) -> xr.Dataset:
    """The last `span` seconds of a trajectory."""
    return dataset.sel(time=slice(float(dataset["time"][-1]) - span, None))


def at(dataset: xr.Dataset, time: float) -> xr.Dataset:
    """The first saved instant from `time` (s) on."""
    return dataset.isel(time=int(np.searchsorted(dataset["time"], time)))


def duration(dataset: xr.Dataset) -> float:
    """The last saved instant, s."""
    return float(dataset["time"][-1])


def when(time: float) -> str:
    """A settling time in words, s."""
    return f"settled from {time:.2f} s" if np.isfinite(time) else "not settled"
