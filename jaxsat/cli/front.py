"""`jaxsat front`: time against effort, for a scenario's manoeuvre and the laws that fly it."""

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from jaxsat.cli.bound import unsuitable
from jaxsat.cli.computing import interruptibly
from jaxsat.cli.loading import load_scenario
from jaxsat.cli.options import (
    End,
    Output,
    Overrides,
    Starts,
    TorqueLimits,
    option_mistake,
    torque_limits,
)
from jaxsat.cli.progress import show_progress
from jaxsat.cli.terminal import (
    FAILED_RUN,
    SUCCESS,
    UserMistake,
    print_document,
    print_stderr,
    print_stdout,
)

if TYPE_CHECKING:
    from jaxsat.scenario import Scenario
    from jaxsat.synthesis.comparison.front import Front


def front(
    scenario: str,
    /,
    *,
    law: Annotated[tuple[str, ...], Parameter(negative="")] = (),
    torque_limit: TorqueLimits = (),
    guesses: Starts = 24,
    end: End = "settled",
    overrides: Overrides = (),
    output: Output = Output(),
) -> int:
    """Find the least effort within each time for a scenario's manoeuvre, and what laws take.

    Plans with two or more torques from the scenario's start to where laws count as settled, or to
    rest in the orbit frame: the least time, and the least effort within 1.005 to 8 times that. The
    plans are local optima and are flown again by an independent integrator. Prints them beside the
    laws, and writes a figure.

    Parameters
    ----------
    scenario
        A name from `jaxsat scenarios list`, or a TOML file, with a torque limit and thrusters that
        make a torque of either sign.
    law
        A law to fly from the same start, by name, module:Class or scenario file; may be given
        several times. By default that of the scenario.
    torque_limit
        Torque limit in N m in place of the scenario's, or all for 1, 5 and 20; may be given several
        times.
    guesses
        Ways to the target from which each plan is sought.
    end
        Where plans end. settled: within the tolerances of the scenario's [settled], as laws do;
        rest: exactly at rest, which laws do not reach.
    output.out
        Folder for the numbers and the figure; by default jaxsat-front.
    """
    limits = [f"spacecraft.torque_limit_N_m={one}" for one in torque_limits(torque_limit)]
    scenarios = [load_scenario(scenario, [*overrides, one], "motion") for one in limits]
    scenarios = scenarios or [load_scenario(scenario, overrides, "motion")]
    laws = list(dict.fromkeys(law or (scenarios[0].control.law,)))
    for one in scenarios:
        _require_suitable(one, laws)
    from jaxsat.report.front import front_document, write_front
    from jaxsat.store.folder import OutputFolder
    from jaxsat.store.provenance import record_of
    from jaxsat.synthesis.optima.run import end_data, tolerances_at

    out = output.out or Path("jaxsat-front")

    with OutputFolder(out, kind="front", overwrite=output.overwrite) as folder:
        results = interruptibly(lambda: [_front(one, laws, guesses, end) for one in scenarios])
        meaning = end_data(end, tolerances_at(scenarios[0], end))
        fronts = [one.as_data() for one in results]
        record = record_of({**meaning, "fronts": fronts})
        interruptibly(lambda: write_front(folder.write, scenarios[0].title, record))
    if not output.quiet:
        print_document(front_document(scenarios[0].title, record))
        print_stdout(f"written to {out}")
    unreached = [f"{one.torque_limit:g}" for one in results if not one.points]
    if unreached:
        print_stderr(
            f"no plan reaches the target with {' or '.join(unreached)} N m; give more --guesses, "
            "and ask `jaxsat controllability` what the thrusters can do"
        )
    return FAILED_RUN if unreached else SUCCESS


def _require_suitable(scenario: "Scenario", laws: Sequence[str]) -> None:
    from jaxsat.synthesis.comparison.in_scenario import scenario_under
    from jaxsat.synthesis.optima.run import UnsuitableScenario, require_ideal_thrusters

    try:
        require_ideal_thrusters(scenario, "a front")
    except UnsuitableScenario as error:
        raise unsuitable(error) from None
    for law in laws:
        try:
            scenario_under(scenario, law)
        except ValueError as error:
            raise option_mistake(error, ["law"], "--law: ") from None


def _front(scenario: "Scenario", laws: Sequence[str], guesses: int, end: End) -> "Front":
    import jaxsat

    limit = f"{scenario.spacecraft.torque_limit_N_m:g} N m"

    def show(what: str) -> None:
        show_progress(f"{limit}: {what}")

    try:
        return jaxsat.front(scenario, laws, guesses, show, end)
    except ValueError as error:
        raise UserMistake(str(error)) from None
