"""Which commands do not take a scenario that is right, and why."""

from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING

from jaxsat.core.errors import JaxsatError

if TYPE_CHECKING:
    from jaxsat.scenario import Scenario


TABLES = ("orbit", "initial", "control", "simulation")
"""Of a scenario that is more than a vehicle."""


def refusals(scenario: "Scenario") -> Iterator[str]:
    """A line for each group of commands that refuse the scenario, by what they themselves ask."""
    if scenario.dispersion is None:
        yield "not for montecarlo and tune: dispersion must be given, got nothing"
    elif scenario.tuning is None:
        yield "not for tune: tuning must be given, got nothing"
    from jaxsat.synthesis.bounds.run import required_manoeuvre

    trials: dict[str, Callable[[], object]] = {
        "bound and front": lambda: required_manoeuvre(scenario),
        "design": lambda: _require_vehicle(scenario),
        "export": lambda: _require_flight_code(scenario),
    }
    for commands, trial in trials.items():
        try:
            trial()
        except JaxsatError as error:
            yield f"not for {commands}: {error}"


def says_no_more_than_a_vehicle(scenario: str, overrides: Sequence[str]) -> bool:
    """Whether a file has none of the `TABLES`, which `design` fills in."""
    from jaxsat.scenario.read import given_keys

    keys = given_keys(scenario, overrides)
    return any(key.startswith(("spacecraft.", "thruster", "wheel")) for key in keys) and not any(
        key.startswith(f"{table}.") or key == table for key in keys for table in TABLES
    )


def _require_vehicle(scenario: "Scenario") -> None:
    from jaxsat.synthesis.controller_design.vehicle import vehicle_verdict

    vehicle_verdict(scenario)


def _require_flight_code(scenario: "Scenario") -> None:
    from jaxsat.flight.flight import FlightController
    from jaxsat.scenario.build.run import build_loop

    FlightController.of(build_loop(scenario))
