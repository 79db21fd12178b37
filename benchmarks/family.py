"""The laws that settle, flown on the family of random spacecraft (docs/laws.md).

    python benchmarks/family.py --cases 64 --out family.csv

writes one row for every spacecraft and law: what it is, without dimension, and the fraction that
settled. `--toml DIR` writes the scenarios instead, for any command.
"""

import argparse
import csv
import sys
import warnings
from pathlib import Path

import diffrax
import jax
import numpy as np

from jaxsat.scenario import ScenarioWarning
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import study_program
from jaxsat.scenario.dump import dump
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.studies.designs import Independent
from jaxsat.studies.ensemble import Study
from random_family import (
    SEED,
    SIZE,
    FamilyMember,
    family_member,
    family_scenario,
)

LAWS = ("three-slew", "oscillatory")
MORE_LAWS = ("planned",)
"""Flown only if they are named, as they take long to compute."""


def row(member: FamilyMember, law: str, cases: int, seed: int, engine: NativeEngine) -> dict:
    """What one spacecraft is, and how its cases ended; times in parts of τ."""
    scenario = family_scenario(member, law)
    _, program = study_program(scenario, build(scenario), seed)
    values = Study(program, Independent(seed), engine, cases).values(np.arange(cases))
    times = values["settling_time"] / member.unit
    return {
        "number": member.number,
        "law": law,
        "cases": cases,
        "settled": float(np.isfinite(times).mean()),
        **member.numbers(),
        "turn_to_hold_rad": member.turn,
        "t50": float(np.percentile(times, 50, method="higher")),
        "t90": float(np.percentile(times, 90, method="higher")),
        "peak_rate_tau": float(values["peak_rate"].max() * member.unit),
    }


def main() -> None:
    """Fly the family, or write it."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--cases", type=int, default=64)
    parser.add_argument("--members", type=int, default=SIZE)
    parser.add_argument("--law", action="append", choices=(*LAWS, *MORE_LAWS))
    parser.add_argument("--family-seed", type=int, default=SEED)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--out", type=Path, default=Path("family.csv"))
    parser.add_argument("--toml", type=Path)
    given = parser.parse_args()
    warnings.simplefilter("ignore", ScenarioWarning)
    jax.config.update("jax_enable_x64", True)
    # One engine for all, so that what differs in its numbers alone is compiled once.
    engine = NativeEngine(stepper=FixedStepper(diffrax.Bosh3(), 1), batch_size=given.cases)
    laws = given.law or LAWS
    members = (family_member(number, given.family_seed) for number in range(given.members))
    if given.toml is not None:
        given.toml.mkdir(parents=True, exist_ok=True)
        for member in members:
            for law in laws:
                path = given.toml / f"{member.number:03d}-{law}.toml"
                path.write_text(dump(family_scenario(member, law)))
        return
    with given.out.open("x", newline="") as file:
        writer = None
        for member in members:
            for law in laws:
                found = row(member, law, given.cases, given.seed, engine)
                writer = writer or csv.DictWriter(file, found)
                if not file.tell():
                    writer.writeheader()
                writer.writerow(found)
                file.flush()
                print(f"{member.number} {law}: {found['settled']:.1%}", file=sys.stderr)


if __name__ == "__main__":
    main()
