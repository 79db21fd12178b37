"""`jaxsat design` on the family of random spacecraft: a table and a figure (docs/design.md).

    python benchmarks/design_family.py --out family-designed

designs a controller for every spacecraft of `random_family`, of which those in
low orbit fly with gravity gradient, verifies it on unseen cases and writes table.csv, one row for
every spacecraft, and family.png. Every spacecraft is kept as it is done: the same command resumes
an interrupted run, and draws what there is with `--members 0`.
"""

import argparse
import csv
import io
import json
import math
import multiprocessing
import sys
import time
import warnings
from concurrent.futures import ProcessPoolExecutor, as_completed
from pathlib import Path
from typing import Any

import jax
import numpy as np

import jaxsat
from family_figure import family_figure
from jaxsat.report.saving import save_figures
from jaxsat.scenario import ScenarioWarning
from jaxsat.store.resumable import ResumableFolder
from jaxsat.studies.executors import Serial
from jaxsat.studies.statistics import wilson
from jaxsat.synthesis.execution import Execution
from random_family import SEED, SIZE, family_member, family_scenario

KIND, TABLE = "designed-family", "table.csv"

SETTINGS = ("settled", "cases", "steps", "goal", "seed")
"""Arguments of `jaxsat.design`, by which a folder is resumed."""


def designed(number: int, family_seed: int, settings: dict[str, Any]) -> dict[str, Any]:
    """What one spacecraft is, without dimension, and what its design came to; times over τ."""
    jax.config.update("jax_enable_x64", True)
    warnings.simplefilter("ignore", ScenarioWarning)
    begin = time.process_time()
    member = family_member(number, family_seed)
    scenario = family_scenario(member, "three-slew")
    found = jaxsat.design(scenario, law="quick", execution=Execution(executor=Serial()), **settings)
    made = found.verification
    assert made is not None
    assert found.chosen is not None
    settled, limit = made.settled, made.limit
    torque = math.sqrt(math.prod(member.moments[:2])) / member.unit**2
    times = made.columns["settling_time"] / member.unit
    amplitude = float(np.linalg.norm(scenario.disturbance.amplitude_N_m))
    noise = 0.0 if scenario.sampling is None else scenario.sampling.rate_noise_rad_s
    return {
        "number": number,
        "law": found.chosen.name,
        "outcome": found.outcome,
        "gravity_gradient": scenario.disturbance.gravity_gradient,
        "cases": made.summary.cases,
        "settled": settled.value,
        "low": settled.low,
        "high": settled.high,
        "t50": float(np.percentile(times, 50, method="higher")),
        "t90": float(np.percentile(times, 90, method="higher")),
        "limit": "" if limit is None else limit.change,
        "limit_settled": 0 if limit is None else limit.settled,
        "failing": len(made.failing),
        "differ_in": " ".join(one.name for one in made.separations[:3]),
        **member.numbers(),
        "disturbance_over_torque": amplitude / torque,
        "rate_noise_tau": noise * member.unit,
        "processor_s": time.process_time() - begin,
    }


def main() -> None:
    """Design for the family, as far as the folder lacks it, and draw what it has."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--members", type=int, default=SIZE, help="spacecraft from the first on")
    parser.add_argument("--processes", type=int, default=2)
    parser.add_argument("--cases", type=int, default=2000, help="unseen cases of each")
    parser.add_argument("--settled", type=float, default=0.99)
    parser.add_argument("--steps", type=int, default=16, help="of the tuner, where it is needed")
    parser.add_argument("--goal", choices=("settled", "quickest"), default="settled")
    parser.add_argument("--family-seed", type=int, default=SEED)
    parser.add_argument("--seed", type=int, default=11, help="first of the four of every design")
    given = parser.parse_args()
    settings = {
        name: getattr(given, name) for name in ("settled", "cases", "steps", "goal", "seed")
    }
    identity = {"family_seed": given.family_seed, **settings}
    with ResumableFolder(given.out, KIND, {"identity": identity}) as folder:
        if folder.about["identity"] != identity:
            sys.exit(f"{given.out} holds designs with other settings: {folder.about['identity']}")
        lacking = [n for n in range(given.members) if folder.read(_file(n)) is None]
        spawned = multiprocessing.get_context("spawn")
        with ProcessPoolExecutor(given.processes, spawned) as pool:
            jobs = {pool.submit(designed, n, given.family_seed, settings): n for n in lacking}
            try:
                for job in as_completed(jobs):
                    row = job.result()
                    folder.write(_file(jobs[job]), json.dumps(row))
                    print(_line(row), file=sys.stderr)
            except KeyboardInterrupt:
                pool.shutdown(cancel_futures=True)
                raise
        kept = (folder.read(_file(number)) for number in range(SIZE))
        rows = [json.loads(content) for content in kept if content is not None]
        if rows:
            folder.write(TABLE, _table(rows))
            save_figures({"family": family_figure(rows, given.settled)}, folder.write)
            print(_summary(rows, given.settled))


def _file(number: int) -> str:
    return f"members/{number:03d}.json"


def _line(row: dict[str, Any]) -> str:
    limit = f"; limit: {row['limit']}" if row["limit"] else ""
    return (
        f"{row['number']} {row['law']}: {row['settled']:.2%} of {row['cases']}{limit} "
        f"({row['processor_s']:.0f} s)"
    )


def _table(rows: list[dict[str, Any]]) -> str:
    text = io.StringIO()
    writer = csv.DictWriter(text, rows[0], lineterminator="\n")
    writer.writeheader()
    writer.writerows(
        {k: f"{v:.6g}" if isinstance(v, float) else v for k, v in row.items()} for row in rows
    )
    return text.getvalue()


def _summary(rows: list[dict[str, Any]], wanted: float) -> str:
    reached = wilson(sum(row["settled"] >= wanted for row in rows), len(rows))
    excluded = sum(row["high"] < wanted for row in rows)
    seconds = sum(row["processor_s"] for row in rows) / len(rows)
    return (
        f"{len(rows)} spacecraft: at least {wanted:.1%} settle on {reached.value:.1%} of them "
        f"({reached.low:.1%} to {reached.high:.1%}); fewer for sure on {excluded}; "
        f"{seconds:.1f} s of processor time each"
    )


if __name__ == "__main__":
    main()
