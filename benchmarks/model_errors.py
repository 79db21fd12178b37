"""What the diagnosis takes for failures when the model is wrong: the tables of docs/diagnosis.md.

    python benchmarks/model_errors.py
    python benchmarks/model_errors.py --torque 0.01 --torque 0.1 --error inertia=0.2

Flies a scenario that draws failures with a constant torque from outside, or with larger errors of
inertia, thrust or mounting in place of its own: once with the failures after the end, once with one
failure in each case. Prints for each a row: cases that settle, alarms before any failure, and cases
in which a working thruster is isolated.
"""

import argparse
import warnings
from collections.abc import Sequence
from typing import NamedTuple

import jax
import numpy as np

from jaxsat.scenario import ScenarioWarning
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study

NEVER = (
    "dispersion.failure_time_s={distribution='uniform', low=5000, high=6000}",
    "simulation.duration_s=2400",
)
TORQUES = (0.0, 0.01, 0.03, 0.1, 0.3)
"""Along (1, -1, 0), of what one thruster makes."""

ERRORS = ("inertia=0.2", "inertia=0.3", "inertia=0.5", "torque_gain=0.2", "torque_gain=0.3",
          "torque_gain=0.5", "misalignment_rad=0.0524", "misalignment_rad=0.0873",
          "misalignment_rad=0.1745")  # fmt: skip


WIDTHS = (9, 9, 9, 9, 16, 10)


class Counts(NamedTuple):
    """Cases that settled, alarms before any failure and in how many cases, cases of a mistake."""

    settled: int
    alarms: int
    alarmed: int
    mistaken: int


def torque_of_a_thruster(scenario_name: str) -> float:
    """The largest torque about one axis that the first thruster makes, N m."""
    thruster = load(scenario_name, purpose="study").thruster[0]
    direction = np.asarray(thruster.direction) / np.linalg.norm(thruster.direction)
    return float(np.abs(np.cross(thruster.position_m, thruster.force_N * direction)).max())


def spread_of(error: str) -> str:
    """The dispersion of `NAME=SPREAD`, between -SPREAD and SPREAD."""
    name, spread = error.split("=")
    return (
        f"dispersion.{name}={{distribution='uniform', low={-float(spread)}, high={float(spread)}}}"
    )


def flown(scenario_name: str, overrides: Sequence[str], cases: int, seed: int) -> Counts:
    """A study of the scenario with these overrides."""
    study = build_study(load(scenario_name, overrides, purpose="study"), cases, seed=seed)
    found = study.values(np.arange(cases))
    struck = found["failure_kind"] != 0
    parts = np.arange(found["isolated_kind"].shape[1])
    failed = np.any((found["failed_part"][..., None] == parts) & struck[..., None], axis=1)
    mistaken = np.any((found["isolated_kind"] != 0) & ~failed, axis=1)
    return Counts(
        int(np.isfinite(found["settling_time"]).sum()),
        int(found["false_alarms"].sum()),
        int((found["false_alarms"] > 0).sum()),
        int(mistaken.sum()),
    )


def main() -> None:
    """Fly and print both tables."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--scenario", default="failures-12u")
    parser.add_argument("--torque", type=float, action="append", help="of a thruster's")
    parser.add_argument("--error", action="append", metavar="NAME=SPREAD")
    parser.add_argument("--cases", type=int, default=128)
    parser.add_argument("--seed", type=int, default=9)
    given = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    warnings.simplefilter("ignore", ScenarioWarning)  # that the failures after the end never strike
    largest = torque_of_a_thruster(given.scenario)
    rows = {
        f"torque {share:.0%}": f"disturbance.constant_N_m=[{share * largest},{-share * largest},0]"
        for share in given.torque or (() if given.error else TORQUES)
    } | {error: spread_of(error) for error in given.error or (() if given.torque else ERRORS)}
    heads = f"nothing fails, {given.cases} cases", f"one fails, {2 * given.cases} cases"
    print(f"{'':24}{heads[0]:>36}{heads[1]:>26}")
    words = *Counts._fields, "settled", "mistaken"
    print(
        f"{'':24}" + "".join(f"{word:>{width}}" for word, width in zip(words, WIDTHS, strict=True))
    )
    for name, override in rows.items():
        calm = flown(given.scenario, [override, *NEVER], given.cases, given.seed)
        lost = flown(given.scenario, [override], 2 * given.cases, given.seed)
        counts = *calm, lost.settled, lost.mistaken
        row = zip(counts, WIDTHS, strict=True)
        print(f"{name:24}" + "".join(f"{count:{width}}" for count, width in row), flush=True)


if __name__ == "__main__":
    main()
