"""Wheels beside thrusters that push, of which either fails: machine code and diffrax agree."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.effectors import effector_of
from helpers.thruster_layouts import allocated, pairs, thruster_set
from jaxsat.core.attitude import Quaternion
from jaxsat.core.declaration.failures import FailureKind
from jaxsat.core.declaration.wheels import WheelFailureKind
from jaxsat.simulation.engine.program import AbstractCaseFactory, Case, program_of
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.distribution import WheelsFirst
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.failures import FailureEvents
from jaxsat.spacecraft.modulation import PulseWidth
from jaxsat.spacecraft.pulsed_thrusters import PulsedThrusters
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.wheel_failures import WheelFailures
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels
from simulation.engine.examples import agreed
from simulation.engine.test_wheels import INERTIA, Sampled

AXES = np.eye(3)[:, :2]
TORQUE = pairs()


class Struck(AbstractCaseFactory):
    """A loop in which another thruster and another wheel fail in every case, and otherwise."""

    loop: SampledLoop
    start: PlantState

    def __call__(self, case, gains):
        del gains
        thruster, wheel = case[:3, None], case[3:, None]
        torque = jnp.asarray(TORQUE)[None]
        events = FailureEvents(thruster[1], thruster[0], thruster[2], 0.4 + 0 * case[:1], torque)
        wheels = WheelFailures(wheel[1], wheel[0], wheel[2], 0.4 + 0 * case[:1])
        loop = eqx.tree_at(
            lambda loop: (
                loop.plant.effectors[0].failures,
                effector_of(loop.plant, Wheels).failures,
            ),
            self.loop,
            (events, wheels),
        )
        return Case(loop, self.start, {"failure": case}, jnp.array(True))


def factory():
    nothing = WheelFailures([0.0], [np.inf], [0.0], [0.0])
    wheels = Wheels(AXES, 0.25, [0.3, 0.35], 0.01, 2e-4, 0.01, nothing)
    events = FailureEvents([0.0], [np.inf], [0.0], [0.0], TORQUE[None])
    thrusters = PulsedThrusters(thruster_set(TORQUE, 0.01), allocated(TORQUE), PulseWidth(), events)
    body = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0), effectors=(thrusters, wheels))
    shared = WheelsFirst.of(AXES, 2, 0.25)
    rest, wheel_map = np.diag([0.0, 0.0, 1.0]), np.pad(shared.wheel_map, ((0, 0), (0, 1)))
    mixed = WheelsFirst(shared.axes, wheel_map, shared.wheel_limit, rest)
    start = PlantState(
        Quaternion([1.0, 0.0, 0.0, 0.0]), [0.05, -0.03, 0.1], (None, WheelMomenta([0.1, -0.2]))
    )
    return Struck(SampledLoop(body, Sampled(0.5), mixed, 2), start)


W, T, NEVER = WheelFailureKind, FailureKind, np.inf
CASES = np.array(
    [
        [NEVER, 0, T.DEAD, NEVER, 0, W.DEAD],
        [2.2, 4, T.STUCK_ON, NEVER, 0, W.DEAD],
        [NEVER, 0, T.DEAD, 3.1, 1, W.STOPPED],
        [3.3, 5, T.DEAD, 3.1, 0, W.RUNAWAY],
        [1.0, 4, T.DEGRADED, 1.0, 1, W.FRICTION_TO],
        [3.13, 5, T.STUCK_AT, 3.12, 0, W.STOPPED],
    ],
    float,
)


@pytest.mark.slow
def test_engines_agree_on_whatever_fails():
    cases = factory()
    program = program_of(cases, cases.loop, 8.0)
    found = agreed(program, CASES, 0.5, apart=1e-4)
    assert np.all(found.code == 0)
