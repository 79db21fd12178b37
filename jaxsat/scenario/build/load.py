"""Loading of scenarios, with a trial construction for their purpose."""

from collections.abc import Callable, Iterable
from pathlib import Path
from typing import Literal

from jaxsat.scenario import Scenario, read
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.overrides import Override
from jaxsat.scenario.read import warn

Purpose = Literal["text", "motion", "run", "study"]
"""Purpose for which a scenario is loaded; see `load`."""


def load(
    name_or_path: str | Path,
    overrides: Iterable[str | Override] = (),
    *,
    purpose: Purpose = "run",
    also: Callable[[Scenario], None] | None = None,
    caution: Callable[[str], None] = warn,
) -> Scenario:
    """Load the library's scenario with this name, or a TOML file, with overrides.

    The file is read by `jaxsat.scenario.read`, and built on trial for the `purpose`: "run", for
    which everything is checked; "study", for which the loop must also have all dispersed
    quantities; "motion", without the control law; "text", without a trial. `also` raises
    `BuildError` for a valid scenario that does not suit the caller. Raises `ScenarioError` with
    every problem at once; passes cautions about likely mistakes to `caution`, by default as a
    `ScenarioWarning`. JAX is imported once all keys are valid.
    """
    law = purpose != "motion"

    def trial(scenario: Scenario) -> list[Issue]:
        return [] if purpose == "text" else _obstacles(scenario, purpose, also)

    scenario = read(name_or_path, overrides, law=law, trial=trial, caution=caution)
    if purpose in ("run", "study"):
        from jaxsat.scenario.build.actuator_set import borderline_words
        from jaxsat.scenario.build.balance import full_wheels_words

        for words in (borderline_words(scenario), full_wheels_words(scenario)):
            if words is not None:
                caution(f"{name_or_path}: {words}")
    return scenario


def _obstacles(
    scenario: Scenario, purpose: Purpose, also: Callable[[Scenario], None] | None
) -> list[Issue]:
    """Issues that prevent the construction of the scenario, by the commands' own functions."""
    from jaxsat.scenario.build.errors import BuildError
    from jaxsat.scenario.build.run import build, build_uncontrolled

    try:
        if purpose == "motion":
            build_uncontrolled(scenario)
            return []
        run, issues = build(scenario), []
        if scenario.dispersion is not None:
            from jaxsat.scenario.build.dispersion_trial import dispersion_issues  # slow

            issues = dispersion_issues(scenario, run, all_fit=purpose == "study")
        if also is not None and not issues:
            also(scenario)
    except BuildError as error:
        return [error.issue]
    return issues
