"""Random programs by their numbers: what is written depends on a seed alone, not on any value."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
import numpy as np

from compiler.program_nests import NESTED
from compiler.program_steps import PLAIN
from compiler.program_writer import TYPES, Writer


def program(seed: int, steps: int = 4) -> Callable[[dict, dict], list[jax.Array]]:
    """The program of a seed: a function of one case and of what all cases share."""

    def function(case: dict, shared: dict) -> list[jax.Array]:
        first = [jnp.asarray(x) for x in (*jax.tree.leaves(shared), *jax.tree.leaves(case))]
        writer = Writer(seed, first, (PLAIN, NESTED))
        writer.write(steps)
        return writer.pool[len(first) :]

    return function


def inputs(count: int, seed: int = 0) -> tuple[dict, dict]:
    """Inputs of many cases, and of all: grid points, ends of types, NaN and infinities."""
    rng = np.random.default_rng(seed)

    def numbers(name: str, *shape: int) -> np.ndarray:
        dtype = np.dtype(name)
        if dtype.kind == "b":
            return rng.random(shape) < 0.5
        rare = rng.random(shape) < 0.15
        if dtype.kind == "f":
            usual = rng.integers(-80, 80, shape) / 8
            odd = rng.choice([np.nan, np.inf, -np.inf, 0.0, -0.0, 64.0], shape)
            return np.where(rare, odd, usual).astype(dtype)
        info = np.iinfo(dtype)
        ends = rng.choice(np.array([info.min, info.max, info.max // 2 + 1], dtype), shape)
        low = -9 if dtype.kind == "i" else 0
        return np.where(rare, ends, rng.integers(low, 12, shape).astype(dtype))

    shapes = {"float64": (4,), "float32": (2,)}
    case = {name: numbers(name, count, *shapes.get(name, ())) for name in dict.fromkeys(TYPES)}
    shared = {name: numbers(name) for name in ("float64", "int32", "bool")}
    return case, {name: np.asarray(x) for name, x in shared.items()}
