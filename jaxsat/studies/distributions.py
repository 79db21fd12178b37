"""Probability distributions by their quantile functions, for any design of points."""

import abc
from typing import ClassVar

import equinox as eqx
import jax
import jax.numpy as jnp
import jax.scipy
import numpy as np
from jaxtyping import Array, Float

from jaxsat.core.array_types import Vector
from jaxsat.core.checks import (
    as_float,
    concrete,
    finite,
    not_negative,
    require_finite,
    require_positive,
)
from jaxsat.core.errors import ArgumentError

MAX_STANDARD_DEVIATIONS = 1e9
"""Largest distance of a bound from the mean, in standard deviations, before round-off dominates."""

FAR = 37.0
"""Standard deviations from the mean beyond which a Gaussian's share rounds to zero."""

MIN_WEIGHT_SUM, MAX_WEIGHT_SUM = 1e-30, 1e30
"""Sums of weights that keep every normalised weight finite."""


class AbstractProbabilityDistribution(eqx.Module):
    """A distribution of independent components.

    Parameters are one number for all components or one for each.
    """

    end_names: ClassVar[tuple[str, ...]] = ("low", "high")
    """Names of the parameters in `ends`."""

    @abc.abstractmethod
    def quantile(self, u: Float[Array, " dimension"]) -> Float[Array, " size"]:
        """Values at coordinates `u` in the open unit cube."""

    def ends(self) -> dict[str, Float[Array, "*n"]]:
        """Parameters, by name, that locate the range of draws: see `is_bounded`."""
        return {name: getattr(self, name) for name in self.end_names}

    def is_bounded(self) -> bool:
        """Whether all draws lie between the smallest and the largest of `ends`."""
        return True

    def components(self) -> int | None:
        """Number of components of the parameters; None if any number is valid."""
        return _components(*jax.tree.leaves(self))

    def dimension(self, size: int) -> int:
        """Number of unit coordinates for `size` components."""
        return size


class Uniform(AbstractProbabilityDistribution):
    """Uniform distribution between `low` and `high`."""

    low: Float[Array, "*n"] = eqx.field(converter=finite("low"))
    high: Float[Array, "*n"] = eqx.field(converter=finite("high"))

    def __check_init__(self):
        _require_order(self.low, self.high)

    def quantile(self, u: Float[Array, " size"]) -> Float[Array, " size"]:
        """Values low + (high - low) u."""
        return self.low + (self.high - self.low) * u


class Normal(AbstractProbabilityDistribution):
    """Gaussian with `mean` and standard deviation `sigma`."""

    end_names = ("mean",)
    mean: Float[Array, "*n"] = eqx.field(converter=finite("mean"))
    sigma: Float[Array, "*n"] = eqx.field(converter=as_float)

    def __check_init__(self):
        require_finite("sigma", self.sigma)
        require_positive("sigma", self.sigma, zero_allowed=True)

    def quantile(self, u: Float[Array, " size"]) -> Float[Array, " size"]:
        """Gaussian quantile."""
        return self.mean + self.sigma * jax.scipy.special.ndtri(u)

    def is_bounded(self) -> bool:
        """False: a Gaussian has tails."""
        return False


class TruncatedNormal(AbstractProbabilityDistribution):
    """Gaussian with `mean` and `sigma` before truncation to [`low`, `high`]."""

    mean: Float[Array, "*n"] = eqx.field(converter=finite("mean"))
    sigma: Float[Array, "*n"] = eqx.field(converter=as_float)
    low: Float[Array, "*n"] = eqx.field(converter=finite("low"))
    high: Float[Array, "*n"] = eqx.field(converter=finite("high"))

    def __check_init__(self):
        require_finite("sigma", self.sigma)
        require_positive("sigma", self.sigma)
        _require_order(self.low, self.high)
        self._require_width()

    def _require_width(self) -> None:
        numbers = (concrete(x) for x in (self.mean, self.sigma, self.low, self.high))
        parameters = [number for number in numbers if number is not None]
        if len(parameters) < 4:
            return
        _components(*parameters)  # raises if they cannot be broadcast
        mean, sigma, low, high = np.broadcast_arrays(*parameters)
        if np.any(np.maximum(abs(low - mean), abs(high - mean)) > MAX_STANDARD_DEVIATIONS * sigma):
            share = f"{1 / MAX_STANDARD_DEVIATIONS:g} of the distance from the mean"
            raise ArgumentError(
                "sigma", f"must be at least {share} to either bound", sigma.tolist()
            )

    def quantile(self, u: Float[Array, " size"]) -> Float[Array, " size"]:
        """Quantile in the lower half of the Gaussian, whose tail keeps full precision."""
        low, high = (self.low - self.mean) / self.sigma, (self.high - self.mean) / self.sigma
        mirrored = low + high > 0
        lower = jnp.where(mirrored, -high, low)
        upper = jnp.where(mirrored, -low, high)
        u = jnp.where(mirrored, 1 - u, u)
        below, above = jax.scipy.special.ndtr(lower), jax.scipy.special.ndtr(upper)
        x = jnp.clip(jax.scipy.special.ndtri(below + u * (above - below)), lower, upper)
        x = jnp.where(upper < -FAR, _far_out(lower, upper, u), x)
        return self.mean + self.sigma * jnp.where(mirrored, -x, x)


