"""`jaxsat scenarios`: list the library, print the schema, check scenario files."""

import json
from collections.abc import Callable, Iterator, Mapping, Sequence, Set
from typing import TYPE_CHECKING

from cyclopts import App

from jaxsat.cli.loading import load_scenario, load_vehicle
from jaxsat.cli.options import Overrides, Printed, option_mistake
from jaxsat.cli.terminal import (
    SUCCESS,
    USER_MISTAKE,
    UserMistake,
    print_problems,
    print_stdout,
    print_text,
)
from jaxsat.core.errors import JaxsatError
from jaxsat.core.text import clean

if TYPE_CHECKING:
    from jaxsat.scenario import Scenario
    from jaxsat.synthesis.controller_design.request import Vehicle

TABLES = ("initial", "control", "simulation")
"""Tables that `controllability` and `design` do not need."""

scenarios = App(name="scenarios", help="List, show and check scenarios.", help_format="plaintext")


@scenarios.command(name="list")
def list_scenarios(*, printed: Printed = Printed()) -> int:
    """List the scenarios that come with jaxsat."""
    del printed  # `run` reads it
    from jaxsat.scenario import library

    names = library()
    width = max(map(len, names))
    for name in names:
        print_stdout(f"{name:<{width}}  {load_scenario(name, purpose='text').title}")
    return SUCCESS


@scenarios.command
def show(name: str, /, *, printed: Printed = Printed()) -> int:
    """Print a scenario of the library as a TOML file, to read or to start from.

    Parameters
    ----------
    name
        One of the names that `jaxsat scenarios list` gives.
    """
    del printed
    from jaxsat.core.text import suggestion
    from jaxsat.scenario import library
    from jaxsat.scenario.errors import MAX_PLACE_LENGTH

    names = library()
    if name not in names:
        hint = suggestion(name, names)
        text = clean(name, MAX_PLACE_LENGTH)
        raise UserMistake(
            f"{text}: must be a scenario of jaxsat ({', '.join(names)}), got another name{hint}"
        )
    print_text(names[name].read_text(encoding="utf-8"))
    return SUCCESS


@scenarios.command
def schema(*, printed: Printed = Printed()) -> int:
    """Print the JSON Schema of scenario files, with the unit of every quantity."""
    del printed
    from jaxsat.scenario import json_schema

    print_text(json.dumps(json_schema(), indent=2, ensure_ascii=False))
    return SUCCESS


@scenarios.command
def check(*files: str, overrides: Overrides = (), printed: Printed = Printed()) -> int:
    """Check scenario files and report every error in them.

    A file without errors can be run: the check builds it, with the dispersions of a study and the
    gains to tune if the file has them, names the commands that do not take it, and says where no
    law applies to the actuators left. [spacecraft] is enough for controllability and design.

    Parameters
    ----------
    files
        TOML files, or names from the library.
    printed.quiet
        Print only warnings and errors.
    """
    if not files:
        raise UserMistake("scenarios check: must be given at least one file, got none")

    from jaxsat.scenario import ScenarioError

    status = SUCCESS
    for file in files:
        try:
            verdict = _verdict(file, overrides)
        except ScenarioError as error:
            print_problems(error)
            status = USER_MISTAKE
        else:
            for line in () if printed.quiet else verdict:
                print_stdout(line)
    return status


