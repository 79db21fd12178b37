"""`jaxsat verify`: whether a scenario meets its requirements, with a stated confidence."""

from typing import Annotated

from cyclopts import Parameter

from jaxsat.cli.listening import present_result
from jaxsat.cli.loading import load_scenario
from jaxsat.cli.options import MAX_CASES, Flag, Overrides, Resumable, number, whole
from jaxsat.cli.terminal import FAILED_RUN, SUCCESS, print_stderr


def verify(
    scenario: str,
    /,
    *,
    overrides: Overrides = (),
    fraction: Annotated[float, Parameter(converter=number(0.0, 1.0, open_ends=True))] = 0.99,
    confidence: Annotated[float, Parameter(converter=number(0.5, 1.0, open_ends=True))] = 0.95,
    cases: Annotated[int, Parameter(converter=whole(1, MAX_CASES))] = 20_000,
    no_failures: Flag = False,
    pairs: Flag = False,
    results: Resumable = Resumable(),
) -> int:
    """Verify the requirements of a scenario: nominal, dispersed, and with actuators that fail.

    Flies as many dispersed cases as the confidence needs, then as many in which one actuator of
    each kind fails. Writes a traceability matrix, a failure table, a record and the scenarios of
    all conditions. The same command resumes an interrupted run. Exits with 1 unless every
    requirement is verified.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file, with [[requirement]] and [dispersion].
    fraction
        Part of the cases that must meet each requirement.
    confidence
        Confidence with which that is shown, for all requirements and conditions together.
    cases
        Most cases of each condition; what is not decided by then stays undecided. With more of them
        the same command goes on.
    no_failures
        Leave out failures of single actuators besides those of the scenario.
    pairs
        Fly also cases in which two actuators fail.
    results.out
        Output folder; by default jaxsat-NAME-verified in the current folder.
    """
    chosen = load_scenario(scenario, overrides, "study")
    import jaxsat

    result = present_result(
        scenario,
        "verified",
        results,
        lambda **into: jaxsat.verify(
            chosen,
            fraction=fraction,
            confidence=confidence,
            cases=cases,
            failures=not no_failures,
            pairs=pairs,
            **into,
        ),
    )
    if result.verified:
        return SUCCESS
    if results.quiet:
        print_stderr(result.document.verdict.text)
    return FAILED_RUN
