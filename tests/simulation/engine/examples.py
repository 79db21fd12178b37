"""Every kind of loop with engines that serve it, and cases for them."""

import dataclasses
from typing import NamedTuple

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from helpers.paper import (
    PAPER_THREE_AXIS,
    actuators,
    bodies,
    three_axis_law,
    three_axis_loop,
    three_axis_start,
)
from helpers.switching import CASE, start, switching_loop
from jaxsat.control.navigation.mekf import MultiplicativeFilter
from jaxsat.control.navigation.navigation import Navigation
from jaxsat.core.noise import key_of_seed
from jaxsat.core.tolerances import Tolerances
from jaxsat.simulation.engine.adaptive import AdaptiveStepper, Tolerance
from jaxsat.simulation.engine.fixed import FixedStepper, SampledStepper
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.program import AbstractCaseFactory, Case, program_of
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.error_coordinates import ErrorCoordinateLoop
from jaxsat.simulation.loops import AbstractLoop, ContinuousLoop
from jaxsat.simulation.methods import adaptive, fixed
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.navigation_sensors import Gyro, StarTracker
from jaxsat.spacecraft.sensors import Sensors


def agreed(program, cases, period, apart):
    """What the native engine gives of a sampled loop once diffrax agrees with it.

    Two cases differ by `apart` (rad/s) at least, and a case alone keeps its bits. The
    method has few stages: engines that take the same steps agree whatever its order.
    Machine code is made of the steps that the scanned engine takes: it need not agree as well.
    """
    stepper = SampledStepper(diffrax.Bosh3())
    engine, count = NativeEngine(stepper), len(jax.tree.leaves(cases)[0])
    found = engine.evaluate(program, cases)
    reference = ReferenceEngine(fixed(period, diffrax.Bosh3()), batch_size=count)
    expected = reference.evaluate(program, cases)
    np.testing.assert_allclose(found.omega, expected.omega, atol=1e-12)
    np.testing.assert_allclose(found.quaternion, expected.quaternion, atol=1e-12)
    np.testing.assert_allclose(found.effort, expected.effort, rtol=1e-9)
    differences = np.abs(found.omega[:, None] - found.omega[None]).max(axis=2)
    assert (differences + np.eye(count)).min() > apart
    for one in (0, count - 1):
        alone = engine.evaluate(program, jax.tree.map(lambda x, i=one: x[i : i + 1], cases))
        assert alone.omega.tobytes() == found.omega[one : one + 1].tobytes()
    return found


BATCH = 8
WIDE = Tolerances(1.3, 1.3, 0.3)
"""Loose enough for some of the short runs here to count as settled and some not."""


class Kicked(AbstractCaseFactory):
    """A loop with another initial ω for every case, and another gain if asked."""

    loop: AbstractLoop
    start: PlantState

    def __call__(self, case, gains):
        loop = self.loop
        if gains is not None:
            where = self._gain_of
            loop = eqx.tree_at(where, loop, gains * where(loop))
        omega = self.start.omega + case
        return Case(loop, PlantState(self.start.attitude, omega), {"kick": case}, jnp.array(True))

    @staticmethod
    def _gain_of(loop):
        law = loop.law if isinstance(loop, ErrorCoordinateLoop) else loop.controller
        return getattr(law, "three_axis_law", law).k3


class Example(NamedTuple):
    case_factory: Kicked
    duration: float
    scan: ScanEngine
    reference: ReferenceEngine
    agreement: float


def smooth_law():
    case = {**PAPER_THREE_AXIS, "relation": "exact"}
    return bodies(case)[0], three_axis_law(case, saturation_width=1.0, tilt_width=0.3)


def sampled_example():
    plain = switching_loop(CASE)
    loop = SampledLoop(
        plain.plant.with_effectors(
            (
                plain.plant.effectors[0]
                .misaligned(jnp.full((2, 2), 0.01))
                .stronger(jnp.array([0.05, -0.05])),
            )
        ),
        plain.controller,
        substeps=2,
        sensors=Sensors(1e-5, 5e-5, key_of_seed(9)),
        delay=0.03,
    )
    scan = ScanEngine(SampledStepper(diffrax.Dopri5()), BATCH)
    reference = ReferenceEngine(fixed(0.1, diffrax.Dopri5()), batch_size=BATCH)
    return Example(Kicked(loop, start()), 12.0, scan, reference, 1e-9)


def estimated_example():
    """The same law, told what a filter makes of a gyro and a star tracker with latency."""
    plain = switching_loop(CASE)
    gyro = Gyro(1e-5, 1e-7, bias_sigma=1e-5, scale_factor=1e-5, limit=0.3)
    tracker = StarTracker(5e-5, 2e-4, [0.0, 0.6, 0.8], every=3, latency=2, rate_limit=0.3)
    estimator = MultiplicativeFilter(plain.plant.orbit, gyro, tracker)
    navigation = Navigation(gyro, tracker, estimator, 1e-3, key_of_seed(9))
    loop = dataclasses.replace(plain, substeps=2, delay=0.03, navigation=navigation)
    return sampled_example()._replace(case_factory=Kicked(loop, start()))


def continuous_example():
    plant, law = smooth_law()
    loop = ContinuousLoop(plant.with_effectors((actuators(3.0),)), law)
    scan = ScanEngine(FixedStepper(substeps=100), BATCH)
    reference = ReferenceEngine(adaptive(1e-10, 1e-10, diffrax.Tsit5()), batch_size=BATCH)
    begin = three_axis_start(PAPER_THREE_AXIS)
    return Example(Kicked(loop, begin), 12.0, scan, reference, 2e-5)


def error_example():
    plant, law = smooth_law()
    begin = three_axis_start(PAPER_THREE_AXIS)
    turned = PlantState(begin.attitude.as_quaternion(), begin.omega)
    scan = ScanEngine(FixedStepper(substeps=100), BATCH)
    reference = ReferenceEngine(adaptive(1e-10, 1e-10, diffrax.Tsit5()), batch_size=BATCH)
    return Example(Kicked(ErrorCoordinateLoop(plant, law), turned), 12.0, scan, reference, 2e-5)


def corners_example():
    """The printed law, whose switches one engine locates and the other does not."""
    begin = three_axis_start(PAPER_THREE_AXIS)
    scan = ScanEngine(AdaptiveStepper(tolerance=Tolerance(1e-10, 1e-10)), BATCH)
    reference = ReferenceEngine(adaptive(1e-11, 1e-11, min_step=1e-9), batch_size=BATCH)
    return Example(Kicked(three_axis_loop(PAPER_THREE_AXIS), begin), 12.0, scan, reference, 2e-6)


EXAMPLES = {
    "corners": corners_example,
    "sampled": sampled_example,
    "estimated": estimated_example,
    "continuous": continuous_example,
    "error": error_example,
}
GAIN = jnp.array(1.0)
"""Given in every run, so that runs and the differences that derivatives are held against share one
compiled program."""

KICKS = 0.02 * np.random.default_rng(1).normal(size=(11, 3)) * [1, 1, 0]


def program(example, duration=None):
    loop = example.case_factory.loop
    return program_of(example.case_factory, loop, duration or example.duration, tolerances=WIDE)


def same_bits(one, other):
    for x, y in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_array_equal(x, y)
