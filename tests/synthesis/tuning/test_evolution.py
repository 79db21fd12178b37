"""Tuning without derivatives: search against a known minimum, resumption, and what counts."""

import numpy as np
import pytest

from jaxsat.scenario.optimisers import OptimiserSettings
from jaxsat.simulation.engine.progress import Outputs
from jaxsat.synthesis.tuning.cost_evaluator import recovery_costs
from jaxsat.synthesis.tuning.parameters import SearchSpace, TunedParameter
from jaxsat.synthesis.tuning.strategies import next_population

pytest.importorskip("cma")
SPACE = SearchSpace((TunedParameter("a", 0.1, 10.0), TunedParameter("b", 1.0, 100.0)))
START, BEST = np.log([5.0, 3.0]), np.log([0.5, 20.0])


def losses(points):
    return np.sum((points - BEST) ** 2, axis=1)


def history(steps):
    found = []
    for _ in range(steps):
        points = next_population(SPACE, START, 3, 8, found)
        found.append((points, losses(points)))
    return found


def test_it_finds_a_minimum_within_the_bounds_from_the_start_itself():
    found = history(30)
    np.testing.assert_array_equal(found[0][0][0], START)
    low, high = SPACE.ends
    assert all(np.all((points >= low) & (points <= high)) for points, _ in found)
    assert losses(found[-1][0]).min() < 1e-3


def test_a_history_gives_the_same_population_again():
    found = history(4)
    np.testing.assert_array_equal(next_population(SPACE, START, 3, 8, found[:3]), found[3][0])


def test_a_loss_that_is_not_finite_is_worse_than_all_others():
    points = next_population(SPACE, START, 3, 8, [])
    lost = np.where(np.arange(8) == 2, np.inf, losses(points))
    told = np.where(np.arange(8) == 2, losses(points)[lost < np.inf].max() + 1, losses(points))
    np.testing.assert_array_equal(
        next_population(SPACE, START, 3, 8, [(points, lost)]),
        next_population(SPACE, START, 3, 8, [(points, told)]),
    )


def test_a_case_counts_from_its_first_failure_until_it_is_settled():
    nothing = Outputs(*[np.zeros((1, 4))] * 12)
    outputs = nothing._replace(
        settling_time=np.array([[50.0, 10.0, np.inf, 90.0]]),
        drawn={
            "failure_time": np.array([[[30.0, 40.0], [20.0, 25.0], [5.0, 5.0], [500.0, 400.0]]])
        },
    )
    np.testing.assert_allclose(recovery_costs(outputs, 100.0, 10.0), [[0.2, 0.0, 10.0, 0.0]])
    outputs = outputs._replace(drawn={})
    np.testing.assert_allclose(recovery_costs(outputs, 100.0, 10.0), [[0.5, 0.1, 10.0, 0.9]])


def test_the_optimiser_asks_for_no_derivatives():
    assert OptimiserSettings("cma-es").derivative_free
    assert not OptimiserSettings().derivative_free
