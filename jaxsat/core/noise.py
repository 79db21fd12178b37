"""Random numbers as a pure function of key data and counters, for use inside simulation loops.

The generator is Threefry-2x32 with 20 rounds (Salmon, Moraes, Dror, Shaw, SC11, 2011), written out
in plain integer arithmetic. A key is two unsigned 32-bit words, the `jax.random.key_data` of a
Threefry key; bits and numbers equal those of `jax.random` for the same key, so studies can be
reproduced with either. No loop carries a typed key or a generator state.
"""

import hashlib
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float, UInt, UInt32
from numpy.typing import DTypeLike

from jaxsat.core.array_types import IntScalar
from jaxsat.core.checks import as_array

Key = UInt32[Array, "2"]

if TYPE_CHECKING:
    Words = Any  # type checkers know no operations of either
else:
    Words = UInt32[Array | np.ndarray, "..."]

_ROTATIONS = ((13, 15, 26, 6), (17, 29, 16, 24))
_PARITY = 0x1BD11BDA


def key_of_seed(seed: int) -> Key:
    """Return the key of a study: a seed of up to 64 bits as two words.

    Raises `ValueError` for a seed that is negative or needs more bits.
    """
    if not 0 <= seed < 2**64:
        raise ValueError(f"Argument `seed` must be from 0 to 2^64 - 1, but got {seed}.")
    return as_array(np.array([seed >> 32, seed & 0xFFFFFFFF], np.uint32))


def name_number(name: str) -> int:
    """Return 32 bits that identify a name, the same on every machine."""
    return int.from_bytes(hashlib.sha256(name.encode()).digest()[:4], "big")


def fold_in(key: Key, number: ArrayLike) -> Key:
    """Return a distinct key for every `number` (one 32-bit word), as `jax.random.fold_in`."""
    word = jnp.asarray(number).astype(jnp.uint32)
    return jnp.stack(threefry(key, jnp.zeros_like(word), word))


def bits(key: Key, count: int, width: int = 32) -> UInt[Array, " count"]:
    """Return `count` words of random bits; `width` is 32 or 64."""
    low = jnp.arange(count, dtype=jnp.uint32)
    first, second = threefry(key, jnp.zeros_like(low), low)
    if width == 32:
        return first ^ second
    return (first.astype(jnp.uint64) << np.uint64(32)) | second.astype(jnp.uint64)


def uniform(key: Key, count: int, dtype: DTypeLike = float) -> Float[Array, " count"]:
    """Return `count` numbers from [0, 1), each a multiple of the type's spacing below 1."""
    dtype = jax.dtypes.canonicalize_dtype(dtype)
    info = jnp.finfo(dtype)
    mantissa = bits(key, count, info.bits) >> np.array(info.bits - info.nmant, f"uint{info.bits}")
    one = np.array(1.0, dtype).view(f"uint{info.bits}")
    return jax.lax.bitcast_convert_type(mantissa | one, dtype) - np.array(1.0, dtype)


def standard_normal(key: Key, count: int, dtype: DTypeLike = float) -> Float[Array, " count"]:
    """Return `count` draws from the standard normal distribution."""
    dtype = jax.dtypes.canonicalize_dtype(dtype)
    above_minus_one = np.nextafter(np.array(-1.0, dtype), np.array(0.0, dtype))
    span = np.array(1.0, dtype) - above_minus_one
    centred = jnp.maximum(above_minus_one, uniform(key, count, dtype) * span + above_minus_one)
    return jax.lax.erf_inv(centred) * np.array(np.sqrt(2.0), dtype)


def sample_noise(
    key: Key, sample: IntScalar, count: int, dtype: DTypeLike = float
) -> Float[Array, " count"]:
    """Return the standard normal noise of one sample: a function of key and sample number."""
    return standard_normal(fold_in(key, sample), count, dtype)


def threefry(key: Words | Sequence[Words], first: Words, second: Words) -> tuple[Words, Words]:
    """Compute Threefry-2x32-20 of the counters `first` and `second`: two words of random bits each.

    Takes JAX arrays, or NumPy arrays alone, with the same result.
    """
    words = (key[0], key[1], key[0] ^ key[1] ^ np.uint32(_PARITY))
    first, second = first + words[0], second + words[1]
    for group in range(5):
        for rotation in _ROTATIONS[group % 2]:
            first = first + second
            second = (second << np.uint32(rotation)) | (second >> np.uint32(32 - rotation))
            second = first ^ second
        first = first + words[(group + 1) % 3]
        second = second + words[(group + 2) % 3] + np.uint32(group + 1)
    return first, second
