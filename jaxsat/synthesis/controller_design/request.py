"""Input of a design: the vehicle of a file, requirements, numbers of cases and seeds.

The file need only describe the vehicle that is left.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any, Literal, NamedTuple

from jaxsat.core.checks import require_counts
from jaxsat.core.errors import ArgumentError
from jaxsat.core.text import clean
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import EngineName
from jaxsat.scenario.checks import ATTITUDE_KEYS
from jaxsat.scenario.overrides import override
from jaxsat.scenario.read import given_keys, warn

ALL, QUICK = "all", "quick"
"""Names for every law of jaxsat that fits, and for those that are verified within minutes."""

UNNAMED_LAW = "three-slew"
"""Law of a scenario whose file names none; all its keys have defaults."""

UNTIMED = 1.0
"""Duration (s) of a scenario whose file has none."""

_DEFAULTS: Mapping[str, tuple[tuple[str, ...], Any]] = {
    "title": (("title",), ""),
    "orbit.rate_rad_s": (
        ("orbit.rate_rad_s", "orbit.altitude_km", "orbit.perigee_altitude_km"),
        0.0,
    ),
    "initial.quaternion": (tuple(f"initial.{key}" for key in ATTITUDE_KEYS), [1.0, 0.0, 0.0, 0.0]),
    "initial.omega_rad_s": (("initial.omega_rad_s",), [0.0, 0.0, 0.0]),
    "control.law": (("control.law",), UNNAMED_LAW),
    "simulation.duration_s": (("simulation.duration_s",), UNTIMED),
    "simulation.save_every_s": (("simulation.save_every_s",), 0.5),
}
"""Optional keys, the keys by which a file may give each, and the default; the title's is the file
name."""


class Vehicle(NamedTuple):
    """A scenario to design for: the requested law, and whether a duration was given."""

    scenario: Scenario
    law: str
    timed: bool


def read_vehicle(
    name_or_path: str | Path,
    overrides: Iterable[str] = (),
    *,
    caution: Callable[[str], None] = warn,
) -> Vehicle:
    """Read the scenario of a file whose vehicle is to get a controller.

    Optional keys, in contrast to `jaxsat.load`: title, orbit (default: inertial pointing), start
    (at rest in the target attitude), law (`QUICK`, also for "coast"), duration. A body in orbit
    without `[disturbance]` and without wheels gets gravity gradient. Raises `ScenarioError` and
    warns by `caution` as `jaxsat.load` does.
    """
    user_overrides = list(overrides)
    present = given_keys(name_or_path, user_overrides)
    lacking = [key for key, (spellings, _) in _DEFAULTS.items() if not present & {*spellings}]
    name = clean(Path(name_or_path).stem) or "vehicle"
    defaults = [override(key, name if key == "title" else _DEFAULTS[key][1]) for key in lacking]
    if _has_unsaid_torques(present, in_orbit="orbit.rate_rad_s" not in lacking):
        defaults.append(override("disturbance.gravity_gradient", True))
    scenario = load(name_or_path, [*defaults, *user_overrides], purpose="motion", caution=caution)
    law = QUICK if "control.law" in lacking else law_asked_for(scenario)
    return Vehicle(scenario, law, "simulation.duration_s" not in lacking)


def law_asked_for(scenario: Scenario) -> str:
    """Return the law to design for a scenario: its own, or `QUICK` for "coast"."""
    return QUICK if scenario.control.law == "coast" else scenario.control.law


def _has_unsaid_torques(present: set[str], in_orbit: bool) -> bool:
    """Whether a body in orbit has no table of disturbances; wheels would store their torque."""
    tables = {key.partition(".")[0] for key in present}
    return in_orbit and not tables & {"disturbance", "wheel"}


SCREENING_CASES, VALIDATION_CASES, SURE_CASES = 500, 1000, 2000

MAX_SEED = 2**63 - 4
"""Largest seed that leaves room for the three that follow it."""

Attitude = Literal["wanted", "nearest"]
Goal = Literal["quickest", "settled"]


class Seeds(NamedTuple):
    """A seed for every step, so that no step sees the cases of another."""

    screening: int
    tuning: int
    validation: int
    verification: int


@dataclass(frozen=True)
class DesignSettings:
    """Requirements and settings of a design.

    `law` is one law, "all" or "quick", `settled` the fraction of cases that must settle, `cases`
    those of the verification, `steps` those of the tuner (0 skips tuning). With `attitude`
    "nearest" the target is the nearest attitude that can be held. The `goal` "quickest" is the
    quickest law of those that settle most; "settled" ends with the first one that settles the
    required fraction with confidence. Raises `ArgumentError` for invalid values.
    """

    law: str
    settled: float = 0.99
    cases: int = 2000
    steps: int = 16
    seed: int = 0
    attitude: Attitude = "wanted"
    goal: Goal = "quickest"
    engine: EngineName = "auto"

    def __post_init__(self):
        require_counts(cases=self.cases)
        if self.steps < 0:
            raise ArgumentError("steps", "must not be negative", self.steps)
        if not 0 <= self.seed <= MAX_SEED:
            raise ArgumentError("seed", f"must be from 0 to {MAX_SEED}", self.seed)
        if not 0 < self.settled <= 1:
            raise ArgumentError("settled", "must be above 0 and at most 1", self.settled)
        if self.attitude not in ("wanted", "nearest"):
            raise ArgumentError("attitude", "must be wanted or nearest", self.attitude)
        if self.goal not in ("quickest", "settled"):
            raise ArgumentError("goal", "must be quickest or settled", self.goal)

    @property
    def seeds(self) -> Seeds:
        """Seeds of the steps: consecutive ones from `seed` on."""
        return Seeds(*range(self.seed, self.seed + 4))

    @property
    def screening_cases(self) -> int:
        """Largest number of cases in the screening."""
        return min(SCREENING_CASES if self.goal == "quickest" else SURE_CASES, self.cases)

    @property
    def validation_cases(self) -> int:
        """Number of cases on which tuned gains must be better."""
        return min(VALIDATION_CASES, self.cases)

    def identity(self) -> dict[str, Any]:
        """Settings by which a folder is resumed: all but the size of the verification."""
        return {
            "goal": self.goal,
            "settled": self.settled,
            "law": self.law,
            "steps": self.steps,
            "seed": self.seed,
            "attitude": self.attitude,
            "engine": self.engine,
            "screening_cases": self.screening_cases,
            "validation_cases": self.validation_cases,
        }
