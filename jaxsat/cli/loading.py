"""Scenarios for the commands: mistakes and warnings as lines on standard error."""

from collections.abc import Sequence
from typing import TYPE_CHECKING

from jaxsat.cli.computing import use_double_precision
from jaxsat.cli.progress import show_progress
from jaxsat.cli.terminal import UserMistake, print_warning

if TYPE_CHECKING:
    from jaxsat.assembly.load import Purpose
    from jaxsat.controller_design import Vehicle
    from jaxsat.scenario import Scenario


def load_or_explain(
    name_or_path: str, overrides: Sequence[str] = (), purpose: "Purpose" = "run"
) -> "Scenario":
    """The scenario, which can be built for the purpose; raises `UserMistake` with every problem."""
    show_progress(f"reading {name_or_path}")
    use_double_precision()
    from jaxsat.assembly.load import load
    from jaxsat.scenario import ScenarioError

    try:
        return load(name_or_path, overrides, purpose=purpose, caution=print_warning)
    except ScenarioError as error:
        raise UserMistake(str(error), located=True) from None


def vehicle_or_explain(name_or_path: str, overrides: Sequence[str] = ()) -> "Vehicle":
    """The vehicle, with what its file may leave out; raises `UserMistake` with every problem."""
    show_progress(f"reading {name_or_path}")
    use_double_precision()
    from jaxsat.controller_design import read_vehicle
    from jaxsat.scenario import ScenarioError

    try:
        return read_vehicle(name_or_path, overrides, caution=print_warning)
    except ScenarioError as error:
        raise UserMistake(str(error), located=True) from None
