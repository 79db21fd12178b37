"""Baselines for gradient descent at the same number of trajectories: gradient-free, and BFGS.

All minimise the same objective from the scenario's own gains (random search and CMA-ES: over the
same bounds), over the same fixed cases or, where the name says so, over new ones in every round. As
in the descent, the best of the points checked on the validation cases is kept. Checks count: one is
due as soon as the search has spent as much as it costs. A search ends when the target is reached or
the budget spent; a gradient of n gains counts n + 1 runs. Methods without gradients see the exact
law.
"""

import contextlib
import importlib.util
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np
import scipy.optimize
from jaxtyping import Float

from jaxsat.synthesis.tuning.descent import DescentState
from jaxsat.synthesis.tuning.plan import TuningPlan
from jaxsat.synthesis.tuning.strategies import PACKAGE, new_strategy
from jaxsat.synthesis.tuning.verdict import GainEvaluation, evaluate_gains

POPULATION = 16
"""Points of random search that are evaluated together."""

GRADIENT_DESCENT = "gradient descent"
WITHOUT_DERIVATIVES = "this run"


class BaselineResult(NamedTuple):
    """Result of one method: its cost, the best point, and its evaluation on held-out cases.

    `trace` has rows of trajectories spent and the loss on the validation cases of the best point so
    far; `loss` is the last of these, and `reached` whether it meets the target.
    """

    method: str
    trajectories: float
    loss: float
    reached: bool
    point: Float[np.ndarray, " parameters"]
    trace: Float[np.ndarray, "points 2"]
    evaluation: GainEvaluation


class _BudgetSpent(Exception):
    """The budget is spent, or the target reached."""


class _BestPoint(NamedTuple):
    """The best point on the validation cases after `spent` trajectories."""

    spent: float
    loss: float
    point: np.ndarray


@dataclass
class _Search:
    """Losses of points on training cases, and the best of those checked on the validation cases."""

    plan: TuningPlan
    budget: float
    fresh: bool = False
    spent: float = 0.0
    rounds: int = 0
    spent_since_check: float = 0.0
    best_in_training: tuple[float, np.ndarray] | None = None
    best: list[_BestPoint] = field(default_factory=list)

    @property
    def cases(self) -> int:
        """Number of cases of a round."""
        return self.plan.settings.baseline_cases or self.plan.settings.cases

    @property
    def left(self) -> float:
        """Budget of a round, without the check of its result."""
        return self.budget - self.spent - self.plan.settings.validation_cases

    def losses(self, points: np.ndarray) -> np.ndarray:
        """Return losses of the exact law at points of the search, on the cases of one round."""
        numbers = self._round(len(points))
        costs = self.plan.exact.evaluate(points, numbers).cost
        losses = np.array([self.plan.settings.objective.value(row) for row in costs])
        self._note(points[int(np.argmin(losses))], float(losses.min()))
        return losses

    def gradient(self, point: np.ndarray) -> tuple[float, np.ndarray]:
        """Return loss and gradient of the smooth law at one point."""
        gradients = self.plan.smooth.differentiate(
            point[None], self._round(1 + self.plan.space.size)
        )
        costs = np.asarray(gradients.outputs.cost)[0]
        result = self.plan.settings.objective.loss_gradient(costs, gradients.derivatives[0])
        self._note(point, result.loss)
        return result.loss, result.gradient

    def check_if_due(self, point: np.ndarray | None = None) -> None:
        """Check a point, or the best in training, if a check is due."""
        if self.spent_since_check >= self.plan.settings.validation_cases:
            self.check(point)

    def check(self, point: np.ndarray | None = None) -> None:
        """Validate a point, or the best in training since the last check."""
        if point is None:
            if self.best_in_training is None:
                return
            point = self.best_in_training[1]
        numbers, objective = self.plan.settings.validation(), self.plan.settings.objective
        costs = np.asarray(self.plan.exact.evaluate(point[None], numbers).cost)[0]
        loss = objective.value(costs)
        self.spent += len(numbers)
        self.spent_since_check = 0.0
        if not self.best or loss < self.best[-1].loss:
            self.best.append(_BestPoint(self.spent, loss, point.copy()))
        if self.plan.settings.reached(self.best[-1].loss):
            raise _BudgetSpent

    def _round(self, runs: int) -> np.ndarray:
        """Charge runs of all cases of a round to the budget, and return the case numbers."""
        if runs * self.cases > self.left:
            raise _BudgetSpent
        self.spent += runs * self.cases
        self.spent_since_check += runs * self.cases
        first = self.rounds * self.cases if self.fresh else 0
        self.rounds += 1
        return np.arange(first, first + self.cases)

    def _note(self, point: np.ndarray, loss: float) -> None:
        if self.fresh or self.best_in_training is None or loss < self.best_in_training[0]:
            self.best_in_training = (loss, point.copy())


