"""Loading scenarios that can be built for what they are loaded for."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Literal

from jaxsat.scenario import Scenario, read
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.overrides import Override
from jaxsat.scenario.read import warn

Purpose = Literal["text", "motion", "run", "study"]
"""What a scenario is loaded for; see `load`."""


def load(
    name_or_path: str | Path,
    overrides: Iterable[str | Override] = (),
    *,
    purpose: Purpose = "run",
    also: Callable[[Scenario], None] | None = None,
    caution: Callable[[str], None] = warn,
) -> Scenario:
    """The scenario of that name in the library, or of that TOML file, with overrides.

    It is read as by `jaxsat.scenario.read`, and can be built for the `purpose`: "run", for which
    everything is looked at; "study", for which the dispersions must also be such as the loop has;
    "motion", without the control law; "text", for which nothing is built. `also` raises
    `BuildError` where a scenario that can be built will not do.
    Raises `ScenarioError` with every problem at once; tells `caution` of what is allowed but likely
    a mistake, by default a `ScenarioWarning`. JAX is imported once all keys are right.
    """

    law = purpose != "motion"

    def trial(scenario: Scenario) -> list[Issue]:
        if purpose == "text":
            return []
        from jaxsat.scenario.build.trial import what_cannot_be_built

        return what_cannot_be_built(scenario, law=law, study=purpose == "study", also=also)

    return read(name_or_path, overrides, law=law, trial=trial, caution=caution)
