"""Cases without a usable gradient are told: which, by which gain, when and by which operation."""

import dataclasses
import inspect
from types import SimpleNamespace

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.control.rate import RateLaw
from jaxsat.simulation.engine.nan_origin import nan_in_run
from jaxsat.simulation.engine.program import AbstractCaseFactory
from jaxsat.simulation.trajectory import Outcome
from jaxsat.synthesis.tuning.cost_evaluator import CaseGradients
from jaxsat.synthesis.tuning.descent import descent_step, initial_state
from jaxsat.synthesis.tuning.receipt import Receipt, _first_masked, check_gradients
from jaxsat.synthesis.tuning.unusable import NoGradient, unusable
from synthesis.tuning.plans import with_settings


class Spoilt(RateLaw):
    """The rate law, its torques as before, whose derivatives are NaN once ω3 is below a rate."""

    below: jax.Array | None = None

    def feedback(self, state, rate_error, memory):
        above = jnp.sqrt(jnp.maximum(state.omega[2] - self.below, 0.0))
        return super().feedback(state, rate_error, memory) + 0.0 * above


class WithSpoiltLaw(AbstractCaseFactory):
    """Cases under the law above."""

    inner: AbstractCaseFactory
    below: jax.Array

    def __call__(self, case, gains=None):
        made = self.inner(case, gains)
        law = made.loop.controller
        numbers = {field.name: getattr(law, field.name) for field in dataclasses.fields(law)}
        spoilt = Spoilt(**numbers, below=self.below)
        return made._replace(loop=eqx.tree_at(lambda loop: loop.controller, made.loop, spoilt))


def third_rates(stepper, program, case, gains):
    """ω3 at the beginning of every interval and at the end."""
    made = program.case_factory(case, gains)
    after = jax.jit(lambda progress, number: stepper.advance(program, made, progress, number, 1))
    progress = stepper.begin(program, made)
    found = [float(progress.state.plant.omega[2])]
    for number in range(program.intervals):
        progress = after(progress, jnp.array(number))
        found.append(float(progress.state.plant.omega[2]))
    return np.array(found)


@pytest.mark.slow
def test_the_time_and_the_operation_are_those_of_the_nan(plan):
    point = plan.space.to_search(plan.start[None])[0]
    stepper, program, case, gains, direction = plan.smooth.derivative_of_one(point, 0, 0, None)
    rates = third_rates(stepper, program, case, gains)
    assert np.all(np.diff(rates) < 0)
    for number in (0, 4):
        below = jnp.asarray((rates[number] + rates[number + 1]) / 2)
        spoilt = eqx.tree_at(
            lambda program: program.case_factory,
            program,
            WithSpoiltLaw(program.case_factory, below),
        )
        found = nan_in_run(stepper, spoilt, case, gains, direction)
        assert found.time == number * float(program.interval)
        assert found.origin.operation == "mul"
        lines, first = inspect.getsourcelines(Spoilt.feedback)
        assert first <= found.origin.place[-1].line < first + len(lines)
    assert nan_in_run(stepper, program, case, gains, direction) is None


def gradients(points, numbers, bad):
    """Made-up gradients of two gains of which those of the cases `bad` are NaN by the second."""
    shape = (len(points), len(numbers))
    derivatives = np.ones((*shape, 2))
    derivatives[:, np.isin(numbers, bad), 1] = np.nan
    outputs = SimpleNamespace(cost=np.ones(shape), code=np.zeros(shape, int))
    outputs.settling_time = np.full(shape, np.inf)
    return CaseGradients(outputs, derivatives)


@pytest.fixture
def spoil(plan, monkeypatch):
    """A function that makes gradients NaN of cases, without telling why."""

    def spoil(bad):
        def differentiate(self, points, numbers, intervals=None):
            del self, intervals
            found = gradients(points, numbers, bad)
            outputs = plan.smooth.evaluate(points, numbers)
            return found._replace(outputs=outputs)

        monkeypatch.setattr(type(plan.smooth), "differentiate", differentiate)
        monkeypatch.setattr("jaxsat.synthesis.tuning.unusable.nan_in_run", lambda *_: None)

    return spoil


def test_a_step_without_any_usable_gradient_stops_the_descent(plan, spoil):
    spoil(range(100))
    state = initial_state(with_settings(plan, starts=2))
    with pytest.raises(
        NoGradient,
        match=r"step 1 has a usable gradient at any of its 2 points; at the first 4 of 4 cases .*"
        r"\(0, 1, 2, 3\): the derivative of case 0 by k2 is NaN",
    ):
        descent_step(plan, state)


def test_a_few_cases_without_a_gradient_are_told_and_left_out(plan, spoil):
    spoil([2])
    state = descent_step(plan, initial_state(plan))
    assert state.steps[0].masked.tolist() == [1, 1, 1]
    assert _first_masked(plan, state) == (
        "at step 1, start 1, 1 of 4 cases have no usable gradient (2): the derivative of case 2 by "
        "k2 is NaN"
    )


def test_cases_are_listed_up_to_a_number_and_told_apart(plan):
    numbers, point = np.arange(30, 42), np.zeros(2)
    one = gradients(np.zeros((1, 2)), numbers, [])
    assert unusable(plan.smooth, point, numbers, None, one) is None
    one.derivatives[0, :, 1] = np.inf
    told = str(unusable(plan.smooth, point, numbers, None, one))
    assert told.startswith("12 of 12 cases have no usable gradient (30, 31, 32, 33, 34, 35, 36, 37")
    assert told.endswith(" and 4 more): the derivative of case 30 by k2 is infinite")
    one.derivatives[0, :, 1] = 1.0
    one.outputs.cost[0, :2], one.outputs.code[0, :2] = np.nan, int(Outcome.IMPOSSIBLE_CASE)
    told = str(unusable(plan.smooth, point, numbers, None, one))
    assert told == (
        "2 of 12 cases have no usable gradient (30, 31), 2 of them as they cannot exist"
    )


def test_the_receipt_tells_cases_that_fail_from_those_without_a_derivative(plan, spoil):
    point = plan.space.to_search(plan.start[None])[0]
    spoil([0, 1, 2])
    none = check_gradients(plan.smooth, point, np.arange(3))
    some = check_gradients(plan.smooth, point, np.arange(4))
    assert (none.cases, none.undefined) == (0, 3)
    assert (some.cases, some.left_out, some.undefined) == (1, 3, 3)
    sizes = dict.fromkeys(("smoothing_bias", "largest_smoothing_bias"), 0.0)
    sizes |= dict.fromkeys(("step_sensitivity", "largest_step_sensitivity"), 0.0)
    counts = dict.fromkeys(("gradient_samples", "failed", "masked", "bounded"), 0)
    receipt = Receipt(plan.space.labels, none, some, none, none, widths={}, **sizes, **counts)
    first, second = receipt.problems[:2]
    assert first == "at the start 3 of 3 cases that reached their end have no finite derivative"
    assert second == "at the end 3 of 4 cases that reached their end have no finite derivative"
