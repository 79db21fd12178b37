"""How a random program is written: step by step, each of what there is already.

Floats lie on a grid so coarse that sums and products of a few are exact, whether they are fused or
not, and what is rounded comes back to it (`tame`). All results can therefore be compared bit for
bit.
"""

from collections.abc import Callable, Sequence

import jax
import jax.numpy as jnp
import numpy as np
from jax import lax

FLOATS = ("float64", "float32")
SIGNED = ("int8", "int16", "int32", "int64")
UNSIGNED = ("uint8", "uint16", "uint32", "uint64")
TYPES = (*FLOATS, *FLOATS, *SIGNED, *UNSIGNED, "bool")

Choice = tuple[Sequence[Callable], Sequence[Callable]]
"""Steps that a writer may take, plain and nested; a step is a function of the writer."""


def tame(x: jax.Array) -> jax.Array:
    """Eighths up to 64, rounded where no simple number is halfway; NaN and infinities stay."""
    near = jnp.clip(jnp.floor(x * 8 + 0.3) / 8, -64, 64)
    return jnp.where(jnp.isfinite(x), near, x)


class Writer:
    """Writes one block of a program with its own random choices of steps, plain and nested.

    Nests are two deep at most, their blocks of two steps at most: no program is large.
    """

    def __init__(self, seed: int, pool: Sequence[jax.Array], choice: Choice, depth: int = 0):
        self.rng = np.random.default_rng(seed)
        self.pool: list[jax.Array] = list(pool)
        self.choice = choice
        self.depth = depth

    def one_of(self, several: Sequence):
        return several[int(self.rng.integers(len(several)))]

    def below(self, number: int) -> int:
        return int(self.rng.integers(number))

    def seed(self) -> int:
        return self.below(2**31)

    def any(self, types: Sequence[str] = TYPES, shape: tuple[int, ...] | None = None) -> jax.Array:
        """Something that there is already, new things more often, as one of these types."""
        i = len(self.pool) - 1 - min(self.below(len(self.pool)), self.below(len(self.pool)))
        x = self.pool[i]
        if x.dtype.name not in types:
            x = as_type(x, self.one_of(types))
        return x if shape is None else shaped(x, shape)

    def pair(self, types: Sequence[str]) -> tuple[jax.Array, jax.Array]:
        x = self.any(types)
        return x, self.like(x)

    def like(self, x: jax.Array) -> jax.Array:
        y = self.any((x.dtype.name,), x.shape)
        if self.below(6) == 0:
            y = jnp.full(x.shape, self.constant(x.dtype.name), x.dtype)
        return y

    def constant(self, name: str):
        dtype = np.dtype(name)
        if dtype.kind == "f":
            return self.one_of([0.0, -0.0, 1.0, -1.0, 0.5, 2.0, -3.25, np.inf, np.nan])
        if dtype.kind == "b":
            return bool(self.below(2))
        info = np.iinfo(dtype)
        return self.one_of([0, 1, 2, 3, info.min, info.max, info.max // 2, max(info.min, -1)])

    def index(self) -> jax.Array:
        """A number of any integer type, in range mostly."""
        x = self.any((*SIGNED, *UNSIGNED), ())
        return x % 7 - (self.below(3) if x.dtype.name in SIGNED else 0) if self.below(3) else x

    def truth(self) -> jax.Array:
        return self.any(("bool",), ())

    def vector(self, types: Sequence[str] = TYPES) -> jax.Array:
        return self.any(types, self.one_of([(3,), (5,), (4,)]))

    def write(self, steps: int) -> None:
        """So many steps, each of which adds what it gives."""
        for _ in range(steps):
            nests = self.below(3 + 7 * self.depth) == 0 and self.depth < 2
            plain, nested = self.choice
            found = self.one_of(nested if nests else plain)(self)
            self.pool += [jnp.asarray(x) for x in jax.tree.leaves(found)][-3:]

    def block(self, steps: int, wanted: Sequence[jax.Array]) -> Callable[..., list[jax.Array]]:
        """A function of further values that gives new ones of the same kinds as `wanted`."""
        seed, outer, depth = self.seed(), list(self.pool), self.depth + 1
        choice = self.choice

        def function(*values) -> list[jax.Array]:
            inner = Writer(seed, [*outer, *jax.tree.leaves(values)], choice, depth)
            inner.write(steps)
            return [inner.any((x.dtype.name,), x.shape) for x in wanted]

        return function


def as_type(x: jax.Array, name: str) -> jax.Array:
    """Another type, on the grid."""
    y = x.astype(name)
    return tame(y) if name in FLOATS else y


def shaped(x: jax.Array, shape: tuple[int, ...]) -> jax.Array:
    """The elements in another shape, from the first again where there are too few."""
    size = int(np.prod(shape))
    if not x.shape:
        return lax.broadcast(x, shape)
    flat = lax.reshape(x, (x.size,))
    if size > x.size:
        flat = lax.concatenate([flat] * (-(-size // x.size)), 0)
    return lax.reshape(lax.slice(flat, (0,), (size,)), shape)
