"""Random spacecraft with wheels, thrusters and magnetorquers, of which one or two fail in flight.

    python benchmarks/family_of_mixes.py --members 40 --cases 4 --out mixes.csv

Each flies `fault-tolerant` with the sensors of the scenario `hybrid-wheels`, in a low orbit of any
inclination under gravity gradient and with a residual dipole, or far from the Earth. The table
holds what is recovered against what the torques that are left can recover. A table that exists is
continued. Member i of a seed is drawn from both alone.
"""

import argparse
import csv
import math
import re
import warnings
from collections import Counter
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import jax
import numpy as np
from jaxtyping import Bool, Float
from matplotlib import rc_context
from matplotlib.figure import Figure

from jaxsat.report.style import SETTINGS
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

DIPOLE = (0.02, 0.05)
"""A m²/kg: the dipole of a magnetorquer over the mass, as 0.2 A m² of a 6U CubeSat."""

RESIDUAL = 0.04
"""Of the dipole of a magnetorquer of that size: the residual dipole of the body about an axis."""

ALTITUDE = (400.0, 800.0)
"""km, of low orbits."""

DISPERSIONS = {
    "attitude": 'distribution="random-attitude"',
    "inertia": 'distribution="uniform", low=-0.1, high=0.1',
    "products_of_inertia": 'distribution="uniform", low=-0.02, high=0.02',
    "omega_rad_s": 'distribution="uniform", low=-2e-3, high=2e-3',
}
"""Of all; those of thrusters and magnetorquers are beside them."""

WHEELS = np.array([[1, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1]]) / math.sqrt(2)
CORNERS = np.array([[x, y, z] for z in (1, -1) for x in (1, -1) for y in (1, -1)])
"""Signs of the corners of a box at which thrusters are, as those of `hybrid-wheels`."""

KINDS = {
    "wheel": ('kind="dead"', 'kind="stopped"', 'kind="degraded", fraction=0.3'),
    "thruster": ('kind="dead"', 'kind="stuck-on"', 'kind="degraded", fraction=0.4'),
    "magnetorquer": ('kind="dead"', 'kind="stuck-on"', 'kind="degraded", fraction=0.4'),
}

LOST = re.compile("dead|stopped")
"""Kinds of failure after which a wheel makes no torque."""

COLUMNS: tuple[str, ...] = (
    "member",
    "mass_kg",
    "wheels",
    "thrusters",
    "magnetorquers",
    "altitude_km",
    "inclination_deg",
    "failures",
    "cases",
    "recoverable",
    "recovered",
    "reasons",
    "spun_up",
    "recoverable_spun_up",
    "false_alarms",
)

DURATION, SLOW_DURATION = 8400, 28800
"""s; of a flight with magnetorquers, and of one where dead and stopped wheels leave one or none and
the spacecraft has fewer than six thrusters, failed ones counted: then the field must turn, and five
orbits are what `rods-only` flies."""

INSTANTS = 101
"""Over a flight, at which its rate is judged."""


def member(number: int, seed: int = SEED) -> tuple[dict[str, object], Scenario]:
    """What was drawn for a spacecraft, as columns of the table, and its scenario."""
    rng = np.random.default_rng([seed, number])
    mass = float(np.exp(rng.uniform(*np.log(MASS))))
    sides = (mass / DENSITY) ** (1 / 3) * rng.uniform(0.75, 1.25, 3)
    moments = mass / 12 * (np.sum(sides**2) - sides**2)
    low = bool(rng.integers(4))
    count = {
        "wheel": int(rng.integers(2, 5)),
        "thruster": int(rng.choice([0, 4, 6, 8])),
        "magnetorquer": int(rng.integers(4)) if low else 0,
    }
    if count["wheel"] == 2 and count["thruster"] < 6:
        count["thruster"] = 6  # two wheels alone leave no three axes from the start
    failures, drawn = _failures(rng, count)
    altitude, inclination = rng.uniform(*ALTITUDE), np.degrees(np.arccos(rng.uniform(-0.2, 1)))
    dispersions = dict(DISPERSIONS)
    changes = [
        f"spacecraft.inertia_kg_m2={moments.tolist()}",
        *_effectors(rng, count, float(moments.max()), mass, dispersions),
        f"failure=[{', '.join(failures)}]",
        *(_low_orbit(rng, altitude, inclination, mass) if low else ["orbit={rate_rad_s=0.0}"]),
        f"dispersion={{{', '.join(f'{key}={{{one}}}' for key, one in dispersions.items())}}}",
    ]
    if count["magnetorquer"]:
        lost = {one.split()[1] for one in drawn if one.startswith("wheel") and LOST.search(one)}
        slow = count["wheel"] - len(lost) < 2 and count["thruster"] < 6
        duration = SLOW_DURATION if slow else DURATION
        changes += [f"simulation.duration_s={duration}", "simulation.save_every_s=10"]
        changes += ["settled={tilt_rad=0.05, turn_rad=0.05}", "control.period_s=0.25"]
        changes.append("star_tracker.latency_s=0.25")
    row = {
        "member": number,
        "mass_kg": round(mass, 1),
        "wheels": count["wheel"],
        "thrusters": count["thruster"],
        "magnetorquers": count["magnetorquer"],
        "altitude_km": round(altitude) if low else "",
        "inclination_deg": round(float(inclination)) if low else "",
        "failures": "; ".join(drawn),
    }
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScenarioWarning)
        return row, load("hybrid-wheels" if count["thruster"] else "wheels-fail", changes)


