"""Random spacecraft of small c, as `jaxsat design` flies them, with the reason where cases fail.

    python benchmarks/small_coupling.py --out small-coupling.csv

draws spacecraft of the family (docs/laws.md), as many in each of four bands of c, fills in
dispersions, sensors and duration as `jaxsat design` does, and flies the two settling laws with both
end games. The file has a row for each spacecraft: the fraction that settles with the best of the
four, in how long, and why the others do not. The same command adds the rows that an interrupted
file lacks.

With `--as-drawn` the spacecraft are taken as they come, with any c from `LEAST_COUPLING` on, and
the four are flown in turn until one settles what is wanted, as `jaxsat design --goal settled` does.

Two reasons lie in the drawn body: its c is below `LEAST_COUPLING`, or no attitude within the
tolerances has a drift about n that an oscillation within the tolerance of the rate stops, so that
no law can hold it for ever. `reached` is the fraction of the other cases. `drifts` counts those
that the waves of the laws do not stop, `beyond_any_rate` those of them that no periodic rates stop.
"""

import argparse
import csv
import math
import sys
import time
import warnings
from pathlib import Path
from typing import NamedTuple

import diffrax
import jax
import numpy as np
from scipy.stats import binomtest

from jaxsat.core.allocation import torque_directions
from jaxsat.core.ranges import SETTLED_TURN, SETTLED_W
from jaxsat.scenario import Scenario, ScenarioWarning
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import study_program
from jaxsat.scenario.derived import believed_axes
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.studies.designs import Independent
from jaxsat.studies.ensemble import Study
from jaxsat.synthesis.controller_design.candidates import Candidate, with_larger_end_game
from jaxsat.synthesis.controller_design.completion import completed
from jaxsat.synthesis.controller_design.lost_holds import (
    LEAST_COUPLING,
    drawn_bodies,
    drawn_drifts,
)
from jaxsat.synthesis.controller_design.vehicle import coupling, scale_of, vehicle_verdict
from random_family import FamilyMember, family_member, family_scenario

LAWS = ("three-slew", "oscillatory")
NAMES = (*LAWS, *(f"{law}, larger end game" for law in LAWS))

WANTED = 0.99
BANDS = ((0.02, 0.05), (0.05, 0.1), (0.1, 0.2), (0.2, 0.45))
"""Of c, in turn for one spacecraft after the other."""

AS_DRAWN = (LEAST_COUPLING, math.inf)


def vehicle(member: FamilyMember, law: str) -> Scenario:
    """The spacecraft with all that `jaxsat design` assumes where a file is silent."""
    data = family_scenario(member, law).model_dump(exclude_none=True)
    del data["dispersion"], data["sampling"]
    data["disturbance"] = {"gravity_gradient": member.orbit_rate > 0}
    data["initial"]["omega_rad_s"] = [0.0, 0.0, 0.0]
    bare = Scenario.model_validate(data)
    return completed(bare, vehicle_verdict(bare), scale_of(bare), timed=False).scenario


def candidates(member: FamilyMember) -> list[Candidate]:
    """Both laws, each with both end games where the larger one is larger."""
    own = [Candidate(law, vehicle(member, law)) for law in LAWS]
    return [*own, *filter(None, map(with_larger_end_game, own))]


class Limits(NamedTuple):
    """Which drawn bodies have too small a c, and which others a drift that no oscillation of the
    laws, or no periodic rates at all, stop."""

    small: np.ndarray
    drifts: np.ndarray
    beyond_any_rate: np.ndarray


def beyond_any_law(scenario: Scenario, study: Study) -> Limits:
    """The limits of the bodies of a study."""
    bodies = drawn_bodies(study, torque_directions(believed_axes(scenario)))
    small = np.array([coupling(*body) < LEAST_COUPLING for body in bodies])
    found = drawn_drifts(scenario, bodies)
    waves, any_rates = (
        np.array([abs(one.drift) > getattr(one, limit) for one in found]) & ~small
        for limit in ("balanced", "most_balanced")
    )
    return Limits(small, waves, any_rates)