def nelder_mead(search: _Search, start: np.ndarray) -> None:
    """Run SciPy's simplex from the given gains within the bounds, restarted when it has shrunk."""
    low, high = search.plan.space.ends

    def loss(point: np.ndarray) -> float:
        value = float(search.losses(point[None])[0])
        search.check_if_due()
        return value

    while True:
        first = start if search.best_in_training is None else search.best_in_training[1]
        scipy.optimize.minimize(
            loss,
            np.clip(first, low, high),
            method="Nelder-Mead",
            bounds=list(zip(low, high, strict=True)),
            options={"adaptive": True, "xatol": 1e-3, "fatol": 1e-6, "maxfev": 10**9},
        )


def random_search(search: _Search, start: np.ndarray) -> None:
    """Search points drawn like the starts of gradient descent."""
    search.losses(start[None])
    space, seed = search.plan.space, search.plan.settings.seed
    round_number = 0
    while True:
        round_number += 1
        points = space.drawn(POPULATION, seed + round_number)
        search.losses(space.to_search(points)[: max(int(search.left // search.cases), 1)])
        search.check_if_due()


def cma_es(search: _Search, start: np.ndarray) -> None:
    """Run covariance matrix adaptation, N. Hansen's `cma`, in the unit cube of the bounds."""
    low, high = search.plan.space.ends
    seed = search.plan.settings.seed
    while True:
        strategy = new_strategy((start - low) / (high - low), seed)
        while not strategy.stop():
            population = np.array(strategy.ask())
            losses = search.losses(low + (high - low) * population)
            strategy.tell(list(population), losses.tolist())
            search.check_if_due(low + (high - low) * strategy.result.xfavorite)  # the mean
        seed += 1


def bfgs(search: _Search, start: np.ndarray) -> None:
    """Run SciPy's L-BFGS-B within bounds on the smooth law, from the given gains."""

    def gradient(point: np.ndarray) -> tuple[float, np.ndarray]:
        loss_gradient = search.gradient(point)
        search.check_if_due()
        return loss_gradient

    low, high = search.plan.space.ends
    scipy.optimize.minimize(
        gradient, start, jac=True, method="L-BFGS-B", bounds=list(zip(low, high, strict=True))
    )


class SearchMethod(NamedTuple):
    """A search from a start, whether each round has new cases, the additional package that it
    needs, and whether it uses gradients."""

    search: Callable[[_Search, np.ndarray], None]
    fresh: bool = False
    package: str | None = None
    gradients: bool = False


METHODS: dict[str, SearchMethod] = {
    "Nelder-Mead": SearchMethod(nelder_mead),
    "random search": SearchMethod(random_search),
    "CMA-ES": SearchMethod(cma_es, package=PACKAGE),
    "CMA-ES, new cases": SearchMethod(cma_es, fresh=True, package=PACKAGE),
    "BFGS": SearchMethod(bfgs, gradients=True),
}
"""Methods by their name in tables."""


def missing_packages() -> list[str]:
    """Return packages that are not installed and whose methods are left out."""
    packages = {method.package for method in METHODS.values() if method.package is not None}
    return sorted(package for package in packages if importlib.util.find_spec(package) is None)


def run_baselines(
    plan: TuningPlan, state: DescentState, report: Callable[[str], None] | None = None
) -> list[BaselineResult]:
    """Evaluate gradient descent and every available method on the same held-out cases.

    Each may spend the budget of the settings, or as much as the descent did.
    """
    budget = float(plan.settings.baseline_trajectories or state.trajectories)
    start = plan.space.projected(plan.space.to_search(plan.start[None]))[0]
    results = [_descent_result(plan, state)]
    absent, free = missing_packages(), plan.settings.descent.derivative_free
    for name, method in METHODS.items():
        if method.package in absent or (method.gradients and free):
            continue
        if report is not None:
            report(name)
        search = _Search(plan, budget, method.fresh)
        with contextlib.suppress(_BudgetSpent):
            search.check(start)
            with contextlib.suppress(_BudgetSpent):
                method.search(search, start)
            if not plan.settings.reached(search.best[-1].loss):
                search.check()
        results.append(_search_result(plan, name, search))
    return results


def _search_result(plan: TuningPlan, name: str, search: _Search) -> BaselineResult:
    rows = [(entry.spent, entry.loss) for entry in search.best]
    last = search.best[-1]
    trace = np.array([*rows, (search.spent, last.loss)])
    return _baseline_result(plan, name, search.spent, last.loss, last.point, trace)


def _descent_result(plan: TuningPlan, state: DescentState) -> BaselineResult:
    trace = np.array([[v.trajectories, v.best_loss] for v in state.validations])
    best = (state.best_loss, state.best_point)
    free = plan.settings.descent.derivative_free
    name = WITHOUT_DERIVATIVES if free else GRADIENT_DESCENT
    return _baseline_result(plan, name, state.trajectories, *best, trace)


def _baseline_result(
    plan: TuningPlan, name: str, spent: float, loss: float, point: np.ndarray, trace: np.ndarray
) -> BaselineResult:
    numbers = np.arange(plan.settings.held_out_cases)
    evaluation = evaluate_gains(plan, plan.held_out, point[None], numbers)[0]
    return BaselineResult(name, spent, loss, plan.settings.reached(loss), point, trace, evaluation)
