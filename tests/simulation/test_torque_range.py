"""What is told of a torque that changes between the saved times."""

import itertools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.held_torque import over_parts
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.thrusters import Thrusters
from jaxsat.store.dataset import trajectory_dataset

PERIOD, SAMPLES = 0.5, 24


class Count(NamedTuple):
    samples: Float[Array, ""]


class BangBang(AbstractSampledController):
    """u1 changes its sign at every sample, u2 grows with it."""

    size: Float[Array, ""] = eqx.field(converter=as_float)
    period: Float[Array, ""] = eqx.field(converter=as_float, default=PERIOD)

    def init(self, state):
        return Count(jnp.zeros(()))

    def step(self, t, state, memory):
        sign = 1 - 2 * jnp.mod(memory.samples, 2)
        return self.size * jnp.stack([sign, memory.samples]), Count(memory.samples + 1)


def flown(every, delay=None, size=0.1, **options):
    plant = RigidBody(Spacecraft((2.0, 3.0, 4.0)), ExactOrbit(0.0))
    thrusters = Actuators.of(Thrusters(jnp.eye(3)).without([3]))
    loop = SampledLoop(plant.with_effectors((thrusters,)), BangBang(size), substeps=1, delay=delay)
    start = PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), [0.0, 0.0, 0.0])
    return simulate(loop, start, np.arange(0, SAMPLES + 1, every) * PERIOD, **options)


def expected(every, delay):
    """Least, largest and mean of each saved interval, from the list of all that was held."""
    number = np.arange(SAMPLES)
    asked = 0.1 * np.stack([(-1.0) ** number, number, 0 * number], 1)
    before = np.concatenate([np.zeros((1, 3)), asked[:-1]])
    wait = delay or 0.0
    found = []
    for first in range(0, SAMPLES, every):
        part = slice(first, first + every)
        held = [asked[part]] if wait < PERIOD else []
        held += [before[part]] if wait > 0 else []
        mean = (wait * before[part] + (PERIOD - wait) * asked[part]) / PERIOD
        both = np.concatenate(held)
        found.append([both.min(0), both.max(0), mean.mean(0)])
    return np.array(found)


@pytest.mark.slow
@pytest.mark.parametrize(("every", "delay"), [(2, None), (6, 0.0), (2, 0.2), (6, 0.2), (6, PERIOD)])
def test_the_range_is_that_of_every_hold(every, delay):
    run = flown(every, delay)
    told = np.stack([run.torque_range.least, run.torque_range.largest, run.torque_range.mean], 1)
    np.testing.assert_allclose(told[:-1], expected(every, delay), atol=1e-15)
    for part in told[-1]:
        np.testing.assert_array_equal(part, run.signals.torque[-1])
    assert np.ptp(run.signals.torque[1:, 0]) == 0, "what is saved looks constant"


@pytest.mark.slow
def test_it_changes_no_other_bit_and_no_derivative():
    fine, coarse = flown(1), flown(4)
    for name in ("omega", "torque", "quaternion"):
        every = getattr(fine.signals, name)[::4]
        np.testing.assert_array_equal(getattr(coarse.signals, name), every)

    def end(size):
        run = flown(4, size=size)
        return run.signals.omega[-1, 1] + jnp.sum(run.torque_range.mean)

    spin = jax.grad(end)(1e-6)  # which the range has no share in
    np.testing.assert_allclose(spin, PERIOD * np.arange(SAMPLES).sum() / 3.0, rtol=1e-6)


@pytest.mark.slow
def test_a_dataset_has_it_where_it_says_more_than_the_torque_saved():
    coarse, fine = (trajectory_dataset(flown(every)) for every in (6, 1))
    np.testing.assert_allclose(coarse["torque_min"][:-1, 0], -0.1)
    np.testing.assert_allclose(coarse["torque_max"][:-1, 0], 0.1)
    np.testing.assert_allclose(coarse["torque_mean"][:-1, 0], 0.0, atol=1e-15)
    assert coarse["torque_max"].attrs["units"] == "N m"
    assert coarse["torque_max"].dims == ("time", "body_axis")
    assert not {"torque_min", "torque_max", "torque_mean"} & set(fine)


@pytest.mark.slow
def test_a_failed_run_has_none_after_its_end():
    run = flown(4, state_limit=1.25)  # which attitude and rates reach after 5 s
    assert int(run.code) != 0
    least = np.asarray(run.torque_range.least)
    assert np.isfinite(least[0]).all()
    assert np.isnan(least[-1]).all()


def test_parts_of_unequal_length_are_those_of_a_plain_loop():
    """Sums, least and largest from each number to the next."""
    values, numbers = np.random.default_rng(3).normal(size=(9, 2)), np.array([0, 1, 4, 9])
    for combine in (np.add, np.minimum, np.maximum):
        found = over_parts(combine, jnp.asarray(values), jnp.asarray(numbers))
        expected = [combine.reduce(values[a:b]) for a, b in itertools.pairwise(numbers)]
        np.testing.assert_allclose(found, expected, rtol=1e-14)
