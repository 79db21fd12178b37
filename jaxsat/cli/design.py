"""`jaxsat design`: from a vehicle with failures to a verified controller."""

from typing import Annotated, Literal

from cyclopts import Parameter

from jaxsat.cli.listening import present_result
from jaxsat.cli.loading import load_vehicle
from jaxsat.cli.options import OptionalSeed, Overrides, Resumable, Text, number, whole
from jaxsat.cli.terminal import FAILED_RUN, SUCCESS, print_stderr

MAX_STEPS, MAX_CASES, MIN_SETTLED = 10_000, 10**6, 1e-6


def design(
    scenario: str,
    /,
    *,
    overrides: Overrides = (),
    law: Text = None,
    settled: Annotated[float, Parameter(converter=number(MIN_SETTLED, 1.0))] = 0.99,
    cases: Annotated[int, Parameter(converter=whole(1, MAX_CASES))] = 2000,
    steps: Annotated[int, Parameter(converter=whole(0, MAX_STEPS))] = 16,
    seed: OptionalSeed = None,
    attitude: Literal["wanted", "nearest"] = "wanted",
    goal: Literal["quickest", "settled"] = "quickest",
    results: Resumable = Resumable(),
) -> int:
    """Design a controller for a vehicle with failures, and verify it on cases never seen before.

    States which torques are left and which attitude can be held, screens the laws that fit, tunes
    the best, and verifies it. Writes designed.toml, ready for every command, a page, a record and
    figures. The same command resumes an interrupted run. Exits with 1 if the required fraction
    does not settle, or if there is nothing to design.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file. [spacecraft] is enough: the command
        assumes the rest and lists the assumptions.
    law
        The law to design, all for every law that fits, or quick for those that are verified within
        minutes; by default that of the scenario, or quick if it names none.
    settled
        Fraction of the cases that must settle.
    cases
        Unseen cases of the verification; earlier steps use at most this number.
    steps
        Steps of the tuner; 0 skips tuning.
    seed
        Seed of the first step; the other steps use the following numbers. By default that of the
        scenario.
    attitude
        wanted: that of the orbit frame; nearest: if that cannot be held, the nearest one that can,
        to which the body axes of designed.toml are rotated.
    goal
        quickest: the fastest of the laws that settle most, with tuned gains; settled: the first law
        proven to settle the required fraction, and tuning only if there is none.
    results.out
        Output folder; by default jaxsat-NAME-designed in the current folder.
    """
    vehicle = load_vehicle(scenario, overrides)
    import jaxsat

    result = present_result(
        scenario,
        "designed",
        results,
        lambda **into: jaxsat.design(
            vehicle,
            law=law,
            settled=settled,
            cases=cases,
            steps=steps,
            seed=seed,
            attitude=attitude,
            goal=goal,
            **into,
        ),
        design.__annotations__,
    )
    if result.outcome == "reached":
        return SUCCESS
    if results.quiet:
        print_stderr(result.headline)
    return FAILED_RUN
