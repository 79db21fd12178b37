"""Momenta of wheels in a unit of the body, so that states of small and large bodies compare."""

import jax
import numpy as np

from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.simulation.units import in_units, out_of_units
from jaxsat.spacecraft.wheels import wheel_momentum


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
