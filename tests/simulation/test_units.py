"""Momenta of wheels in a unit of the body, so that states of small and large bodies compare."""

import jax
import numpy as np
import pytest

from jaxsat.control.controller import Coast
from jaxsat.core.attitude import Quaternion
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.simulation.units import in_units, out_of_units
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.disturbances import PeriodicTorque
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels, wheel_momentum


def test_a_state_in_units_has_rates_for_momenta():
    """The telescope's mean moment of inertia is 350 kg m²."""
    run = build(load("two-wheel-telescope"))
    body = run.loop.plant
    state = jax.tree.map(lambda x: x + 7.0, run.loop.start(run.start))
    found = in_units(body, state)
    np.testing.assert_allclose(wheel_momentum(found.plant), 7.0 / 350.0 + np.zeros(3))
    np.testing.assert_array_equal(found.plant.omega, state.plant.omega)
    again = jax.tree.leaves(out_of_units(body, found))
    for one, other in zip(again, jax.tree.leaves(state), strict=True):
        np.testing.assert_allclose(one, other, rtol=1e-15)


def coasting(slowness):
    """A tumbling body with two wheels and a torque in waves, whose times are `slowness` as long."""
    inertia = np.array([[4.0, 0.3, -0.2], [0.3, 2.5, 0.1], [-0.2, 0.1, 3.2]])
    waves = np.array([0.7, 0.8, 0.1]) / slowness
    torque = PeriodicTorque(np.array([0.05, 0.03, 0.04]) / slowness**2, waves, [0.0, 0.3, 0.5])
    axes = [[0.6, 0.0], [0.0, 1.0], [0.8, 0.0]]
    wheels = Wheels(axes, rotor_inertia=0.1, viscous_friction=1e-3 / slowness)
    orbit = ExactOrbit(0.0011 / slowness)
    body = RigidBody(Spacecraft(inertia), orbit, torque, effectors=(wheels,))
    momentum = WheelMomenta(np.array([0.2, -0.1]) / slowness)
    omega = np.array([0.1, -0.11, 0.05]) / slowness
    start = PlantState(Quaternion([0.8, 0.6, 0.0, 0.0]), omega, (momentum,))
    return ContinuousLoop(body, Coast()), start


@pytest.mark.slow
def test_the_default_tolerances_need_no_unit_of_time():
    """Similar flights of 2 ms, half an hour and 70 years have the same error.

    A power of two as the slowness changes no digit of the equations, so what differs is the error.
    """
    flights = {}
    for slowness in (2.0**-20, 1.0, 2.0**20):
        loop, start = coasting(slowness)
        times = np.linspace(0.0, 2048.0 * slowness, 5)
        found = simulate(loop, start, times, state_limit=1e9).signals
        momentum = found.parts["wheel_momentum"] * slowness
        flights[slowness] = (found.quaternion, found.omega * slowness, momentum)
    for slowness, flight in flights.items():
        for one, other in zip(flight, flights[1.0], strict=True):
            np.testing.assert_allclose(one, other, rtol=0, atol=1e-10, err_msg=str(slowness))
