"""Wheels as machine code and by diffrax alone; held commands in the scanned engine as well."""

import dataclasses

import diffrax
import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from jaxsat.control.controller import AbstractFeedbackLaw
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float
from jaxsat.simulation.engine.adaptive import AdaptiveStepper, Tolerance
from jaxsat.simulation.engine.fixed import SampledStepper
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.program import AbstractCaseFactory, Case, program_of
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.loops import AbstractLoop, ContinuousLoop
from jaxsat.simulation.methods import adaptive, fixed
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.distribution import WheelsFirst
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels
from jaxsat.studies.columns import UNMADE
from simulation.engine.examples import WIDE

INERTIA = np.array([[4.0, 0.3, -0.2], [0.3, 2.5, 0.1], [-0.2, 0.1, 3.2]])
AXES = np.array([[1.0, 0.0, 0.5], [0.0, 1.0, -0.5], [0.1, 0.0, 0.7]])
AXES = AXES / np.linalg.norm(AXES, axis=0)


class Damping(AbstractFeedbackLaw):
    """A torque against the rates, and a wave that drives wheels to their limits."""

    def torque(self, t, state):
        return -0.4 * state.omega + 0.3 * jnp.stack([jnp.sin(t), jnp.cos(0.7 * t), 0.3 + 0 * t])


class Tumbling(AbstractCaseFactory):
    """A loop with another initial ω for every case."""

    loop: AbstractLoop
    start: PlantState

    def __call__(self, case, gains):
        del gains
        start = dataclasses.replace(self.start, omega=self.start.omega + case)
        return Case(self.loop, start, {"kick": case}, jnp.array(True))


KICKS = 0.05 * np.random.default_rng(3).normal(size=(3, 3))
MOMENTA = WheelMomenta([0.1, -0.2, 0.05])
START = PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), [0.05, -0.03, 0.1], (MOMENTA,))


class Sampled(AbstractSampledController):
    """The same once a period."""

    period: Float[Array, ""] = eqx.field(converter=as_float)

    def init(self, state):
        return None

    def step(self, t, state, memory):
        return Damping().torque(t, state), memory


LIMITS = [0.3, 0.35, 0.4]
SHARED = WheelsFirst.of(AXES, 3, wheel_limit=0.25)


def body(coulomb=None):
    wheels = Wheels(AXES, 0.25, LIMITS, 0.01, 2e-4, coulomb)
    return RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0), effectors=(wheels,))


def continuous():
    stepper = AdaptiveStepper(tolerance=Tolerance(1e-11, 1e-11))
    reference = ReferenceEngine(adaptive(1e-11, 1e-11, min_step=1e-10), batch_size=3)
    loop = ContinuousLoop(body(), Damping(), SHARED)
    return loop, [NativeEngine(stepper)], reference, 1e-7


def sampled():
    reference = ReferenceEngine(fixed(0.5, diffrax.Bosh3()), batch_size=3)
    loop = SampledLoop(body([0.02, 0.01, 0.03]), Sampled(0.5), SHARED, 2)
    stepper = SampledStepper(diffrax.Bosh3())
    return loop, [ScanEngine(stepper, 3), NativeEngine(stepper)], reference, 1e-12


@pytest.mark.slow
@pytest.mark.parametrize("kind", [continuous, sampled])
def test_engines_agree_on_wheels_that_come_to_their_limits(kind):
    loop, engines, reference, tolerance = kind()
    prog = program_of(Tumbling(loop, START), loop, 8.0, tolerances=WIDE)
    expected, signals = reference.observed(prog, KICKS, None, prog.instants())
    others = [engine.evaluate(prog, KICKS) for engine in engines]
    momentum = np.abs(signals.parts["wheel_momentum"])
    assert np.all(expected.code == 0)
    for found in others:
        peaks = found.parts["peak_wheel_momentum"]
        assert np.max(peaks / LIMITS) == pytest.approx(1, abs=1e-9)
        np.testing.assert_allclose(peaks, momentum.max(axis=1), atol=tolerance)
        unmade = UNMADE if kind is sampled else ()
        assert set(found.parts) == {"peak_wheel_momentum", *unmade}
        values, right = (one._asdict() | one.parts for one in (found, expected))
        for name in ("w", "z", "quaternion", "omega", "cost", *found.parts):
            np.testing.assert_allclose(values[name], right[name], atol=tolerance, err_msg=name)
