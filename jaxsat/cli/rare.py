"""`jaxsat rare`: the probability, however small, that a requirement is violated."""

from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from jaxsat.cli.computing import interruptibly
from jaxsat.cli.listening import execution, listener, present_result
from jaxsat.cli.loading import load_scenario
from jaxsat.cli.options import (
    MAX_BATCH_SIZE,
    Case,
    Overrides,
    Resumable,
    Text,
    number,
    option_mistake,
    whole,
)
from jaxsat.cli.report import finish_report, planned_report
from jaxsat.cli.study_files import write_one_case
from jaxsat.cli.terminal import SUCCESS

if TYPE_CHECKING:
    from jaxsat.scenario import Scenario

MAX_REPLICATIONS = 1000
OPTIONS = ("requirement", "cases", "replications", "case")


def rare(
    scenario: str,
    /,
    *,
    overrides: Overrides = (),
    requirement: Text = None,
    cases: Annotated[int, Parameter(converter=whole(100, MAX_BATCH_SIZE))] = 1000,
    replications: Annotated[int, Parameter(converter=whole(3, MAX_REPLICATIONS))] = 10,
    least: Annotated[float, Parameter(converter=number(1e-12, 1.0, open_ends=True))] = 1e-9,
    confidence: Annotated[float, Parameter(converter=number(0.0, 1.0, open_ends=True))] = 0.95,
    case: Case = None,
    results: Resumable = Resumable(),
) -> int:
    """Estimate the probability, however small, that a requirement is violated.

    Flies dispersed cases towards the violation, level by level, in independent replications whose
    mean has no bias (subset simulation). Says when its interval is not to be trusted, and where in
    the space of the draws cases violate. The same command resumes an interrupted run.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file, with [[requirement]] and [dispersion].
    requirement
        The id of the requirement; may be left out if there is only one.
    cases
        Cases of each level in each replication, a multiple of 10.
    replications
        Independent estimates, whose scatter gives the interval.
    least
        Probability below which the pilot run looks no further.
    confidence
        Confidence of the interval.
    case
        Recompute this flight of the folder --out alone, and write its whole trajectory into it.
    results.out
        Output folder; by default jaxsat-NAME-rare in the current folder.
    results.overwrite
        Replace the file of --report, or with --case the folder of the case, if jaxsat wrote it;
        results in the folder are resumed.
    """
    chosen = load_scenario(scenario, overrides, "study")
    if case is not None:
        folder = results.out or Path(f"jaxsat-{Path(scenario).stem}-rare")
        return _fly_again(chosen, folder, case, results)
    import jaxsat

    present_result(
        scenario,
        "rare",
        results,
        lambda **into: jaxsat.rare_event(
            chosen,
            requirement,
            cases=cases,
            replications=replications,
            least=least,
            confidence=confidence,
            **into,
        ),
        OPTIONS,
    )
    return SUCCESS


def _fly_again(chosen: "Scenario", folder: Path, case: int, results: Resumable) -> int:
    from jaxsat.synthesis.rare_events.run import flown_again

    target = folder / f"case-{case}"
    report = planned_report(results, target)
    try:
        scenario, study = interruptibly(
            lambda: flown_again(chosen, folder, case, execution(results), listener(target, results))
        )
    except ValueError as error:
        raise option_mistake(error, OPTIONS) from None
    write_one_case(scenario, study, case, target, overwrite=results.overwrite, quiet=results.quiet)
    finish_report(report, quiet=results.quiet)
    return SUCCESS
