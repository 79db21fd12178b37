"""What else could have been done with as many trajectories: the usual ways without gradients,
and BFGS with them.

All minimise the same objective over the same fixed cases from the scenario's own gains (random
search and CMA-ES: over the same bounds) and stop when the budget is spent; a gradient of n gains
counts n + 1 runs. Methods without gradients see the exact law.
"""

import contextlib
import importlib.util
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
import scipy.optimize
from jaxtyping import Float

from jaxsat.tuning.descent import DescentState
from jaxsat.tuning.plan import TuningPlan
from jaxsat.tuning.verdict import Judgement, judge

POPULATION = 16
"""Points of random search that are evaluated together."""

SPREAD = 0.25
"""First standard deviation of CMA-ES, in parts of the bounds' distance in the search."""

GRADIENT_DESCENT = "gradient descent"


class Found(NamedTuple):
    """One method: what it spent, the best points on the way, and the judgement of the last.

    `trace` has rows of trajectories spent and the loss on the validation cases of the best point
    so far in training; `loss` is the training loss of that point.
    """

    method: str
    trajectories: float
    loss: float
    point: Float[np.ndarray, " parameters"]
    trace: Float[np.ndarray, "points 2"]
    judgement: Judgement


class _Spent(Exception):
    """The budget is gone."""


@dataclass
class _Search:
    """Losses of points on the fixed cases, and the best so far, until the budget is spent."""

    plan: TuningPlan
    budget: float
    spent: float = 0.0
    best: list[tuple[float, float, np.ndarray]] = field(default_factory=list)

    @property
    def numbers(self) -> np.ndarray:
        return np.arange(self.plan.settings.cases)

    def losses(self, points: np.ndarray) -> np.ndarray:
        """Losses of the exact law at points of the search."""
        self._pay(len(points) * self.plan.settings.cases)
        costs = self.plan.exact.evaluate(points, self.numbers).cost
        losses = np.array([self.plan.settings.objective.value(row) for row in costs])
        self._note(points[int(np.argmin(losses))], float(losses.min()))
        return losses

    def gradient(self, point: np.ndarray) -> tuple[float, np.ndarray]:
        """Loss and gradient of the smooth law at one point."""
        self._pay(self.plan.settings.cases * (1 + self.plan.space.size))
        found = self.plan.smooth.differentiate(point[None], self.numbers)
        costs = np.asarray(found.outputs.cost)[0]
        judged = self.plan.settings.objective.judged(costs, found.derivatives[0])
        self._note(point, judged.loss)
        return judged.loss, judged.gradient

    def _pay(self, trajectories: int) -> None:
        if self.spent + trajectories > self.budget:
            raise _Spent
        self.spent += trajectories

    def _note(self, point: np.ndarray, loss: float) -> None:
        if not self.best or loss < self.best[-1][1]:
            self.best.append((self.spent, loss, point.copy()))


def nelder_mead(search: _Search, start: np.ndarray) -> None:
    """SciPy's simplex from the given gains, within the bounds, begun again when it has shrunk."""
    low, high = _box(search.plan)
    while True:
        first = search.best[-1][2] if search.best else start
        scipy.optimize.minimize(
            lambda point: float(search.losses(point[None])[0]),
            np.clip(first, low, high),
            method="Nelder-Mead",
            bounds=list(zip(low, high, strict=True)),
            options={"adaptive": True, "xatol": 1e-3, "fatol": 1e-6, "maxfev": 10**9},
        )


