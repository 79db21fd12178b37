"""Search space, aggregates, and what a batch of cases comes to."""

from types import SimpleNamespace

import numpy as np
import pytest

from jaxsat.scenario.optimisers import OptimiserSettings
from jaxsat.synthesis.tuning import baselines
from jaxsat.synthesis.tuning.parameters import SearchSpace, TunedParameter
from jaxsat.synthesis.tuning.plan import (
    ConditionalValueAtRisk,
    LargestCost,
    Mean,
    Objective,
    Quantile,
    TailCompression,
)

SPACE = SearchSpace(
    (
        TunedParameter("law.k", 1e-3, 300.0),
        TunedParameter("pair", 0.5, 2.0, "logit", (2,), "p"),
    )
)
VALUES = np.array([[0.01, 0.7, 1.9], [250.0, 1.25, 0.6]])


def test_values_go_to_the_search_and_back():
    points = SPACE.to_search(VALUES)
    np.testing.assert_allclose(points[:, 0], np.log(VALUES[:, 0]))
    np.testing.assert_allclose(points[0, 1], np.log(0.2 / 1.3))
    np.testing.assert_allclose(SPACE.to_values(points), VALUES, rtol=1e-12)
    assert SPACE.labels == ("law.k", "p[1]", "p[2]")
    gains = SPACE.gains(VALUES)
    assert gains["law.k"].shape == (2,)
    assert gains["pair"].shape == (2, 2)
    np.testing.assert_array_equal(SPACE.joined(gains, (2,)), VALUES)


def test_slopes_are_those_of_the_values():
    points, h = SPACE.to_search(VALUES), 1e-6
    for i in range(3):
        shift = h * np.eye(3)[i]
        difference = (SPACE.to_values(points + shift) - SPACE.to_values(points - shift)) / (2 * h)
        expected = SPACE.slope(points)[:, i]
        np.testing.assert_allclose(difference[:, i], expected, rtol=1e-6)
        np.testing.assert_array_equal(np.delete(difference, i, axis=1), 0)


def test_no_point_leaves_the_bounds():
    far = np.array([[-1e3] * 3, [1e3] * 3])
    low, high = SPACE.to_values(SPACE.projected(far))
    np.testing.assert_allclose(low, [1e-3, 0.5, 0.5], rtol=1e-4)
    np.testing.assert_allclose(high, [300, 2, 2], rtol=1e-4)
    assert np.all(np.isfinite(SPACE.to_search(np.array([[1e-9, 0.5, 2.0]]))))


def test_values_at_their_bounds_are_told():
    near = {"k": np.array([0.0101, 100.0]), "m": np.array([1.995])}
    pair = TunedParameter("k", 0.01, 100.0, shape=(2,))
    space = SearchSpace((pair, TunedParameter("m", 1.0, 2.0, "logit")))
    values = space.joined(near, ())
    assert space.at_bounds(values) == {"k[1]": 0.01, "k[2]": 100.0, "m": 2.0}
    assert space.at_bounds(np.array([0.02, 90.0, 1.5])) == {}


def test_starts_are_log_uniform_where_the_search_is_logarithmic():
    drawn = SPACE.drawn(20000, 3)
    np.testing.assert_allclose(np.median(drawn[:, 0]), np.sqrt(1e-3 * 300), rtol=0.1)
    np.testing.assert_allclose(np.median(drawn[:, 1]), 1.25, rtol=0.02)
    np.testing.assert_array_equal(drawn[:5], SPACE.drawn(20000, 3)[:5])


@pytest.mark.parametrize(
    ("wrong", "message"),
    [
        ({"low": 2.0, "high": 1.0}, "low < high"),
        ({"low": 0.0, "high": 1.0}, "positive in log scale"),
        ({"low": 0.1, "high": 1.0, "scale": "linear"}, "`scale` must be one of"),
    ],
)
def test_bounds_are_checked(wrong, message):
    with pytest.raises(ValueError, match=message):
        TunedParameter("k", **wrong)


COSTS = np.array([3.0, 100.0, 1.0, 7.0, 5.0, 40.0, 2.0, 9.0])


@pytest.mark.parametrize(
    ("aggregate", "expected"),
    [
        (Mean(), COSTS.mean()),
        (LargestCost(), 100.0),
        (Quantile(0.8), np.quantile(COSTS, 0.8)),
        (ConditionalValueAtRisk(0.75), (100 + 40) / 2),
        (ConditionalValueAtRisk(0.7), (100 + 40 + 0.4 * 9) / 2.4),
    ],
)
def test_aggregates_and_their_weights(aggregate, expected):
    np.testing.assert_allclose(aggregate(COSTS), expected)
    np.testing.assert_allclose(aggregate.weights(COSTS).sum(), 1)
    step = 1e-5
    differences = [
        (aggregate(COSTS + step * unit) - aggregate(COSTS - step * unit)) / (2 * step)
        for unit in np.eye(len(COSTS))
    ]
    np.testing.assert_allclose(aggregate.weights(COSTS), differences, atol=1e-9)