def _far_out(
    lower: Float[Array, "*n"], upper: Float[Array, "*n"], u: Float[Array, " size"]
) -> Float[Array, " size"]:
    """Quantile of a standard Gaussian between two bounds below -`FAR`.

    There Φ(-s) is φ(s) / s but for a share of 1 / s². With that, s² = a² - 2 log(w s / a) for the
    part w that is beyond s of what is beyond a.
    """
    near, far = jnp.maximum(-upper, FAR), jnp.maximum(-lower, FAR)
    beyond = near / far * jnp.exp((near - far) * (near + far) / 2)
    more, size = -2 * jnp.log(beyond + u * (1 - beyond)), near
    for _ in range(3):
        size = jnp.minimum(jnp.sqrt(near**2 + more - 2 * jnp.log(size / near)), far)
    return jnp.clip(-size, lower, upper)


class Discrete(AbstractProbabilityDistribution):
    """Components drawn from `values`, with probabilities in proportion to `weights`.

    Both are one list for all components, or one for each, all of one length.
    """

    end_names = ("values",)
    values: Float[Array, "*size k"] = eqx.field(converter=finite("values"))
    weights: Float[Array, "*size k"] = eqx.field(converter=not_negative("weights"))

    def __check_init__(self):
        shape = np.shape(self.values)
        if np.shape(self.weights) != shape:
            rule = f"must have {' x '.join(map(str, shape))} entries like `values`"
            raise ArgumentError("weights", rule, np.size(self.weights))
        weights = concrete(self.weights)
        if weights is None:
            return
        for total in np.atleast_1d(weights.sum(axis=-1)):
            if not MIN_WEIGHT_SUM < total < MAX_WEIGHT_SUM:
                rule = f"must have a sum from {MIN_WEIGHT_SUM:g} to {MAX_WEIGHT_SUM:g}"
                raise ArgumentError("weights", rule, f"{float(total):g}")

    def quantile(self, u: Float[Array, " size"]) -> Float[Array, " size"]:
        """Value whose share of the unit interval contains u."""
        shares = self.weights / jnp.sum(self.weights, axis=-1, keepdims=True)
        bounds = jnp.atleast_2d(jnp.cumsum(shares, axis=-1)[..., :-1])
        place = jnp.sum(u[:, None] >= bounds, axis=1)
        if self.values.ndim == 1:
            return self.values[place]
        return jnp.take_along_axis(self.values, place[:, None], axis=1)[:, 0]

    def components(self) -> int | None:
        """Number of lists of values; None for one list, which suits any number of components."""
        return len(self.values) if self.values.ndim == 2 else None


class RandomAttitude(AbstractProbabilityDistribution):
    """Rotations uniform over SO(3), as unit quaternions, scalar first.

    K. Shoemake, Uniform random rotations, Graphics Gems III, 1992.
    """

    end_names = ()

    def quantile(self, u: Vector) -> Float[Array, "4"]:
        """Quaternion of three unit coordinates."""
        near, far = jnp.sqrt(1 - u[0]), jnp.sqrt(u[0])
        first, second = 2 * jnp.pi * u[1], 2 * jnp.pi * u[2]
        return jnp.stack(
            [
                near * jnp.sin(first),
                near * jnp.cos(first),
                far * jnp.sin(second),
                far * jnp.cos(second),
            ]
        )

    def components(self) -> int | None:
        """The four components of a quaternion."""
        return 4

    def dimension(self, size: int) -> int:
        """Three unit coordinates for the four components."""
        return 3


def _components(*parameters: Float[Array | np.ndarray, "..."]) -> int | None:
    shapes = {np.shape(parameter) for parameter in parameters} - {()}
    if len(shapes) > 1 or any(len(shape) > 1 for shape in shapes):
        rule = "must have parameters that are numbers or lists of one length"
        raise ArgumentError("distribution", rule, f"shapes {sorted(shapes)}")
    return shapes.pop()[0] if shapes else None


def _require_order(low, high) -> None:
    _components(low, high)
    below, above = concrete(low), concrete(high)
    if below is not None and above is not None and not np.all(below <= above):
        bounds = f"{below.tolist()} and {above.tolist()}"
        raise ArgumentError("low", "must not exceed `high`", bounds)
