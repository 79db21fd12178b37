"""What a sampled controller is told of the momenta of reaction wheels."""

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree, UInt32

from jaxsat.core.checks import as_float, require_positive
from jaxsat.core.noise import fold_in, name_number, sample_noise
from jaxsat.spacecraft.sensors import as_key
from jaxsat.spacecraft.wheels import WheelMomenta


class Tachometers(eqx.Module):
    """White Gaussian noise on the momentum that each wheel's tachometer tells, at each sample.

    `noise` (N m s) is the standard deviation for each wheel. It is a function of `key` (two 32-bit
    words, which other sensors may share) and of the sample's number.
    """

    noise: Float[Array, " wheels"] = eqx.field(converter=as_float)
    key: UInt32[Array, "2"] = eqx.field(converter=as_key, default=(0, 0))

    def __check_init__(self):
        require_positive("noise", self.noise, zero_allowed=True)

    def __call__(self, sample: Int[Array, ""], effectors: PyTree) -> PyTree:
        """States of effectors with the momenta of wheels as they are measured, N m s."""
        own = fold_in(self.key, jnp.asarray(name_number("tachometers"), jnp.uint32))

        def measured(state: PyTree) -> PyTree:
            if not isinstance(state, WheelMomenta):
                return state
            momentum = state.momentum
            noise = sample_noise(own, sample, momentum.shape[0], momentum.dtype)
            return WheelMomenta(momentum + self.noise * noise)

        return tuple(measured(state) for state in effectors)