def test_the_conditional_value_at_risk_is_that_of_its_definition():
    """min over t of t + E[max(c - t, 0)] / (1 - α), by Rockafellar and Uryasev."""
    costs = np.random.default_rng(0).exponential(size=101)
    thresholds = np.linspace(0, costs.max(), 200001)
    excess = np.array([np.maximum(costs - t, 0).mean() for t in thresholds[::100]])
    expected = (thresholds[::100] + excess / 0.1).min()
    np.testing.assert_allclose(ConditionalValueAtRisk(0.9)(costs), expected, rtol=1e-3)


def test_the_gradient_of_the_objective_is_that_of_its_loss():
    """Costs that depend on two numbers in a known way, through an aggregate and a tail."""
    slopes = np.random.default_rng(1).normal(size=(8, 2))
    objective = Objective(ConditionalValueAtRisk(0.5), TailCompression(20.0), case_bound=1e9)

    def loss(x):
        return objective.value(COSTS + slopes @ x)

    judged = objective.loss_gradient(COSTS, slopes)
    step = 1e-6
    expected = [(loss(step * u) - loss(-step * u)) / (2 * step) for u in np.eye(2)]
    np.testing.assert_allclose(judged.gradient, expected, rtol=1e-6)
    np.testing.assert_allclose(judged.loss, loss(np.zeros(2)))
    assert judged.masked == judged.bounded == 0


def test_bad_cases_are_masked_bounded_and_counted():
    slopes = np.ones((8, 2))
    slopes[1] = 1e12
    slopes[4] = np.nan
    costs = np.where(np.arange(8) == 6, np.nan, COSTS)
    judged = Objective(Mean(), case_bound=10.0).loss_gradient(costs, slopes)
    assert judged.masked == 2
    assert judged.bounded == 1
    np.testing.assert_allclose(judged.gradient, (5 * 1 + 10) / 6)
    nothing = Objective(Mean()).loss_gradient(np.full(3, np.nan), np.ones((3, 2)))
    assert np.isinf(nothing.loss)
    np.testing.assert_array_equal(nothing.gradient, 0)


@pytest.mark.slow
@pytest.mark.parametrize("name", ["lbfgs", "cosine_decay_schedule", "polyak_sgd", "adma", "tree"])
def test_only_optimisers_that_need_gradients_alone_are_taken(name):
    with pytest.raises(ValueError, match=f"`optimiser` must be .* but got '{name}'"):
        OptimiserSettings(name)


@pytest.mark.parametrize("schedule", ["constant", "cosine", "exponential"])
def test_a_quadratic_is_minimised(schedule):
    made = OptimiserSettings("adam", 0.2, schedule).transformation(200)
    x = np.array([3.0, -2.0])
    state = made.init(x)
    for _ in range(200):
        update, state = made.update(2 * x, state, x)
        x = x + np.asarray(update)
    assert np.abs(x).max() < 0.05


@pytest.mark.parametrize("top", [5.0, 0.5])
def test_bfgs_finds_the_valley_and_stays_within_the_bounds(top):
    """Rosenbrock's function, whose least value is at (1, 1); beyond x2 <= 1/2 at x1 = √½."""

    class Valley(baselines._Search):
        def __init__(self):
            low, high = np.full(2, -5.0), np.array([5.0, top])
            self.plan = SimpleNamespace(space=SimpleNamespace(ends=(low, high)))
            self.seen = []

        def gradient(self, x):
            value = 100 * (x[1] - x[0] ** 2) ** 2 + (1 - x[0]) ** 2
            slope = [-400 * x[0] * (x[1] - x[0] ** 2) - 2 * (1 - x[0]), 200 * (x[1] - x[0] ** 2)]
            self.seen.append((float(value), x.copy()))
            return float(value), np.array(slope)

        def check_if_due(self, point=None):
            del point

    search = Valley()
    baselines.bfgs(search, np.array([-1.2, 0.4]))
    best = min(search.seen, key=lambda one: one[0])[1]
    np.testing.assert_allclose(best, 1.0 if top > 1 else [np.sqrt(0.5), 0.5], rtol=5e-3)
    assert all(point[1] <= top for _, point in search.seen)
