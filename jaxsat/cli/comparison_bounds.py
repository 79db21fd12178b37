"""Bounds on time and effort for a comparison, kept in its folder."""

import json
import math
from typing import TYPE_CHECKING, Any

from jaxsat.cli.bound import end_data, planned, searched, tolerances_at
from jaxsat.cli.options import End

if TYPE_CHECKING:
    from jaxsat.store import ResumableFolder

BOUNDS = "bounds"
"""Folder of what was found."""


def least_bounds(
    limit: float, starts: int, seed: int, end: End, folder: "ResumableFolder"
) -> dict[str, Any]:
    """Least time and effort from the paper's start; kept in the output folder once found."""
    import numpy as np

    from jaxsat.scenario.build.run import build
    from jaxsat.synthesis.bounds import BoundObjective, manoeuvre_of
    from jaxsat.synthesis.comparison import ComparisonSetting, comparison_scenario, horizon

    name = f"{BOUNDS}/{limit:g}-{end}.json"
    scenario = comparison_scenario(ComparisonSetting("nominal", limit, "rate"))
    run, tolerances = build(scenario), tolerances_at(scenario, end)
    manoeuvre = manoeuvre_of(run.loop, run.start, tolerances=tolerances)
    numbers = {name: np.asarray(value).tolist() for name, value in vars(manoeuvre).items()}
    wanted = {"torque_limit": limit, "starts": starts, "seed": seed, "manoeuvre": numbers}
    wanted |= end_data(end, tolerances)
    kept = _kept_bounds(folder.read(name), wanted)
    if kept is not None:
        return kept
    found: dict[str, Any] = dict(wanted)
    for objective in BoundObjective:
        what = f"least {objective.value}, {limit:g} N m"
        longest = horizon(limit) / 5
        plans = planned(run.loop, run.start, objective, longest, tolerances, what)
        best = searched(manoeuvre, objective, starts, longest, seed, what, plans)
        found[objective.value] = None if best is None else best.solution.value
    folder.write(name, json.dumps(found))
    return found


def _kept_bounds(content: bytes | None, wanted: dict[str, Any]) -> dict[str, Any] | None:
    """What was found before, if it is what is wanted now."""
    from jaxsat.store.files import parse_json
    from jaxsat.synthesis.bounds import BoundObjective

    found = parse_json(content)
    objectives = [one.value for one in BoundObjective]
    if not isinstance(found, dict) or set(found) != {*wanted, *objectives}:
        return None
    values = [found[name] for name in objectives]
    good = all(x is None or (isinstance(x, float) and 0 < x < math.inf) for x in values)
    return found if good and wanted.items() <= found.items() else None
