"""Where the laws that settle still do: one dimensionless number swept at a time (docs/laws.md).

    python benchmarks/domain.py --out domain.csv --declare jaxsat/core/declaration/verified.toml

Around the paper's spacecraft at 5 N m and the dispersions of `acceptance-hard`. One row for every
law and value, with the fraction that settled within 144 τ; an existing file is added to.
`--declare` writes them where the laws declare them.
"""

import argparse
import csv
import math
import sys
import warnings
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import diffrax
import jax
import numpy as np

from jaxsat.scenario import Scenario, ScenarioWarning
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import study_program
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.studies.designs import Independent
from jaxsat.studies.ensemble import Study
from jaxsat.studies.statistics import wilson

LAWS = ("three-slew", "oscillatory")
LIMIT, PERIOD, DURATION = 5.0, 0.1, 1200.0
MOMENTS = (449.5, 264.6, 312.5)

SWEEPS: dict[str, tuple[float, ...]] = {
    "coupling": (0.02, 0.05, 0.1, 0.15, 0.2, 0.3, 0.592, 0.95),
    "moment_ratio": (0.5, 0.7, 1.1, 1.5, 2.0, 4.0, 8.0),
    "lean": (0.1, 0.2, 0.4, 0.6),
    "orbit_rate": (0.0, 6e-4, 3e-3, 0.0091, 0.014, 0.02, 0.0225, 0.025, 0.03, 0.05),
    "period": (0.002, 0.0054, 0.024, 0.06, 0.09, 0.12),
    "rate_noise": (0.0, 1e-3, 2.5e-3, 5e-3, 1e-2),
    "attitude_noise": (0.0, 3e-4, 1e-3, 3e-3, 1e-2),
    "disturbance": (0.0, 0.01, 0.025, 0.05, 0.1),
    "disturbance_rate": (0.0, 0.2, 0.3, 0.4, 0.5, 0.6, 1.0),
    "constant_disturbance": (0.0, 1e-6, 4e-6, 1e-5, 2e-5),
    "axes_angle": (0.1, 0.26, 0.52, 0.8),
}
"""Values of each number; `jaxsat.core.declaration.domain` says what it is."""

REFERENCE = {
    "coupling": 0.592,
    "moment_ratio": 1.1,
    "lean": 0.0,
    "orbit_rate": 0.0091,
    "period": 0.012,
    "rate_noise": 2.5e-4,
    "attitude_noise": 1e-4,
    "disturbance": 0.0045,
    "disturbance_rate": 0.104,
    "constant_disturbance": 0.0,
    "axes_angle": 1.5708,
}
"""What they are for the paper's spacecraft at 5 N m."""

HEAD = """\
# What share of {cases} hard cases settled, one dimensionless number swept at a time, around the
# paper's spacecraft at 5 N m; `moment_ratio` at c = 0.3. Read by `jaxsat.core.declaration.domain`.
# Written by
#
#     python benchmarks/domain.py --out domain.csv --declare jaxsat/core/declaration/verified.toml

"""


