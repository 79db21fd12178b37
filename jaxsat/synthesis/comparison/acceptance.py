"""The acceptance set: laws under torque limits and dispersions.

Starts, spacecraft, disturbance and dispersions are the scenarios `acceptance-LEVEL` of the library.
This module holds what differs between the laws: their tables and durations.
"""

import enum
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, NamedTuple

import numpy as np
from pydantic import ValidationError

from jaxsat.core.errors import ArgumentError
from jaxsat.core.process import add_folders
from jaxsat.scenario import Problem, Scenario, ScenarioError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import EngineName, build_study
from jaxsat.scenario.control import is_plugin, known_law
from jaxsat.scenario.errors import key_of
from jaxsat.scenario.overrides import override
from jaxsat.scenario.schema import issues_of
from jaxsat.studies.ensemble import Study

LEVELS = ("nominal", "mc", "hard")
"""Levels of dispersions, each a scenario `acceptance-LEVEL`."""

LAWS: Mapping[str, str] = MappingProxyType(
    {
        "three-slew": "stop, three slews, oscillate, hold",
        "oscillatory": "oscillate until all is small, then hold",
        "switching": "the paper's proposal: (38)-(39) while |ω3| is large, else (40)-(42); tuned",
        "three-axis": "(40)-(42) with the printed gains",
        "rate": "(38)-(39) with the printed gains",
    }
)
"""Description of each law. The last three are the paper's, sampled like the others."""

MORE_LAWS: Mapping[str, str] = MappingProxyType(
    {"planned": "plan the quickest manoeuvre in flight, follow it, hold"}
)
"""Laws that are compared only by name, as they take long to compute."""

_HORIZONS = {1.0: 2000.0, 5.0: 1200.0, 20.0: 1000.0}
LIMITS = tuple(_HORIZONS)
"""Torque limits, N m."""

PERIOD = 0.1
"""Sampling period of the sampled laws, s."""

_NEVER, _ALWAYS = 1e6, 1e-12
"""Thresholds on |ω3| (rad/s) at which the switching law never or always takes the rate law."""


FILE = ".toml"


class ComparisonSetting(NamedTuple):
    """A law under a torque limit (N m) at a level of dispersions."""

    level: str
    torque_limit: float
    law: str


def horizon(torque_limit: float) -> float:
    """Return the duration of a case (s): 2000, 1200, 1000 at 1, 5, 20 N m.

    In between it is linear in logarithms, rounded to 10 s; below 1 N m proportional to the duration
    of a slew, 1/√Tm.
    """
    limits = sorted(_HORIZONS)
    seconds = np.exp(
        np.interp(np.log(torque_limit), np.log(limits), np.log([_HORIZONS[one] for one in limits]))
    )
    return float(round(seconds * max(1.0, torque_limit**-0.5), -1))


def comparison_scenario(setting: ComparisonSetting) -> Scenario:
    """Return the scenario of one law on the acceptance set.

    The paper's laws are sampled like the others: ten times a second on sensor data, torque held,
    dω_d/dt by a backward difference. The three-axis and the rate law are a switching law that never
    switches. Besides those of `LAWS` and `MORE_LAWS` the law may be a plug-in, with the defaults of
    its keys, or the name of a scenario file, whose `[control]` is used. Raises `ValueError` for an
    unknown level or law, and `ScenarioError` for a torque limit that no scenario can have and for a
    law that does not suit the set.
    """
    if setting.level not in LEVELS:
        levels = ", ".join(LEVELS)
        raise ArgumentError("level", f"must be one of {levels}", setting.level)
    law_names = (*LAWS, *MORE_LAWS)
    if not (setting.law in law_names or is_plugin(setting.law) or setting.law.endswith(FILE)):
        raise ArgumentError(
            "law",
            f"must be one of {', '.join(law_names)}, an installed law, a law of the form "
            f'"module:Class" or the name of a {FILE} file',
            setting.law,
        )
    base = load(
        f"acceptance-{setting.level}",
        [
            override("spacecraft.torque_limit_N_m", setting.torque_limit),
            override("simulation.duration_s", horizon(setting.torque_limit)),
        ],
        caution=lambda text: None,  # the table names untuned limits once
    )
    data = base.model_dump(exclude_none=True)
    data["title"] = f"{base.title}: {setting.law}, {setting.torque_limit:g} N m"
    data["control"] = _control(setting.law)
    _require_sampled(setting.law, str(data["control"].get("law")))
    return validated(data, f"{base.title}: {setting.law}")


def validated(data: Mapping[str, Any], source: str) -> Scenario:
    """Validate tables of a scenario; raises `ScenarioError` with all problems of `source`."""
    try:
        return Scenario.model_validate(data)
    except ValidationError as error:
        raise ScenarioError(
            [Problem(source, one.message, key_of(one.location)) for one in issues_of(error)]
        ) from None


def _require_sampled(name: str, law: str) -> None:
    """Raise `ValueError` for a law that cannot fly with two thrusters on samples."""
    definition = known_law(law)
    if definition is not None and not (
        definition.declaration.sampled and definition.declaration.torques == 2
    ):
        kind = "sampled" if definition.declaration.sampled else "continuous"
        raise ArgumentError(
            "law",
            "must be a sampled law for two torques on the acceptance set",
            f"{name}, which is {kind} and commands {definition.declaration.torques} torques",
        )


def _control(law: str) -> dict[str, Any]:
    if law.endswith(FILE):
        return load(law, purpose="text").control.model_dump(exclude_none=True)
    if law not in (*LAWS, *MORE_LAWS):
        if ":" in law:
            add_folders([str(Path.cwd())])
        return {"law": law}
    if law in ("three-slew", "oscillatory", *MORE_LAWS):
        return {"law": law, "period_s": PERIOD}
    tuned_control = load("switching").control.model_dump(exclude_none=True)
    if law == "switching":
        return tuned_control
    printed_control = load("free-third-rate").control.model_dump(exclude_none=True)
    printed_control |= load("paper-rate").control.model_dump(exclude_none=True)
    threshold = _NEVER if law == "three-axis" else _ALWAYS
    return printed_control | {
        "law": "switching",
        "period_s": PERIOD,
        "upper_threshold_rad_s": threshold,
        "lower_threshold_rad_s": threshold,
        "measured_disturbance": (False, False, False),
    }


class Start(enum.Enum):
    """Start of the cases of a study: at random, or all in the paper's initial state."""

    RANDOM = "random"
    PAPER = "paper"


def comparison_study(
    setting: ComparisonSetting,
    start: Start,
    count: int,
    seed: int,
    *,
    engine: EngineName = "auto",
    batch_size: int = 50,
    chunk: int | None = None,
) -> Study:
    """Return the study of `count` cases of one law on the acceptance set.

    With the same seed case i has the same spacecraft, start and noise for every law and limit. The
    other arguments are those of `build_study`.
    """
    scenario = comparison_scenario(setting)
    if start is Start.PAPER:
        scenario = _from_the_papers_start(scenario)
    return build_study(
        scenario, count, seed=seed, engine=engine, batch_size=batch_size, chunk=chunk
    )


def _from_the_papers_start(scenario: Scenario) -> Scenario:
    undrawn = {"attitude": None, "omega_rad_s": None}
    dispersion = scenario.dispersion
    assert dispersion is not None  # every acceptance scenario has one
    return scenario.model_copy(update={"dispersion": dispersion.model_copy(update=undrawn)})
