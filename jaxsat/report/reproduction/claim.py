"""Claims of the paper, their simulations, and access to the datasets."""

import enum
import tomllib
from collections.abc import Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
import xarray as xr


class PaperRun(NamedTuple):
    """A library scenario with overrides in the form of the command line, and its purpose."""

    scenario: str
    overrides: tuple[str, ...]
    purpose: str


_LONG = ("simulation.duration_s=1000.0", "simulation.save_every_s=0.5")
_STRONG = (*_LONG, "control.k4=100.0")
_NO_INTERNAL_MODEL = "control.internal_model=false"
_SLIDING = (  # with the exact relation w comes to slide on zero, where no step meets a tolerance
    'simulation.solver.name="tsit5"',
    "simulation.solver.rtol=1e-8",
    "simulation.solver.atol=1e-8",
    "simulation.solver.min_step_s=5e-3",
    "simulation.solver.max_steps=500000",
)
_NO_D3 = "disturbance.amplitude_N_m=[0.01, 0.02, 0.0]"

RUNS: Mapping[str, PaperRun] = MappingProxyType(
    {
        "rate": PaperRun("paper-rate", (), "rate law as printed (Figs. 3, 4)"),
        "rate-without-d3": PaperRun("paper-rate", (_NO_D3,), "rate law, no disturbance on axis 3"),
        "rate-fine": PaperRun(
            "paper-rate",
            ("simulation.duration_s=70.0", "simulation.save_every_s=0.001"),
            "rate law, torque saved 100 times more often",
        ),
        "three-axis": PaperRun(
            "paper-three-axis", _LONG, "three-axis law, third rate held (Figs. 5-7)"
        ),
        "three-axis-no-internal-model": PaperRun(
            "paper-three-axis", (*_LONG, _NO_INTERNAL_MODEL), "the same without the internal model"
        ),
        "strong": PaperRun("paper-three-axis", _STRONG, "three-axis law with k4 = 100 N m s"),
        "strong-no-internal-model": PaperRun(
            "paper-three-axis", (*_STRONG, _NO_INTERNAL_MODEL), "the same without internal model"
        ),
        "three-axis-exact": PaperRun(
            "paper-three-axis",
            (*_LONG, *_SLIDING, 'orbit.relation="exact"'),
            "three-axis law, third rate held, exact orbit relation (11)",
        ),
        "free": PaperRun("free-third-rate", (), "three-axis law, third rate free"),
        "free-without-d3": PaperRun(
            "free-third-rate", (_NO_D3,), "the same, no disturbance on axis 3"
        ),
        "switching": PaperRun(
            "switching",
            ("simulation.save_every_s=0.1",),  # every sample, to see each transition
            "switching between the two laws, third rate free",
        ),
        "switching-rounded": PaperRun(
            "switching-rounded", (), "the same with δ² under the fraction of (41), tuned with it"
        ),
    }
)


SMALL_RATE = 1e-3
"""Rate (rad/s) below which it counts as zero, as in the definition of settled."""

Datasets = Mapping[str, xr.Dataset]
"""Trajectories by the names in `jaxsat.report.reproduction.RUNS`."""


class ClaimVerdict(enum.Enum):
    """Verdict on a claim."""

    HOLDS = "holds"
    ONLY_IF = "holds only if"
    FAILS = "does not hold"


class Claim(NamedTuple):
    """A claim of the paper, and the result of simulation."""

    source: str
    statement: str
    finding: str
    verdict: ClaimVerdict
    condition: str = ""

    @property
    def verdict_text(self) -> str:
        """The verdict with its condition."""
        return f"{self.verdict.value} {self.condition}".strip()


def decide(holds: bool, holds_if: bool, condition: str) -> tuple[ClaimVerdict, str]:
    """Return the verdict, with the condition where the claim needs it."""
    if holds:
        return ClaimVerdict.HOLDS, ""
    return (ClaimVerdict.ONLY_IF, condition) if holds_if else (ClaimVerdict.FAILS, "")


def scenario_of(dataset: xr.Dataset) -> dict[str, Any]:
    """Return the scenario of a trajectory."""
    return tomllib.loads(dataset.attrs["scenario"])


def last(dataset: xr.Dataset, span: float) -> xr.Dataset:
    """Return the last `span` seconds of a trajectory."""
    return dataset.sel(time=slice(float(dataset["time"][-1]) - span, None))


def at(dataset: xr.Dataset, time: float) -> xr.Dataset:
    """Return the first saved instant from `time` (s) on."""
    return dataset.isel(time=int(np.searchsorted(dataset["time"], time)))


def duration(dataset: xr.Dataset) -> float:
    """Return the last saved instant, s."""
    return float(dataset["time"][-1])


def when(time: float) -> str:
    """Describe a settling time (s)."""
    return f"settled from {time:.2f} s" if np.isfinite(time) else "not settled"
