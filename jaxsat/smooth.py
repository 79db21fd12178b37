"""Stand-ins for sat and sqrt|x|: the printed functions at width zero, smooth ones above.

All are plain arithmetic without branches on values, so one compiled program serves every width,
zero included. At width zero derivatives follow the printed function's pieces and are taken as
zero at the corner itself.
"""

import jax.numpy as jnp
from jaxtyping import Array, Float


def sat(
    x: Float[Array, "*n"], bound: Float[Array, ""], width: Float[Array, ""]
) -> Float[Array, "*n"]:
    """Saturation of (41): x up to `bound`, then sign(x) `bound`.

    `width` in [0, 1] is the part of `bound` over which the corner is rounded: 0 is the printed
    function and 1 is bound·tanh(x / bound). The two differ by at most 0.24 width·bound.
    """
    span = width * bound
    straight = bound - span
    size = jnp.abs(x)
    excess = jnp.maximum(size - straight, 0)
    rounded = span * jnp.tanh(excess / jnp.where(span > 0, span, 1.0))
    return jnp.sign(x) * (jnp.minimum(size, straight) + rounded)


def root_abs(x: Float[Array, "*n"], width: Float[Array, ""]) -> Float[Array, "*n"]:
    """√|x| of (38) as (x² + width²)^¼; `width` in the unit of x."""
    square = x**2 + width**2
    return jnp.where(square > 0, jnp.where(square > 0, square, 1.0) ** 0.25, 0.0)


def signed_root(x: Float[Array, "*n"], width: Float[Array, ""]) -> Float[Array, "*n"]:
    """sgn(x) √|x| of (38) as x / (x² + width²)^¼; `width` in the unit of x."""
    square = x**2 + width**2
    return jnp.where(square > 0, x / jnp.where(square > 0, square, 1.0) ** 0.25, 0.0)
