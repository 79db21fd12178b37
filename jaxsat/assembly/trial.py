"""Whether a scenario whose keys are all right can be built, found out by building it."""

from jaxsat.assembly.errors import BuildError
from jaxsat.assembly.run import build, build_uncontrolled
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.schema import Scenario


def what_cannot_be_built(
    scenario: Scenario, *, law: bool, study: bool, tuning: bool
) -> list[Issue]:
    """What stands against building the scenario, by the functions that commands build with.

    With its control law or without, and as a study, to be tuned, or as a single run.
    """
    try:
        if law:
            return _issues_of_run(scenario, study, tuning)
        build_uncontrolled(scenario)
    except BuildError as error:
        return [error.issue]
    return []


def _issues_of_run(scenario: Scenario, study: bool, tuning: bool) -> list[Issue]:
    run = build(scenario)
    if scenario.dispersion is None:
        return []
    from jaxsat.assembly.dispersion_trial import dispersion_issues  # whose imports take their time

    issues = dispersion_issues(scenario, run, all_fit=study)
    if tuning and scenario.tuning is not None and not issues:
        from jaxsat.assembly.tuning import try_tuning

        try_tuning(scenario)
    return issues