def row(
    member: FamilyMember, cases: int, seed: int, engine: NativeEngine, enough: float = math.inf
) -> dict:
    """What one spacecraft is, and how its cases ended; times in parts of τ.

    Candidates are flown in turn until one settles the fraction `enough` of all cases.
    """
    begin, flown, settled = time.process_time(), {}, {}
    for one in candidates(member):
        _, program = study_program(one.scenario, build(one.scenario), seed)
        study = Study(program, Independent(seed), engine, cases)
        values = study.values(np.arange(cases))
        flown[one.name] = one.scenario, study, values
        settled[one.name] = np.isfinite(values["settling_time"])
        if settled[one.name].mean() >= enough:
            break
    best = max(settled, key=lambda name: settled[name].sum())
    scenario, study, found = flown[best]
    small, drifts, beyond_any_rate = beyond_any_law(scenario, study)
    counted = ~(small | drifts)
    failed = counted & ~settled[best]
    turned = (np.linalg.norm(found["w"], axis=1) > SETTLED_W) | (abs(found["z"]) > SETTLED_TURN)
    times = found["settling_time"][counted] / member.unit
    return {
        "number": member.number,
        **member.numbers(),
        "duration_tau": scenario.simulation.duration_s / member.unit,
        "law": best,
        **{name: float(settled[name].mean()) if name in settled else "" for name in NAMES},
        "settled": float(settled[best].mean()),
        "reached": float(settled[best][counted].mean()),
        "t50": float(np.percentile(times, 50, method="higher")),
        "t99": float(np.percentile(times, 99, method="higher")),
        "c_below": int(small.sum()),
        "c_below_settled": int((small & settled[best]).sum()),
        "drifts": int(drifts.sum()),
        "drifts_settled": int((drifts & settled[best]).sum()),
        "beyond_any_rate": int(beyond_any_rate.sum()),
        "ends_turned": int((failed & turned).sum()),
        "ends_otherwise": int((failed & ~turned).sum()),
        "processor_s": time.process_time() - begin,
    }


def summary(rows: list[dict]) -> str:
    """How many spacecraft reach what is wanted, by c and orbit."""
    lines = []
    for orbit, low in (("inertial", False), ("low orbit", True)):
        for band in (*BANDS, (BANDS[-1][1], math.inf)):
            some = [
                one
                for one in rows
                if (float(one["orbit_rate_tau"]) > 0) == low
                and band[0] <= float(one["c"]) < band[1]
            ]
            if some:
                reached = [float(one["reached"]) for one in some]
                lines.append(
                    f"{orbit}, c {band[0]} to {band[1]}: {sum(x >= WANTED for x in reached)} of "
                    f"{len(some)}, mean {np.mean(reached):.2%}, least {min(reached):.2%}, of all "
                    f"cases {np.mean([float(one['settled']) for one in some]):.2%}"
                )
    for counted, what in (("settled", "all cases"), ("reached", "the cases that can be balanced")):
        good = sum(float(one[counted]) >= WANTED for one in rows)
        low, high = binomtest(good, len(rows)).proportion_ci()  # Clopper and Pearson's
        lines.append(
            f"{good} of {len(rows)} spacecraft ({low:.1%} to {high:.1%}) reach {WANTED:.0%} of "
            f"{what}"
        )
    return "\n".join(lines)


def main() -> None:
    """Fly the spacecraft that the file lacks, and tell what it has."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--cases", type=int, default=256)
    parser.add_argument("--members", type=int, default=48)
    parser.add_argument("--family-seed", type=int, default=1)
    parser.add_argument("--seed", type=int, default=7)
    parser.add_argument("--as-drawn", action="store_true", help="any c, in turn until enough")
    given = parser.parse_args()
    warnings.simplefilter("ignore", ScenarioWarning)
    jax.config.update("jax_enable_x64", True)
    engine = NativeEngine(stepper=FixedStepper(diffrax.Bosh3(), 1), batch_size=given.cases)
    rows = list(csv.DictReader(given.out.open())) if given.out.exists() else []
    done = {int(one["number"]) for one in rows}
    enough = WANTED if given.as_drawn else math.inf
    for number in sorted({*range(given.members)} - done):
        allowed = AS_DRAWN if given.as_drawn else BANDS[number % len(BANDS)]
        member = family_member(number, given.family_seed, allowed)
        found = row(member, given.cases, given.seed, engine, enough)
        with given.out.open("a", newline="") as file:
            writer = csv.DictWriter(file, found)
            if not rows:
                writer.writeheader()
            writer.writerow(found)
        rows.append(found)
        print({key: f"{x:.4g}" if isinstance(x, float) else x for key, x in found.items()},
              file=sys.stderr)  # fmt: skip
    print(summary(rows))


if __name__ == "__main__":
    main()