def _failures(rng: np.random.Generator, count: dict[str, int]) -> tuple[list[str], list[str]]:
    """One or two failures as tables, and in words."""
    failures, drawn = [], []
    for _ in range(int(rng.integers(1, 3))):
        part = str(rng.choice([kind for kind, many in count.items() if many]))
        which, kind = int(rng.integers(count[part])) + 1, str(rng.choice(KINDS[part]))
        at = rng.uniform(50, 500)
        failures.append(f'{{of="{part} {which}", at_s={at:.4f}, {kind}}}')
        drawn.append(f"{part} {which} {kind.split(chr(34))[1]} at {at:.0f} s")
    return failures, drawn


def _effectors(
    rng: np.random.Generator,
    count: dict[str, int],
    largest: float,
    mass: float,
    dispersions: dict[str, str],
) -> list[str]:
    """The tables of actuators for a body of a `largest` moment (kg m²) and a mass (kg)."""
    torque, momentum = (largest * rng.uniform(*span) for span in (ACCELERATION, RATE))
    each = f"torque_limit_N_m={torque}, momentum_limit_N_m_s={momentum}, "
    each += f"coulomb_friction_N_m={0.02 * torque}, tachometer_noise_N_m_s={1e-4 * momentum}"
    wheels = [f"{{axis={axis.tolist()}, {each}}}" for axis in WHEELS[: count["wheel"]]]
    changes = [f"wheel=[{', '.join(wheels)}]"]
    push = largest * rng.uniform(*PUSH)
    x, y, z = CORNERS.T
    arms = np.cross(CORNERS * [0.8, 0.8, 1.2], np.column_stack([-z * x, z * y, -2 * z]))
    arms = arms[rng.permutation(len(arms))[: count["thruster"]]]
    jets = [
        f"{{torque_axis={arm.tolist()}, torque_N_m={push}, min_on_time_s=0.02}}" for arm in arms
    ]
    if jets:
        changes.append(f"thruster=[{', '.join(jets)}]")
        dispersions["torque_gain"] = 'distribution="uniform", low=-0.1, high=0.1'
    dipole = mass * rng.uniform(*DIPOLE)
    axes = np.eye(3)[rng.permutation(3)[: count["magnetorquer"]]]
    rods = [f"{{axis={axis.tolist()}, dipole_limit_A_m2={dipole}}}" for axis in axes]
    if rods:
        changes += [f"magnetorquer=[{', '.join(rods)}]", "unloading={time_constant_s=300}"]
        turned = 'distribution="normal", mean=0.0, sigma=0.02'
        dispersions["magnetorquer_misalignment_rad"] = turned
    return changes


def _low_orbit(
    rng: np.random.Generator, altitude: float, inclination: float, mass: float
) -> list[str]:
    """The tables of an orbit at an altitude (km) and inclination (deg), and what acts there."""
    node, turn, place = rng.uniform(0, 360, 3)
    residual = RESIDUAL * DIPOLE[0] * mass * rng.choice([-1.0, 1.0], 3)
    return [
        f"orbit={{altitude_km={altitude}, inclination_deg={inclination}, "
        f"ascending_node_deg={node}, sidereal_angle_deg={turn}, argument_of_latitude_deg={place}}}",
        f"disturbance={{gravity_gradient=true, residual_dipole_A_m2={residual.tolist()}}}",
    ]


