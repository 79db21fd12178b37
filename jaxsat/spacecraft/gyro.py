"""A rate gyro: what it tells of the angular velocity at every sample."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxsat.core.checks import as_float, numpy_if_known, require_finite, require_positive


def _as_three(value: ArrayLike | list | tuple) -> Float[Array, "3"]:
    """One number for all axes, or one for each."""
    array = as_float(value)
    return as_float([value] * 3) if array.ndim == 0 else array


class Gyro(eqx.Module):
    """Three rate gyros along the body axes, sampled at the instants of a sampled law.

    The model is Farrenkopf's (J. Guidance and Control 1(4), 1978) in the discrete form of Crassidis
    and Junkins (Optimal Estimation of Dynamic Systems, 2nd ed., 2012, section 4.6). What is
    measured at a sample is (1 + s) (ω - m × ω) + b + n, held within ±`limit` (rad/s):

    - n is white with variance σv²/T + σu²T/12 on each axis, where T (s) is the time from sample to
      sample, σv is `noise_density` (angle random walk, rad/√s) and σu is `bias_walk` (rate random
      walk, rad/s^1.5);
    - the bias b (rad/s) moves by σu √T a sample, from `bias` plus a draw with the standard
      deviation `bias_sigma` on each axis;
    - s is `scale_factor`, the relative error on each axis, and m is `misalignment`, a small
      rotation (rad, body axes) of the three input axes.

    Raises `ValueError` for a negative density, walk or deviation, and a limit that is not positive.
    """

    noise_density: Float[Array, ""] = eqx.field(converter=as_float, default=0.0)
    bias_walk: Float[Array, ""] = eqx.field(converter=as_float, default=0.0)
    bias: Float[Array, "3"] = eqx.field(converter=_as_three, default=0.0)
    bias_sigma: Float[Array, ""] = eqx.field(converter=as_float, default=0.0)
    scale_factor: Float[Array, "3"] = eqx.field(converter=_as_three, default=0.0)
    misalignment: Float[Array, "3"] = eqx.field(converter=_as_three, default=0.0)
    limit: Float[Array, ""] = eqx.field(converter=as_float, default=jnp.inf)

    def __check_init__(self):
        for name in ("noise_density", "bias_walk", "bias_sigma"):
            require_positive(name, getattr(self, name), zero_allowed=True)
        for name in ("bias", "scale_factor", "misalignment"):
            require_finite(name, getattr(self, name))
        require_positive("limit", self.limit)

    @classmethod
    def from_table(cls, values: Mapping[str, Any]) -> "Gyro":
        """That of a checked table `[gyro]` of a scenario."""
        limit = values["limit_rad_s"]
        return cls(
            values["noise_density_rad_s_sqrt_Hz"],
            values["bias_walk_rad_s2_sqrt_Hz"],
            values["bias_rad_s"],
            values["bias_sigma_rad_s"],
            values["scale_factor"],
            values["misalignment_rad"],
            np.inf if limit is None else limit,
        )

    def rate_variance(self, period: Float[Array, ""]) -> Float[Array, ""]:
        """Variance of the white noise of one sample, (rad/s)², for samples `period` s apart."""
        _, noise, walk, period = numpy_if_known(self.noise_density, self.bias_walk, period)
        return as_float(noise**2 / period + walk**2 * period / 12)

    def first_bias(self, noise: Float[Array, "3"]) -> Float[Array, "3"]:
        """The bias at the start, rad/s, made of standard normal numbers."""
        return self.bias + self.bias_sigma * noise

    def next_bias(
        self, bias: Float[Array, "3"], noise: Float[Array, "3"], period: Float[Array, ""]
    ) -> Float[Array, "3"]:
        """The bias one sample later, rad/s."""
        return bias + self.bias_walk * jnp.sqrt(period) * noise

    def measured(
        self,
        omega: Float[Array, "3"],
        bias: Float[Array, "3"],
        noise: Float[Array, "3"],
        period: Float[Array, ""],
    ) -> Float[Array, "3"]:
        """The measured rate, rad/s, of the true ω under a bias and standard normal numbers."""
        turned = omega - jnp.cross(self.misalignment, omega)
        white = jnp.sqrt(self.rate_variance(period)) * noise
        rate = (1 + self.scale_factor) * turned + bias + white
        return jnp.minimum(jnp.maximum(rate, -self.limit), self.limit)
