"""Bounds on time and effort from the paper's start, kept in the folder of a comparison."""

import json
import math
from typing import Any

import numpy as np

from jaxsat.scenario.build.run import build
from jaxsat.store import ResumableFolder
from jaxsat.store.files import parse_json
from jaxsat.synthesis.bounds import BoundObjective, End, end_data, manoeuvre_of, tolerances_at
from jaxsat.synthesis.bounds.run import searched
from jaxsat.synthesis.comparison.acceptance import (
    ComparisonSetting,
    comparison_scenario,
    horizon,
)
from jaxsat.synthesis.execution import Listener

BOUNDS = "bounds"
"""Folder of what was found."""


def least_bounds(
    limit: float,
    starts: int,
    seed: int,
    end: End,
    folder: ResumableFolder | None,
    listener: Listener,
) -> dict[str, Any]:
    """Least time and effort under a torque limit (N m); once found, they are kept in the folder."""
    scenario = comparison_scenario(ComparisonSetting("nominal", limit, "rate"))
    run, tolerances = build(scenario), tolerances_at(scenario, end)
    manoeuvre = manoeuvre_of(run.loop, run.start, tolerances=tolerances)
    numbers = {name: np.asarray(value).tolist() for name, value in vars(manoeuvre).items()}
    wanted = {"torque_limit": limit, "starts": starts, "seed": seed, "manoeuvre": numbers}
    wanted |= end_data(end, tolerances)
    name = f"{BOUNDS}/{limit:g}-{end}.json"
    kept = None if folder is None else _kept(folder.read(name), wanted)
    if kept is not None:
        return kept
    found: dict[str, Any] = dict(wanted)
    for objective in BoundObjective:
        best = searched(
            (run.loop, run.start),
            manoeuvre,
            objective,
            tolerances,
            starts=starts,
            longest=horizon(limit) / 5,
            seed=seed,
            report=lambda what: listener.progress(f"{limit:g} N m: {what}", None),
        )
        found[objective.value] = None if best is None else best.solution.value
    if folder is not None:
        folder.write(name, json.dumps(found))
    return found


def _kept(content: bytes | None, wanted: dict[str, Any]) -> dict[str, Any] | None:
    """What was found before, if it is what is wanted now."""
    found = parse_json(content)
    objectives = [one.value for one in BoundObjective]
    if not isinstance(found, dict) or set(found) != {*wanted, *objectives}:
        return None
    values = [found[name] for name in objectives]
    good = all(x is None or (isinstance(x, float) and 0 < x < math.inf) for x in values)
    return found if good and wanted.items() <= found.items() else None