def random_search(search: _Search, start: np.ndarray) -> None:
    """Points drawn as the starts of gradient descent are."""
    search.losses(start[None])
    space, seed = search.plan.space, search.plan.settings.seed
    round_number = 0
    while True:
        round_number += 1
        drawn = space.drawn(POPULATION, seed + round_number)
        left = int((search.budget - search.spent) // search.plan.settings.cases)
        search.losses(space.to_search(drawn)[: max(left, 1)])


def cma_es(search: _Search, start: np.ndarray) -> None:
    """Covariance matrix adaptation, N. Hansen's `cma`, in the unit cube of the bounds."""
    import cma

    low, high = _box(search.plan)
    options = {
        "bounds": [0.0, 1.0],
        "seed": search.plan.settings.seed + 1,  # zero would mean the clock
        "verbose": -9,
        "maxiter": 10**9,
        "tolfun": 0,
        "tolfunhist": 0,
        "tolx": 0,
    }
    first = np.clip((start - low) / (high - low), 0.0, 1.0)
    while True:
        strategy = cma.CMAEvolutionStrategy(first, SPREAD, options)
        while not strategy.stop():
            asked = np.array(strategy.ask())
            losses = search.losses(low + (high - low) * asked)
            strategy.tell(list(asked), losses.tolist())
        options["seed"] += 1


def bfgs(search: _Search, start: np.ndarray) -> None:
    """optimistix' BFGS on the smooth law, from the given gains."""
    from jaxsat.tuning.quasi_newton import minimise

    low, high = _box(search.plan)
    minimise(search.gradient, start, low, high)


METHODS: dict[str, tuple[Callable[[_Search, np.ndarray], None], str | None]] = {
    "Nelder-Mead": (nelder_mead, None),
    "random search": (random_search, None),
    "CMA-ES": (cma_es, "cma"),
    "BFGS": (bfgs, None),
}
"""Every method, and the package that it needs beyond those of jaxsat."""


def missing_packages() -> list[str]:
    """Packages that are not there and whose methods would be left out."""
    needed = [package for _, package in METHODS.values() if package is not None]
    return [package for package in needed if importlib.util.find_spec(package) is None]


def run_baselines(
    plan: TuningPlan,
    state: DescentState,
    budget: float,
    report: Callable[[str], None] | None = None,
) -> list[Found]:
    """Gradient descent as it was and every method whose package is there, all judged alike."""
    start = plan.space.projected(plan.space.to_search(plan.start[None]))[0]
    found = [_descended(plan, state)]
    absent = missing_packages()
    for name, (method, package) in METHODS.items():
        if package in absent:
            continue
        if report is not None:
            report(name)
        search = _Search(plan, budget)
        with contextlib.suppress(_Spent):
            method(search, start)
        found.append(_judged(plan, name, search))
    return found


def as_data(found: list[Found]) -> list[dict[str, Any]]:
    """The table's rows as plain data."""
    from jaxsat.tuning.receipt import plain

    return [plain({**entry._asdict(), "judgement": entry.judgement.as_data()}) for entry in found]


def _judged(plan: TuningPlan, name: str, search: _Search) -> Found:
    points = np.stack([point for _, _, point in search.best])
    costs = plan.exact.evaluate(points, plan.settings.validation()).cost
    losses = [plan.settings.objective.value(row) for row in costs]
    spent = [entry[0] for entry in search.best]
    trace = np.array([[*spent, search.spent], [*losses, losses[-1]]]).T
    numbers = np.arange(plan.settings.held_out_cases)
    judgement = judge(plan, plan.held_out, points[-1:], numbers)[0]
    return Found(name, search.spent, search.best[-1][1], points[-1], trace, judgement)


def _descended(plan: TuningPlan, state: DescentState) -> Found:
    trace = np.array([[v.trajectories, v.best_loss] for v in state.validations])
    numbers = np.arange(plan.settings.held_out_cases)
    judgement = judge(plan, plan.held_out, state.best_point[None], numbers)[0]
    last = np.nanmin(state.steps[-1].loss)
    return Found(
        GRADIENT_DESCENT, state.trajectories, float(last), state.best_point, trace, judgement
    )


def _box(plan: TuningPlan) -> tuple[np.ndarray, np.ndarray]:
    """The least and largest point of the search."""
    size = plan.space.size
    ends = plan.space.projected(np.array([[-1e3] * size, [1e3] * size]))
    return ends[0], ends[1]
