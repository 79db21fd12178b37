"""The internal model: exact over a held period, and at rest in its own rotating frame."""

import jax.numpy as jnp
import numpy as np
from scipy.linalg import expm

from jaxsat.control.three_axis import InternalModel, OscillatorState


def test_internal_model_advances_exactly():
    """One held period against the matrix exponential of the oscillator with its input."""
    oscillator, drive, period = InternalModel([0.7, 0.8]), np.array([0.01, -0.02]), 0.5
    state = oscillator.advance(oscillator.init(), jnp.array(drive), jnp.array(2.0))
    after = oscillator.advance(state, jnp.array(drive), jnp.array(period))
    for axis, frequency in enumerate((0.7, 0.8)):
        system = np.array([[0, 1, 0], [-(frequency**2), 0, 1], [0, 0, 0]])
        before = [state.position[axis], state.velocity[axis], drive[axis]]
        expected = expm(period * system) @ before
        np.testing.assert_allclose(after.position[axis], expected[0], rtol=1e-13)
        np.testing.assert_allclose(after.velocity[axis], expected[1], rtol=1e-13)


def test_oscillators_left_alone_stand_still_in_the_rotating_frame():
    model = InternalModel([0.7, 0.8])
    start = OscillatorState(jnp.array([1.0, -0.4]), jnp.array([0.2, 0.3]))
    later = model.advance(start, jnp.zeros(2), jnp.array(37.0))
    framed = model.integrating_factor(jnp.array(37.0)).into_frame(later)
    expected = model.frequency * start.position
    np.testing.assert_allclose(framed.position, expected, rtol=1e-13, atol=1e-13)
    np.testing.assert_allclose(framed.velocity, start.velocity, rtol=1e-13, atol=1e-13)