def spins_up(rates: Float[np.ndarray, "cases instants 3"]) -> Bool[np.ndarray, " cases"]:
    """Whether a body turns faster at the end than at the start, and does not become slower.

    The mean rate (rad/s, relative to the target) of the last tenth of a flight is above that at the
    start, and no more than a hundredth below that of the tenth before.
    """
    sizes = np.linalg.norm(rates, axis=2)
    tenth = sizes.shape[1] // 10
    before, last = (one.mean(axis=1) for one in (sizes[:, -2 * tenth : -tenth], sizes[:, -tenth:]))
    return (last > sizes[:, 0]) & (last > 0.99 * before)


def flown(number: int, cases: int, seed: int = SEED) -> dict[str, object]:
    """The row of a spacecraft: how many cases can be recovered, how many were, and why not."""
    row, scenario = member(number, seed)
    study = build_study(scenario, cases, seed=number + 1, history=INSTANTS)
    values = study.values(np.arange(cases))
    spun_up = spins_up(values["history_relative_rate"])
    recoverable = values["recovery"] != Recovery.UNRECOVERABLE
    verdicts = Counter(Recovery(int(one)) for one in values["recovery"])
    lost = {one.name.lower(): many for one, many in verdicts.items() if one.value > 1}
    return row | {
        "cases": cases,
        "recoverable": int(recoverable.sum()),
        "recovered": verdicts[Recovery.RECOVERED],
        "reasons": "; ".join(f"{many} {reason}" for reason, many in lost.items()),
        "spun_up": int(spun_up.sum()),
        "recoverable_spun_up": int((spun_up & recoverable).sum()),
        "false_alarms": int(values["false_alarms"].sum()),
    }


def mix_figure(rows: Sequence[Mapping[str, Any]]) -> Figure:
    """Cases by what is beside wheels: recovered, not recovered, spun up, or not recoverable."""
    bars: dict[str, np.ndarray] = {}
    for row in rows:
        beside = [one for one in ("thrusters", "magnetorquers") if int(row[one])]
        names = ("cases", "recoverable", "recovered", "recoverable_spun_up")
        every, recoverable, recovered, spun_up = (int(row[name]) for name in names)
        lost = recoverable - recovered - spun_up
        name = "wheels" + "".join(f",\n{one}" for one in beside)
        cases = np.array([recovered, lost, spun_up, every - recoverable])
        bars[name] = bars.get(name, 0 * cases) + cases
    styles = (
        ("recovered", "#bbbbbb", ""),
        ("not recovered", "#ffffff", "////"),
        ("not recovered, spins up", "#000000", ""),
        ("not recoverable", "#ffffff", "..."),
    )
    with rc_context(dict[Any, Any](SETTINGS)):
        figure = Figure(figsize=(7.0, 2.6), layout="constrained")
        axis = figure.subplots()
    parts = np.array(list(bars.values()))
    for number, (label, color, hatch) in enumerate(styles):
        left = parts[:, :number].sum(axis=1)
        style = {"color": color, "edgecolor": "black", "hatch": hatch, "linewidth": 0.6}
        axis.barh(list(bars), parts[:, number], left=left, label=label, **style)
    axis.set_xlabel("cases")
    where = {"loc": "lower center", "bbox_to_anchor": (0.4, 1.0)}
    axis.legend(**where, ncols=4, fontsize=7, frameon=False)
    return figure


def main() -> None:
    """Fly those that the table lacks, and print what should be recovered and is not."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--members", type=int, default=40)
    parser.add_argument("--cases", type=int, default=8)
    parser.add_argument("--seed", type=int, default=SEED)
    parser.add_argument("--out", type=Path, default=Path("mixes.csv"))
    parser.add_argument("--figure", type=Path)
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
    if given.figure is not None:
        mix_figure(rows).savefig(given.figure, dpi=150)
    recoverable, recovered = (
        sum(int(row[name]) for row in rows) for name in ("recoverable", "recovered")
    )
    print(f"{recovered} of {recoverable} cases that can be recovered are.")


if __name__ == "__main__":
    main()
