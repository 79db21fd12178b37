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
    everything is checked; "study", for which the dispersions must also be such as the loop has;
    "motion", without the control law; "text", for which nothing is built. `also` raises
    `BuildError` where a scenario that can be built will not do.
    Raises `ScenarioError` with every problem at once; tells `caution` of what is allowed but likely
    a mistake, by default a `ScenarioWarning`. JAX is imported once all keys are right.
    """
    law = purpose != "motion"

    def trial(scenario: Scenario) -> list[Issue]:
        return [] if purpose == "text" else _obstacles(scenario, purpose, also)

    scenario = read(name_or_path, overrides, law=law, trial=trial, caution=caution)
    if purpose in ("run", "study"):
        from jaxsat.scenario.build.actuator_set import borderline_words

        words = borderline_words(scenario)
        if words is not None:
            caution(f"{name_or_path}: {words}")
    return scenario


def _obstacles(
    scenario: Scenario, purpose: Purpose, also: Callable[[Scenario], None] | None
) -> list[Issue]:
    """What stands against building the scenario, by the functions that commands build with."""
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
