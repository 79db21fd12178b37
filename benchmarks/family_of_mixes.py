"""Random spacecraft with wheels and thrusters, of which one or two fail in flight.

    python benchmarks/family_of_mixes.py --members 40 --cases 8 --out mixes.csv

Each flies `fault-tolerant` with the sensors and dispersions of the scenario `hybrid-wheels`. The
table holds what is recovered against what the torques that are left can recover. A table that
exists is continued. Member i of a seed is drawn from both alone.
"""

import argparse
import csv
import math
import warnings
from collections import Counter
from pathlib import Path

import jax
import numpy as np

from jaxsat.scenario import Scenario, ScenarioWarning
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.studies.recovery import Recovery

SEED = 20261127

MASS = (4.0, 5000.0)
"""kg, of a 3U CubeSat and of a large telescope; masses are drawn by their logarithm."""

DENSITY = 200.0
"""kg/m³: a body is a box of this density, whose sides differ by up to a half."""

ACCELERATION = (7e-4, 2e-3)
"""rad/s²: the torque of a wheel over the largest moment."""

RATE = (0.035, 0.07)
"""rad/s: the momentum of a full wheel over the largest moment."""

PUSH = (1.5e-3, 4e-3)
"""rad/s²: the torque of a thruster over the largest moment."""

WHEELS = np.array([[1, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1]]) / math.sqrt(2)
CORNERS = np.array([[x, y, z] for z in (1, -1) for x in (1, -1) for y in (1, -1)])
"""Signs of the corners of a box at which thrusters are, as those of `hybrid-wheels`."""

KINDS = {
    "wheel": ('kind="dead"', 'kind="stopped"', 'kind="degraded", fraction=0.3'),
    "thruster": ('kind="dead"', 'kind="stuck-on"', 'kind="degraded", fraction=0.4'),
}

COLUMNS = (
    "member",
    "mass_kg",
    "wheels",
    "thrusters",
    "orbit_rate_rad_s",
    "failures",
    "cases",
    "recoverable",
    "recovered",
    "reasons",
    "false_alarms",
)


def member(number: int, seed: int = SEED) -> tuple[dict[str, object], Scenario]:
    """What was drawn for a spacecraft, as columns of the table, and its scenario."""
    rng = np.random.default_rng([seed, number])
    mass = float(np.exp(rng.uniform(*np.log(MASS))))
    sides = (mass / DENSITY) ** (1 / 3) * rng.uniform(0.75, 1.25, 3)
    moments = mass / 12 * (np.sum(sides**2) - sides**2)
    largest = float(moments.max())
    count = {"wheel": int(rng.integers(2, 5)), "thruster": int(rng.choice([0, 4, 6, 8]))}
    if count["wheel"] == 2 and count["thruster"] < 6:
        count["thruster"] = 6  # two wheels alone leave no three axes from the start
    orbit_rate = float(rng.choice([0.0, rng.uniform(1.09e-3, 1.13e-3)]))
    torque, momentum = (largest * rng.uniform(*span) for span in (ACCELERATION, RATE))
    each = f"torque_limit_N_m={torque}, momentum_limit_N_m_s={momentum}, "
    each += f"coulomb_friction_N_m={0.02 * torque}, tachometer_noise_N_m_s={1e-4 * momentum}"
    wheels = [f"{{axis={axis.tolist()}, {each}}}" for axis in WHEELS[: count["wheel"]]]
    push = largest * rng.uniform(*PUSH)
    x, y, z = CORNERS.T
    arms = np.cross(CORNERS * [0.8, 0.8, 1.2], np.column_stack([-z * x, z * y, -2 * z]))
    arms = arms[rng.permutation(len(arms))[: count["thruster"]]]
    jets = [
        f"{{torque_axis={arm.tolist()}, torque_N_m={push}, min_on_time_s=0.02}}" for arm in arms
    ]
    failures, drawn = [], []
    for _ in range(int(rng.integers(1, 3))):
        part = str(rng.choice([kind for kind, many in count.items() if many]))
        which, kind = int(rng.integers(count[part])) + 1, str(rng.choice(KINDS[part]))
        at = rng.uniform(50, 500)
        failures.append(f'{{of="{part} {which}", at_s={at:.1f}, {kind}}}')
        drawn.append(f"{part} {which} {kind.split(chr(34))[1]} at {at:.0f} s")
    changes = [
        f"spacecraft.inertia_kg_m2={moments.tolist()}",
        f"wheel=[{', '.join(wheels)}]",
        f"failure=[{', '.join(failures)}]",
        f"orbit.rate_rad_s={orbit_rate}",
    ]
    if jets:
        changes.append(f"thruster=[{', '.join(jets)}]")
    else:
        changes.append('dispersion.attitude={distribution="random-attitude"}')
    row = {
        "member": number,
        "mass_kg": round(mass, 1),
        "wheels": count["wheel"],
        "thrusters": count["thruster"],
        "orbit_rate_rad_s": round(orbit_rate, 6),
        "failures": "; ".join(drawn),
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScenarioWarning)
        return row, load("hybrid-wheels" if jets else "wheels-fail", changes)


def flown(number: int, cases: int, seed: int = SEED) -> dict[str, object]:
    """The row of a spacecraft: how many cases can be recovered, how many were, and why not."""
    row, scenario = member(number, seed)
    values = build_study(scenario, cases, seed=number + 1).values(np.arange(cases))
    verdicts = Counter(Recovery(int(one)) for one in values["recovery"])
    lost = {one.name.lower(): many for one, many in verdicts.items() if one.value > 1}
    return row | {
        "cases": cases,
        "recoverable": cases - verdicts[Recovery.UNRECOVERABLE],
        "recovered": verdicts[Recovery.RECOVERED],
        "reasons": "; ".join(f"{many} {reason}" for reason, many in lost.items()),
        "false_alarms": int(values["false_alarms"].sum()),
    }


def main() -> None:
    """Fly those that the table lacks, and print what should be recovered and is not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--members", type=int, default=40)
    parser.add_argument("--cases", type=int, default=8)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--out", type=Path, default=Path("mixes.csv"))
    given = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    rows = []
    if given.out.exists():
        with given.out.open(encoding="utf-8") as file:
            rows = list(csv.DictReader(file))
    done = {int(row["member"]) for row in rows}
    for number in range(given.members):
        if number in done:
            continue
        rows.append(flown(number, given.cases, given.seed))
        with given.out.open("w", encoding="utf-8", newline="") as file:
            writer = csv.DictWriter(file, COLUMNS)
            writer.writeheader()
            writer.writerows(rows)
        print(*(f"{name}={rows[-1][name]}" for name in COLUMNS), flush=True)
    recoverable, recovered = (
        sum(int(row[name]) for row in rows) for name in ("recoverable", "recovered")
    )
    print(f"{recovered} of {recoverable} cases that can be recovered are.")


if __name__ == "__main__":
    main()
