"""Loops with corners: their smooth pieces, and their states in the rotating frame."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.paper import (
    PAPER_RATE,
    PAPER_THREE_AXIS,
    actuators,
    bodies,
    rate_loop,
    rate_start,
    three_axis_law,
    three_axis_loop,
    three_axis_start,
)
from jaxsat.simulation.engine.flat_ode import into_frame, motion_in_frame, out_of_frame
from jaxsat.simulation.loops import ContinuousLoop

LOOPS = {
    "error": lambda: (three_axis_loop(PAPER_THREE_AXIS), three_axis_start(PAPER_THREE_AXIS)),
    "limited": lambda: (
        ContinuousLoop(
            bodies(PAPER_THREE_AXIS)[0].with_effectors((actuators(3.0),)),
            three_axis_law(PAPER_THREE_AXIS),
        ),
        three_axis_start(PAPER_THREE_AXIS),
    ),
    "rate": lambda: (rate_loop(PAPER_RATE), rate_start(PAPER_RATE)),
}
T = jnp.array(1.3)
SLOW = ("error", "limited")


def same(one, other, tolerance=1e-12):
    for x, y in zip(jax.tree.leaves(one), jax.tree.leaves(other), strict=True):
        np.testing.assert_allclose(x, y, rtol=tolerance, atol=tolerance)


@pytest.mark.parametrize(
    "name", [pytest.param(one, marks=pytest.mark.slow) if one in SLOW else one for one in LOOPS]
)
def test_a_loop_is_its_smooth_piece_where_its_event_functions_say_so(name):
    loop, start = LOOPS[name]()
    state = loop.start(start)
    events = loop.event_functions(T, state)
    assert events.shape[0] == {"error": 2, "limited": 4, "rate": 3}[name]
    signs = events > 0
    same(loop.smooth_piece(signs).motion(T, state), loop.motion(T, state))
    # the other side of the first corner, or of a limit, which hides that one
    corner = 2 if name == "limited" else 0
    flipped = signs.at[corner].set(~signs[corner])
    other = loop.smooth_piece(flipped).motion(T, state)
    assert np.abs(other.torque - loop.motion(T, state).torque).max() > 1e-3


@pytest.mark.parametrize("name", LOOPS)
def test_a_state_in_the_rotating_frame_moves_as_the_state_does(name):
    """Its rate is that of `into_frame` along the loop, by the chain rule."""
    loop, start = LOOPS[name]()
    state = jax.tree.map(lambda x: x + 0.01, loop.start(start))
    framed = into_frame(loop, T, state)
    same(out_of_frame(loop, T, framed), state)
    moving = (jnp.ones(()), loop(T, state))
    expected = jax.jvp(lambda t, x: into_frame(loop, t, x), (T, state), moving)[1]
    same(motion_in_frame(loop, T, framed).rate, expected, 1e-10)
