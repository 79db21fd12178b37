"""A vehicle from a scenario file that need not say more than what is left of it."""

from collections.abc import Callable, Iterable, Mapping
from pathlib import Path
from typing import Any, NamedTuple

from jaxsat.core.text import clean
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.load import load
from jaxsat.scenario.given import given_keys
from jaxsat.scenario.overrides import override
from jaxsat.scenario.read import warn

ALL, QUICK = "all", "quick"
"""In place of a law: every law of jaxsat that fits, or those that are verified within minutes."""

UNNAMED_LAW = "three-slew"
"""Law of a scenario whose file names none; every key of it that is left out has a default."""

UNTIMED = 1.0
"""Duration (s) of a scenario whose file has none."""

_DEFAULTS: Mapping[str, tuple[tuple[str, ...], Any]] = {
    "title": (("title",), ""),
    "orbit.rate_rad_s": (("orbit.rate_rad_s", "orbit.altitude_km"), 0.0),
    "initial.quaternion": (
        ("initial.quaternion", "initial.w", "initial.z_rad", "initial.z_deg"),
        [1.0, 0.0, 0.0, 0.0],
    ),
    "initial.omega_rad_s": (("initial.omega_rad_s", "initial.omega_deg_s"), [0.0, 0.0, 0.0]),
    "control.law": (("control.law",), UNNAMED_LAW),
    "simulation.duration_s": (("simulation.duration_s",), UNTIMED),
    "simulation.save_every_s": (("simulation.save_every_s",), 0.5),
}
"""Keys that may be left out, by any of which a file gives them, and what they are then; the title
is the file's name."""


class Vehicle(NamedTuple):
    """A scenario to design for: the law that was asked for, and whether a duration was given."""

    scenario: Scenario
    law: str
    timed: bool


def read_vehicle(
    name_or_path: str | Path,
    overrides: Iterable[str] = (),
    *,
    caution: Callable[[str], None] = warn,
) -> Vehicle:
    """The scenario of a file whose vehicle is to get a controller.

    What `jaxsat.load` needs and a vehicle does not have may be left out: title, orbit (inertial
    pointing then), start (at rest in the wanted attitude), law (those of `QUICK`; so with "coast"),
    duration. A body in orbit without `[disturbance]` and without wheels gets gravity gradient.
    Raises `ScenarioError` and tells `caution` as `jaxsat.load` does.
    """
    given = list(overrides)
    present = given_keys(name_or_path, given)
    lacking = [key for key, (spellings, _) in _DEFAULTS.items() if not present & {*spellings}]
    name = clean(Path(name_or_path).stem) or "vehicle"
    added = [override(key, name if key == "title" else _DEFAULTS[key][1]) for key in lacking]
    if _has_unsaid_torques(present, in_orbit="orbit.rate_rad_s" not in lacking):
        added.append(override("disturbance.gravity_gradient", True))
    scenario = load(name_or_path, [*added, *given], purpose="motion", caution=caution)
    law = scenario.control.law
    quick = "control.law" in lacking or law == "coast"
    return Vehicle(scenario, QUICK if quick else law, "simulation.duration_s" not in lacking)


def _has_unsaid_torques(present: set[str], in_orbit: bool) -> bool:
    """Whether a body in orbit has no word on its disturbances; wheels would store their torque."""
    tables = {key.partition(".")[0] for key in present}
    return in_orbit and not tables & {"disturbance", "wheel"}