def scenario_of(law: str, number: str, value: float) -> Scenario:
    """The paper's spacecraft with one number changed."""
    data: dict[str, Any] = load("acceptance-hard", purpose="text").model_dump(exclude_none=True)
    mean = math.sqrt(MOMENTS[0] * MOMENTS[1])
    tau, period = math.sqrt(mean / LIMIT), PERIOD
    inertia, axes = np.diag(MOMENTS), np.eye(3)[:2]
    if number == "coupling":
        half = value * MOMENTS[2] / 2
        middle = math.sqrt(mean**2 + half**2)
        inertia = np.diag([middle + half, middle - half, MOMENTS[2]])
    elif number == "moment_ratio":
        third = mean / value
        half = 0.3 * third / 2
        middle = math.sqrt(mean**2 + half**2)
        inertia = np.diag([middle + half, middle - half, third])
    elif number == "lean":
        across = -np.array([1.0, 0.0]) * value * MOMENTS[2]
        inertia[:2, 2] = inertia[2, :2] = across
        inertia[:2, :2] += np.outer(across, across) / MOMENTS[2]
    elif number == "orbit_rate":
        data["orbit"]["rate_rad_s"] = value / tau
    elif number == "period":
        period = value * tau
    elif number in ("rate_noise", "attitude_noise"):
        key, unit = ("rate_noise_rad_s", tau) if number == "rate_noise" else (f"{number}_rad", 1.0)
        data["sampling"][key] = value / unit
    elif number in ("disturbance", "disturbance_rate"):
        factor, table = value / REFERENCE[number], data["disturbance"]
        table["amplitude_N_m"] = [factor * one for one in table["amplitude_N_m"]]
        if number == "disturbance" and factor:  # the rates that it makes stay as they are
            table["frequency_rad_s"] = [factor * one for one in table["frequency_rad_s"]]
    elif number == "constant_disturbance":
        data["disturbance"]["constant_N_m"] = [0.0, 0.0, value * LIMIT]
    elif number == "axes_angle":
        half = value / 2
        axes = np.array([[math.cos(half), math.sin(half), 0], [math.cos(half), -math.sin(half), 0]])
    data["title"] = f"{number} = {value:g} under {law}"
    data["spacecraft"] = {
        "inertia_kg_m2": inertia.tolist(),
        "thruster_torque_axes": axes.tolist(),
        "torque_limit_N_m": LIMIT,
        "third_rate": "free",
    }
    data["control"] = {"law": law, "period_s": period}
    data["simulation"]["duration_s"] = math.ceil(DURATION / period) * period
    data["simulation"]["save_every_s"] = period
    return Scenario.model_validate(data)


def rows(cases: int, seed: int, done: set[tuple[str, str, float]]) -> Iterator[dict[str, Any]]:
    """One row for every law and value that is not done."""
    engine = NativeEngine(stepper=FixedStepper(diffrax.Bosh3(), 1), batch_size=cases)
    for number, values in SWEEPS.items():
        for law in LAWS:
            for value in values:
                if (law, number, value) in done:
                    continue
                scenario = scenario_of(law, number, value)
                _, program = study_program(scenario, build(scenario), seed)
                found = Study(program, Independent(seed), engine, cases).values(np.arange(cases))
                times = found["settling_time"]
                settled = wilson(int(np.isfinite(times).sum()), cases)
                yield {
                    "law": law,
                    "number": number,
                    "value": value,
                    "cases": cases,
                    "settled": settled.value,
                    "low": settled.low,
                    "high": settled.high,
                    "t50_s": float(np.percentile(times, 50, method="higher")),
                    "t90_s": float(np.percentile(times, 90, method="higher")),
                }


def declared(kept: list[dict[str, str]], cases: int) -> str:
    """The rows as `jaxsat/core/declaration/verified.toml`."""
    text = HEAD.format(cases=cases)
    for law in LAWS:
        for number in SWEEPS:
            settled = sorted(
                [float(row["value"]), round(float(row["settled"]), 3)]
                for row in kept
                if (row["law"], row["number"]) == (law, number)
            )
            text += (
                f"[{law}.{number}]\nreference = {REFERENCE[number]!r}\nsettled = {settled!r}\n\n"
            )
    return text.rstrip() + "\n"


def main() -> None:
    """Fly the sweeps that the file lacks."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=128)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--out", type=Path, default=Path("domain.csv"))
    parser.add_argument("--declare", type=Path, help="data file to write the rows to")
    given = parser.parse_args()
    warnings.simplefilter("ignore", ScenarioWarning)
    jax.config.update("jax_enable_x64", True)
    kept: list[dict[str, str]] = []
    if given.out.exists():
        with given.out.open(newline="") as file:
            kept = list(csv.DictReader(file))
    done = {(row["law"], row["number"], float(row["value"])) for row in kept}
    with given.out.open("a", newline="") as file:
        for row in rows(given.cases, given.seed, done):
            writer = csv.DictWriter(file, row, lineterminator="\n")
            if not file.tell():
                writer.writeheader()
            writer.writerow(row)
            file.flush()
            print(f"{row['number']} {row['value']:g} {row['law']}: {row['settled']:.1%}")
            kept.append({name: str(value) for name, value in row.items()})
    if given.declare is not None:
        given.declare.write_text(declared(kept, given.cases))


if __name__ == "__main__":
    sys.exit(main())
