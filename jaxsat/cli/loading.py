"""Scenarios for the commands: mistakes and warnings as lines on standard error."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal

from jaxsat.cli.computing import use_double_precision
from jaxsat.cli.progress import show_progress
from jaxsat.cli.terminal import print_warning

if TYPE_CHECKING:
    from jaxsat.scenario import Scenario
    from jaxsat.scenario.build.load import Purpose
    from jaxsat.synthesis.controller_design.request import Vehicle


def load_scenario(
    name_or_path: str, overrides: Sequence[str] = (), purpose: "Purpose | Literal['tuning']" = "run"
) -> "Scenario":
    """Load a scenario that can be built for the purpose; raises `ScenarioError` with every problem.

    "tuning" is a study whose gains can be tuned.
    """
    show_progress(f"reading {name_or_path}")
    use_double_precision()
    from jaxsat.scenario.build.load import load

    also = None
    if purpose == "tuning":
        purpose, also = "study", _try_tuning
    return load(name_or_path, overrides, purpose=purpose, also=also, caution=print_warning)


def _try_tuning(scenario: "Scenario") -> None:
    """Raise `BuildError` where the gains cannot be tuned by `[tuning]`, if present."""
    if scenario.tuning is not None:
        from jaxsat.synthesis.tuning.build import try_tuning

        try_tuning(scenario)


def load_vehicle(name_or_path: str, overrides: Sequence[str] = ()) -> "Vehicle":
    """Load a vehicle, with defaults; raises `ScenarioError` with every problem."""
    show_progress(f"reading {name_or_path}")
    use_double_precision()
    from jaxsat.synthesis.controller_design.request import read_vehicle

    return read_vehicle(name_or_path, overrides, caution=print_warning)
