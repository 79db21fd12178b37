"""`jaxsat worst`: the least margin of a requirement that dispersions can bring about."""

from typing import Annotated

from cyclopts import Parameter

from jaxsat.cli.listening import present_result
from jaxsat.cli.loading import load_scenario
from jaxsat.cli.options import MAX_BATCH_SIZE, Overrides, Resumable, Text, number, whole
from jaxsat.cli.terminal import SUCCESS

OPTIONS = ("requirement", "flights", "within")


def worst(
    scenario: str,
    /,
    *,
    overrides: Overrides = (),
    requirement: Text = None,
    flights: Annotated[int, Parameter(converter=whole(100, MAX_BATCH_SIZE))] = 2000,
    within: Annotated[float, Parameter(converter=number(0.0, 1.0, open_ends=True))] = 0.9973,
    results: Resumable = Resumable(),
) -> int:
    """Search for the case with the least margin of a requirement.

    Flies random cases and, from the worst of them on, as many of a search over all dispersed
    quantities: starts, errors, failure times, disturbances. It descends along gradients of the
    margin where they can be trusted, and goes on by covariance matrix adaptation. Writes
    the worst case as a scenario, case.toml, that jaxsat simulate flies. The same command resumes an
    interrupted run.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file, with [[requirement]] and [dispersion].
    requirement
        The id of the requirement; may be left out if there is only one.
    flights
        Flights of the search, and as many random ones beside it.
    within
        The search is among this part of all cases, the likeliest ones.
    results.out
        Output folder; by default jaxsat-NAME-worst in the current folder.
    """
    chosen = load_scenario(scenario, overrides, "study")
    import jaxsat

    present_result(
        scenario,
        "worst",
        results,
        lambda **into: jaxsat.worst_case(
            chosen, requirement, flights=flights, within=within, **into
        ),
        OPTIONS,
    )
    return SUCCESS
