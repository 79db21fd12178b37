"""Generated programs: machine code and interpreter against `jax.jit(jax.vmap(...))`, bit for bit.

Many programs are compiled as one, XLA's without what takes its compiler longest: compiling is
nearly all the time there is. Any others are run, and those told which differ, by
`PYTHONPATH=tests python tests/compiler/test_generated_programs.py FIRST COUNT`.
"""

import functools
import sys

import jax
import numpy as np
import pytest

from compiler.program_generator import inputs, program
from jaxsat.compiler import Mapped

CASES = 21
CHEAPLY = {
    "xla_backend_optimization_level": 0,
    "xla_llvm_disable_expensive_passes": True,
    "xla_cpu_use_fusion_emitters": False,
}


def differing(seeds: range) -> list[str]:
    """Programs of which some result differs, and how."""
    case, shared = inputs(CASES, seeds.start)

    def all_of_them(case, shared):
        return {seed: program(seed)(case, shared) for seed in seeds}

    mapped = Mapped(all_of_them, jax.tree.map(lambda x: x[0], case), shared)
    reference = jax.jit(jax.vmap(all_of_them, (0, None)), compiler_options=CHEAPLY)
    expected = jax.tree.map(np.asarray, reference(case, shared))
    with np.errstate(all="ignore"):
        found = {
            "compiled": mapped(case, shared),
            "interpreted": mapped.interpreted(case, shared),
        }
    return [
        f"program {seed}, value {i}, {how}: {x.dtype} {x.shape[1:]}"
        for how, by_seed in found.items()
        for seed, values in expected.items()
        for i, (x, y) in enumerate(zip(by_seed[seed], values, strict=True))
        if not _same(x, y) and not _same(x, _by_operations(seed, seeds.start)[i])
    ]


@functools.lru_cache(maxsize=4)
def _by_operations(seed: int, first: int) -> list[np.ndarray]:
    """A program's values, one operation after the other.

    What XLA makes of a whole program may round otherwise: it multiplies by the reciprocal of a
    number that many are divided by.
    """
    values = jax.vmap(program(seed), (0, None))(*inputs(CASES, first))
    return [np.asarray(value) for value in values]


def _same(x: np.ndarray, y: np.ndarray) -> bool:
    """Equal types and numbers, NaN with NaN, zeros with their signs."""
    if x.dtype != y.dtype or x.shape != y.shape:
        return False
    if x.dtype.kind != "f":
        return bool(np.array_equal(x, y))
    equal = (x == y) & (np.signbit(x) == np.signbit(y))
    return bool(np.all(equal | (np.isnan(x) & np.isnan(y))))


@pytest.mark.slow
@pytest.mark.parametrize("first", range(0, 180, 20))
def test_generated_programs(first):
    assert differing(range(first, first + 20)) == []


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    jax.config.update("jax_numpy_rank_promotion", "raise")
    begin, count = map(int, sys.argv[1:3])
    for start in range(begin, begin + count, 20):
        print(start, differing(range(start, min(start + 20, begin + count))), flush=True)