def _verdict(file: str, overrides: Sequence[str]) -> list[str]:
    """Return lines on the uses of a valid file; raises `ScenarioError` with every error."""
    from jaxsat.scenario.read import given_keys

    tables = {key.partition(".")[0] for key in given_keys(file, overrides)}
    if says_no_more_than_a_vehicle(tables):
        missing = [one for one in ("orbit", *TABLES) if one not in tables]
        vehicle = load_vehicle(file, overrides)
        scenario, trials = vehicle.scenario, dict(VEHICLE_TRIALS)
        reasons = list(_flown_by_none(scenario))
        if not reasons:
            trials["design"] = lambda scenario: _require_law(vehicle)
        refusal_lines = list(_refused(scenario, trials))
        commands = "controllability" if refusal_lines else "controllability and design"
        others = f"not for the others: {', '.join(missing)} must be given"
        refusal_lines += [others, *reasons]
        what = f"valid for {commands}"
    else:
        scenario = load_scenario(file, overrides, "tuning")
        refusal_lines, what = list(refusals(scenario)), "valid"
    return [f"{clean(file)}: {what} ({scenario.title})", *(f"  {line}" for line in refusal_lines)]


def _flown_by_none(scenario: "Scenario") -> Iterator[str]:
    """Yield a line where no law of jaxsat flies to attitudes by the actuators left, although the
    scenario's own does not merely stop a rotation, as one of one torque, and is jaxsat's."""
    from jaxsat.scenario.build.actuator_set import why_no_law
    from jaxsat.scenario.control import known_law

    law = known_law(scenario.control.law)
    if law is None or law.declaration.torques == 1:
        return
    if reason := why_no_law(scenario):
        yield reason


def refusals(scenario: "Scenario") -> Iterator[str]:
    """Yield a line for each group of commands that refuse the scenario, by their own checks, and
    one where no law applies."""
    from jaxsat.scenario.errors import MissingTable

    if scenario.dispersion is None:
        yield f"not for montecarlo and tune: {MissingTable('dispersion')}"
    elif scenario.tuning is None:
        yield f"not for tune: {MissingTable('tuning')}"
    yield from _refused(scenario, {"bound and front": _require_manoeuvre, **VEHICLE_TRIALS})
    yield from _refused(scenario, {"export": _require_flight_code})
    yield from _flown_by_none(scenario)


def _refused(
    scenario: "Scenario", trials: Mapping[str, Callable[["Scenario"], object]]
) -> Iterator[str]:
    for commands, trial in trials.items():
        try:
            trial(scenario)
        except JaxsatError as error:
            yield f"not for {commands}: {option_mistake(error, ['law'])}"


def says_no_more_than_a_vehicle(keys: Set[str]) -> bool:
    """Whether a file with these tables has no law, which `design` chooses."""
    from jaxsat.core.declaration.actuators import ACTUATORS

    vehicle = {"spacecraft", *(one.name for one in ACTUATORS)}
    return bool(keys & vehicle) and "control" not in keys


def _require_manoeuvre(scenario: "Scenario") -> None:
    from jaxsat.synthesis.optima.run import required_manoeuvre

    required_manoeuvre(scenario)


def _require_vehicle(scenario: "Scenario") -> None:
    from jaxsat.controllability.judging import actuator_layout
    from jaxsat.scenario.build.actuator_set import all_actuators
    from jaxsat.synthesis.controller_design.candidates import required_law_to_design
    from jaxsat.synthesis.controller_design.request import law_asked_for
    from jaxsat.synthesis.controller_design.vehicle import require_judged

    required_law_to_design(law_asked_for(scenario))
    require_judged(scenario)
    actuators, working = all_actuators(scenario)
    actuator_layout(scenario.spacecraft.inertia_kg_m2, actuators.only(working))


def _require_law(vehicle: "Vehicle") -> None:
    from jaxsat.synthesis.controller_design.run import require_candidate

    _require_vehicle(vehicle.scenario)
    require_candidate(vehicle)


def _require_flight_code(scenario: "Scenario") -> None:
    from jaxsat.flight.flight import FlightController, Seen, flight_loop
    from jaxsat.scenario.build.run import build

    run = build(scenario)  # already built by the check
    FlightController.of(flight_loop(run.loop, run.start)).require_steered(Seen.of(run.start))


VEHICLE_TRIALS = {"design": _require_vehicle}
"""Trials of the commands that need [spacecraft] alone, and may refuse it."""
