"""Tuning of a candidate over its dispersions, with the tuner of `jaxsat tune`."""

import math
from typing import NamedTuple

import numpy as np

from jaxsat.core.declaration.keys import Numeric
from jaxsat.core.process import processors
from jaxsat.scenario import Scenario
from jaxsat.scenario.optimisers import DERIVATIVE_FREE
from jaxsat.scenario.tuning import BoundsTable, CostTable, TuningTable
from jaxsat.synthesis.comparison.verdict import ComparisonRow
from jaxsat.synthesis.controller_design.candidates import Candidate, written_out
from jaxsat.synthesis.controller_design.studies import Studies
from jaxsat.synthesis.controller_design.vehicle import Scale
from jaxsat.synthesis.tuning.build import build_plan, tuned_scenario
from jaxsat.synthesis.tuning.checkpoint import tuning_folder
from jaxsat.synthesis.tuning.descent import DescentState
from jaxsat.synthesis.tuning.plan import TuningPlan
from jaxsat.synthesis.tuning.run import run_descent

FOLDER = "tuning"
"""Subfolder of the tuner in the output folder."""

TUNED = ", tuned"
"""Suffix of the name of a candidate with tuned gains."""

RANGE = 3.0
"""Bounds of a gain are its value times and over this factor."""

TUNED_CASES = 96
"""Cases of a step."""

VALIDATION_CASES, VALIDATE_EVERY = 256, 4
"""Cases for choosing the best iterate, and steps between two choices."""

SEARCHED_STARTS = 6
"""Points of a step of the search without derivatives."""

TAIL = 2.5
"""Duration of a case in tuning, over the time within which nine tenths settle."""


class Tuned(NamedTuple):
    """Result of a descent."""

    candidate: Candidate
    plan: TuningPlan
    state: DescentState

    @property
    def loss_before(self) -> float:
        """Loss of the initial gains on the tuner's own validation cases."""
        return float(np.min(self.state.validations[0].loss))

    @property
    def improved(self) -> bool:
        """Whether any gains were better on the tuner's own validation cases."""
        return self.state.best_loss < self.loss_before


def tuning_table(scenario: Scenario, scale: Scale, steps: int, validation: int) -> TuningTable:
    """Return a table with every positive scalar gain, and a cost dominated by settling.

    For a law without derivatives the gains are those that it declares for a search without them.

    Weights of rates and torques are those of `oscillatory-dispersed`, scaled. A scenario's own
    `[tuning]` table keeps its gains, bounds and cost.
    """
    budget = {
        "steps": steps,
        "cases": min(TUNED_CASES, validation),
        "starts": 1,
        "screened": 0,
        "halve_at": (),
        "validation_cases": min(VALIDATION_CASES, validation),
        "validate_every": VALIDATE_EVERY,
    }
    if scenario.tuning is not None:
        return scenario.tuning.model_copy(update=budget)
    control = written_out(scenario).control
    bounds, declaration = {}, scenario.law.declaration
    if declaration.searched:
        budget |= {"optimiser": DERIVATIVE_FREE, "starts": SEARCHED_STARTS}
    for key in declaration.keys:
        value = getattr(control, key.name)
        if declaration.searched and key.name not in declaration.searched:
            continue
        if key.tunable and isinstance(value, float) and value > 0:
            most = key.kind.at_most if isinstance(key.kind, Numeric) else value
            bounds[key.name] = BoundsTable(  # pyright: ignore[reportCallIssue]
                low=value / RANGE, high=min(value * RANGE, most)
            )
    cost = CostTable(  # pyright: ignore[reportCallIssue]
        w=0.1,
        z=0.1,
        relative_rate=float(f"{0.145 * scale.time**2:.3g}"),
        torque=float(f"{0.0025 / scale.torque**2:.3g}"),
        settling=1.0,
    )
    return TuningTable(parameters=bounds, cost=cost, **budget)  # pyright: ignore[reportCallIssue]


def tune_candidate(
    candidate: Candidate,
    row: ComparisonRow,
    table: TuningTable,
    seed: int,
    studies: Studies,
    what: str,
) -> Tuned:
    """Descend from a candidate's gains; resumes the descent in the folder of the studies.

    `what` is its name in progress reports, `row` the candidate's in the screening. Raises
    `ValueError` where it cannot be tuned.
    """
    explicit = written_out(candidate.scenario)
    shorter = _shorten(explicit, row, table, seed)
    progress, path = studies.listener.progress, studies.folder.path / FOLDER
    progress(f"{what}: compiling the gradient", None)
    plan = build_plan(shorter, workers=processors(), batch_size=32)
    with tuning_folder(path, plan, elsewhere=studies.execution.elsewhere) as folder:
        progress(f"{what}: step 1 of {table.steps}", None)
        state = run_descent(shorter, plan, folder, report=lambda at: progress(what, at))
    control = tuned_scenario(shorter, plan, np.asarray(state.best_point)).control
    best_scenario = explicit.model_copy(update={"control": control})
    return Tuned(Candidate(f"{candidate.name}{TUNED}", best_scenario), plan, state)


def _shorten(scenario: Scenario, row: ComparisonRow, table: TuningTable, seed: int) -> Scenario:
    """Shorten the scenario to a horizon in which most cases settle."""
    simulation = scenario.simulation
    save, whole = simulation.save_every_s, simulation.duration_s
    enough = TAIL * row.t90.value
    duration = whole
    if enough < whole:
        duration = min(whole, math.ceil(enough / save) * save)
    simulation = simulation.model_copy(update={"duration_s": duration, "seed": seed})
    return scenario.model_copy(update={"simulation": simulation, "tuning": table})
