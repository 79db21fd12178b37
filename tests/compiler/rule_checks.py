"""A function as machine code and interpreted, against XLA."""

import jax
import numpy as np

from jaxsat.compiler import Mapped

CASES = 37
"""No multiple of any vector's length."""


SPECIAL = np.array([np.nan, np.inf, -np.inf, 0.0, -0.0, 1e300, -1e-300, 1.0])
"""No subnormal numbers: XLA takes them as zero, machine code does not."""


def numbers(*shape, dtype=float, seed=0):
    rng = np.random.default_rng(seed)
    if np.dtype(dtype).kind == "f":
        x = rng.normal(size=(CASES, *shape))
        x.flat[:: max(1, x.size // 16)] = np.resize(SPECIAL, x.flat[:: max(1, x.size // 16)].shape)
        with np.errstate(over="ignore"):
            return x.astype(dtype)
    if np.dtype(dtype).kind == "b":
        return rng.random((CASES, *shape)) < 0.5
    return rng.integers(-9 if np.dtype(dtype).kind == "i" else 0, 9, (CASES, *shape), dtype)


def check(function, cases, shared=None, tolerance=1e-15, lanes=0):
    """Machine code and interpreter against `jax.jit(jax.vmap(...))`, in types and numbers."""
    case = jax.tree.map(lambda x: x[0], cases)
    mapped = Mapped(function, case, shared, lanes)
    expected = jax.jit(jax.vmap(lambda case: function(case, shared)))(cases)
    with np.errstate(all="ignore"):
        found = mapped(cases, shared), mapped.interpreted(cases, shared)
    for outputs in found:
        for x, y in zip(jax.tree.leaves(outputs), jax.tree.leaves(expected), strict=True):
            assert x.dtype == y.dtype
            rtol = tolerance if x.dtype.kind == "f" else 0
            rtol = max(rtol, 2e-7) if x.dtype == np.float32 and tolerance else rtol
            np.testing.assert_allclose(x, y, rtol=rtol, atol=0)
