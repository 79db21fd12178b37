"""Indices of every type, in bounds and far beyond, by every way to read and write an element.

Where JAX makes 32-bit numbers of indices, which it does in gathers that fill, so does machine code:
an index of 2**40 is 0 there.
"""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jax import lax

from jaxsat.compiler import Mapped

SIZE = 5
MODES = ("fill", "clip")


def edges(dtype):
    """Numbers around the array's ends, the ends of 32-bit numbers and those of the type."""
    info = np.iinfo(dtype)
    centres = [0, SIZE, -SIZE, 2**31, -(2**31), 2**32, -(2**32), 2**40, -(2**40), 2**62]
    found = {centre + step for centre in centres for step in (-1, 0, 1)} | {info.min, info.max}
    return np.array(sorted(n for n in found if info.min <= n <= info.max), dtype)


def read_and_write(index, array):
    """Every way to use an index, by name."""
    new = jnp.array([7.0, 8.0])
    return {
        "index": array[index],
        "dynamic_slice": lax.dynamic_slice(array, (index,), (2,)),
        "dynamic_update_slice": lax.dynamic_update_slice(array, new, (index,)),
        "take, wrap": jnp.take(array, index, mode="wrap"),
        **{f"take, {mode}": jnp.take(array, index, mode=mode) for mode in MODES},
        **{f"get, {mode}": array.at[index].get(mode=mode) for mode in MODES},
        **{f"set, {mode}": array.at[index].set(9.0, mode=mode) for mode in MODES},
        **{f"add, {mode}": array.at[index].add(9.0, mode=mode) for mode in MODES},
        **{
            f"row, {mode}": jnp.stack([array, -array], 1).at[index].get(mode=mode) for mode in MODES
        },
    }


@pytest.mark.parametrize("dtype", ["int64", "uint64", "uint32", "int32", "int8", "uint16"])
def test_indices_of_any_size_mean_what_they_mean_to_jax(dtype):
    indices, array = edges(dtype), np.arange(1.0, SIZE + 1)
    expected = jax.jit(jax.vmap(read_and_write, (0, None)))(indices, array)
    mapped = Mapped(read_and_write, indices[0], array)
    for found in (mapped(indices, array), mapped.interpreted(indices, array)):
        for name, values in expected.items():
            np.testing.assert_array_equal(found[name], values, err_msg=name)
