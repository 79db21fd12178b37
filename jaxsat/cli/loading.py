"""Scenarios for the commands: mistakes and warnings as lines on standard error."""

import warnings
from collections.abc import Sequence
from typing import TYPE_CHECKING

from jaxsat.cli.computing import use_double_precision
from jaxsat.cli.progress import show_progress
from jaxsat.cli.terminal import UserMistake, print_stderr

if TYPE_CHECKING:
    from jaxsat.assembly.load import Purpose
    from jaxsat.scenario import Scenario


def load_or_explain(
    name_or_path: str, overrides: Sequence[str] = (), purpose: "Purpose" = "run"
) -> "Scenario":
    """The scenario, which can be built for the purpose; raises `UserMistake` with every problem."""
    show_progress(f"reading {name_or_path}")
    use_double_precision()
    from jaxsat.assembly.load import load
    from jaxsat.scenario import ScenarioError, ScenarioWarning

    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ScenarioWarning)
        try:
            scenario = load(name_or_path, overrides, purpose=purpose)
        except ScenarioError as error:
            raise UserMistake(str(error), located=True) from None
    for warning in caught:
        print_stderr(f"{warning.message}", "warning: ")
    return scenario
