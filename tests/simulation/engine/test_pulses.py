"""All engines fly pulses, ramps and failures alike, and cases keep their bits."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from helpers.thruster_layouts import allocated, canted, thruster_set
from jaxsat.control.quaternion_feedback import QuaternionFeedback
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.failures import FailureKind
from jaxsat.simulation.engine.fixed import SampledStepper
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.program import AbstractCaseFactory, Case, program_of
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.failures import FailureEvents
from jaxsat.spacecraft.modulation import DeltaSigma, PulseWidth
from jaxsat.spacecraft.pulsed_thrusters import PulsedThrusters
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.studies.columns import UNMADE

PERIOD, SECONDS = 0.2, 12.0


class Struck(AbstractCaseFactory):
    """A loop with another failure time and another struck thruster for every case."""

    loop: SampledLoop
    start: PlantState
    gain: Float[Array, ""] = eqx.field(converter=as_float, default=1.0)

    def __call__(self, case, gains):
        del gains
        events = self.loop.plant.effectors[0].failures
        events = eqx.tree_at(lambda one: (one.at, one.number), events, (case[:1], case[1:]))
        loop = eqx.tree_at(lambda loop: loop.plant.effectors[0].failures, self.loop, events)
        return Case(loop, self.start, {"failure": case}, jnp.array(True))


def factory(modulation, kind, **valves):
    torque, _ = canted()
    thrusters = thruster_set(torque, 0.02, **valves)
    late = "valve_delay" in valves
    events = FailureEvents([0.0], [0.0], [kind], [0.3], torque[None])
    actuators = PulsedThrusters(thrusters, allocated(torque), modulation, events, late)
    model = RigidBody(Spacecraft([0.30, 0.55, 0.62]), ExactOrbit(0.0011))
    law = QuaternionFeedback(model, 0.1, 1.0, 0.05, PERIOD)
    loop = SampledLoop(model.with_effectors((actuators,)), law, substeps=1)
    return Struck(loop, PlantState(Quaternion([0.6, 0.48, -0.64, 0.0]), [0.01, -0.02, 0.015]))


CASES = np.array([[1e9, 0], [3.456, 2], [0.0, 5], [7.7, 7], [11.95, 4], [5.0, 1]], float)
EXAMPLES = {
    "pwm, stuck on": (PulseWidth(), FailureKind.STUCK_ON, {}),
    "sums, leaking, late ramps": (
        DeltaSigma(),
        FailureKind.LEAKING,
        {"valve_delay": 0.03, "rise_time": 0.01, "fall_time": 0.02},
    ),
}


@pytest.mark.slow
@pytest.mark.parametrize("name", EXAMPLES)
def test_engines_agree(name):
    modulation, kind, valves = EXAMPLES[name]
    cases = factory(modulation, kind, **valves)
    program = program_of(cases, cases.loop, SECONDS)
    found = NativeEngine(SampledStepper()).evaluate(program, CASES)
    others = [ReferenceEngine(batch_size=6)]
    if not valves:  # machine code is made of the steps that are scanned: once is enough
        others.append(ScanEngine(SampledStepper(), batch_size=8))
    for other in (engine.evaluate(program, CASES) for engine in others):
        np.testing.assert_allclose(found.omega, other.omega, atol=1e-11)
        np.testing.assert_allclose(found.quaternion, other.quaternion, atol=1e-11)
        np.testing.assert_allclose(found.effort, other.effort, rtol=1e-9)
        np.testing.assert_allclose(found.parts["propellant"], other.parts["propellant"], rtol=1e-9)
        np.testing.assert_array_equal(found.parts["valve_openings"], other.parts["valve_openings"])
        for unmade in UNMADE:
            np.testing.assert_allclose(found.parts[unmade], other.parts[unmade], atol=1e-11)
    assert set(found.parts) == {"propellant", "valve_openings", *UNMADE}
    assert np.ptp(found.omega, axis=0).max() > 1e-4  # the failures differ
    alone = NativeEngine(SampledStepper()).evaluate(program, CASES[3:4])
    assert alone.omega.tobytes() == found.omega[3:4].tobytes()
