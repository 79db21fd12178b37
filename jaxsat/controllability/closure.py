"""Generating vectors of the bracket closure, and their smallest singular value (the margin).

S is the smallest space that contains every J⁻¹g and is closed under
⟨x:y⟩ = J⁻¹(x^×Jy + y^×Jx) = [[f, x], y]. In three dimensions S is spanned by one fixed list:
every g, every ⟨g:g'⟩, and with h = ⟨g:g⟩ every ⟨g:h⟩ and ⟨h:h⟩. (Three independent g span;
a plane closes or grows in one round; a line grows to span{g, h} and then to span{g, h, ⟨g:h⟩,
⟨h:h⟩}, or stops.) The list is kept in torque space (p = Jx) with unit g and relative products, so
neither the unit of inertia nor the length of a torque axis changes a number.
"""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.core.array_types import Matrix, RealScalar, Vector
from jaxsat.spacecraft.spacecraft import adjugate


def _length(vector: Vector) -> RealScalar:
    """Return the norm, with derivative zero, not NaN, at the zero vector."""
    square = vector @ vector
    positive = square > 0
    return jnp.where(positive, jnp.sqrt(jnp.where(positive, square, 1.0)), 0.0)


def _ratio(vector: Vector, size: RealScalar) -> Vector:
    positive = size > 0
    return jnp.where(positive, vector / jnp.where(positive, size, 1.0), 0.0)


def relative_product(inverse: Matrix, p: Vector, q: Vector) -> Vector:
    """Return J⟨J⁻¹p : J⁻¹q⟩ / (|J⁻¹p||q| + |J⁻¹q||p|), of length at most 1 (p, q torques)."""
    x, y = inverse @ p, inverse @ q
    product = -(jnp.cross(x, q) + jnp.cross(y, p))
    return _ratio(product, _length(x) * _length(q) + _length(y) * _length(p))


def generator_names(count: int, labels: tuple[str, ...] | None = None) -> tuple[str, ...]:
    """Return bracket names in the order of `generating_vectors`, for `count` thrusters."""
    g = labels if labels is not None else tuple(f"g{i + 1}" for i in range(count))
    pairs = itertools.combinations_with_replacement(range(count), 2)
    h = [f"[[f,{name}],{name}]" for name in g]
    return (
        *g,
        *(f"[[f,{g[i]}],{g[j]}]" for i, j in pairs),
        *(f"[[f,{a}],{b}]" for a, b in zip(g, h, strict=True)),
        *(f"[[f,{b}],{b}]" for b in h),
    )


def generating_vectors(inertia: Matrix, torque_axes: Float[Array, "3 m"]) -> Float[Array, "3 k"]:
    """Return the spanning list of J S, normalised: m + m(m+1)/2 + 2m columns of length at most 1.

    `inertia` in any unit, symmetric positive definite; `torque_axes` of any lengths, a zero column
    giving zero columns. ⟨g:h⟩ and ⟨h:h⟩ carry the relative size of h, which makes every column (and
    so every singular value) a Lipschitz function of the layout. Pure JAX for jit, vmap and
    derivatives; the precision is that of the arguments.
    """
    inertia = inertia / jnp.max(jnp.abs(inertia))
    inverse = adjugate(inertia)
    inverse = inverse / jnp.max(jnp.abs(inverse))
    count = torque_axes.shape[1]
    scale = jnp.max(jnp.abs(torque_axes), axis=0, keepdims=True)
    scaled_axes = torque_axes / jnp.where(scale > 0, scale, 1.0)
    product = jax.vmap(relative_product, (None, 0, 0))
    lengths, ratios = jax.vmap(_length), jax.vmap(_ratio)
    axes = ratios(scaled_axes.T, lengths(scaled_axes.T))
    first, other = np.triu_indices(count)  # pairs in the order of `generator_names`
    products = product(inverse, axes[first], axes[other])
    own = products[first == other]
    sizes = lengths(own)
    units = ratios(own, sizes)
    second = sizes[:, None] * product(inverse, axes, units)
    third = sizes[:, None] * product(inverse, units, units)
    return jnp.concatenate([axes, products, second, third]).T


def _rotate(
    a: Float[Array, " k"], b: Float[Array, " k"]
) -> tuple[Float[Array, " k"], Float[Array, " k"]]:
    """Make two rows orthogonal by a plane rotation (one-sided Jacobi)."""
    alpha, beta, gamma = a @ a, b @ b, a @ b
    active = jnp.abs(gamma) > 0
    tau = (beta - alpha) / (2.0 * jnp.where(active, gamma, 1.0))
    sign = jnp.where(tau >= 0, 1.0, -1.0)
    # Written to survive a huge tau: t -> 1 / (2 tau) without squaring an overflow.
    large = jnp.abs(tau) > 1e6
    safe = jnp.where(large, 1.0, tau)
    root = jnp.where(large, jnp.abs(tau), jnp.sqrt(1.0 + safe * safe))
    tangent = jnp.where(active, sign / (jnp.abs(tau) + root), 0.0)
    cosine = 1.0 / jnp.sqrt(1.0 + tangent * tangent)
    return cosine * (a - tangent * b), cosine * (b + tangent * a)


def singular_values(vectors: Float[Array, "3 k"]) -> Vector:
    """Compute the three singular values, largest first, by six sweeps of one-sided Jacobi.

    Without LAPACK: a map over 10⁵ layouts is one loop, and a small value keeps its absolute
    accuracy (it is not squared).
    """

    def sweep(_, rows):
        a, b, c = rows
        a, b = _rotate(a, b)
        a, c = _rotate(a, c)
        b, c = _rotate(b, c)
        return a, b, c

    rows = jax.lax.fori_loop(0, 6, sweep, (vectors[0], vectors[1], vectors[2]))
    values = [jnp.sqrt(row @ row) for row in rows]
    largest = jnp.maximum(jnp.maximum(values[0], values[1]), values[2])
    smallest = jnp.minimum(jnp.minimum(values[0], values[1]), values[2])
    middle = jnp.maximum(
        jnp.maximum(jnp.minimum(values[0], values[1]), jnp.minimum(values[0], values[2])),
        jnp.minimum(values[1], values[2]),
    )
    return jnp.stack([largest, middle, smallest])


def controllability_margin(inertia: Matrix, torque_axes: Float[Array, "3 m"]) -> RealScalar:
    """Return the smallest singular value of the generating vectors: 0 on the uncontrollable set.

    Pure JAX, for maps; `analyse` returns the same number with the exact decision. Parallel
    columns count twice here (at most a factor √2 for a pair), once in `analyse`.
    """
    return singular_values(generating_vectors(inertia, torque_axes))[2]
