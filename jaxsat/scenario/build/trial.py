"""Whether a scenario whose keys are all right can be built, found out by building it."""

from collections.abc import Callable

from jaxsat.scenario.build.errors import BuildError
from jaxsat.scenario.build.run import Run, build, build_uncontrolled
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.schema import Scenario


def what_cannot_be_built(
    scenario: Scenario, *, law: bool, study: bool, also: Callable[[Scenario], None] | None = None
) -> list[Issue]:
    """What stands against building the scenario, by the functions that commands build with.

    With its control law or without, as a study or as a single run; and by `also`, which raises
    `BuildError`.
    """
    try:
        if law:
            return _issues_of_run(scenario, study, also)
        build_uncontrolled(scenario)
    except BuildError as error:
        return [error.issue]
    return []


def _issues_of_run(
    scenario: Scenario, study: bool, also: Callable[[Scenario], None] | None
) -> list[Issue]:
    run = build(scenario)
    issues = [] if scenario.dispersion is None else _issues_of_dispersions(scenario, run, study)
    if also is not None and not issues:
        also(scenario)
    return issues


def _issues_of_dispersions(scenario: Scenario, run: Run, study: bool) -> list[Issue]:
    from jaxsat.scenario.build.dispersion_trial import dispersion_issues  # imported late: slow

    return dispersion_issues(scenario, run, all_fit=study)
