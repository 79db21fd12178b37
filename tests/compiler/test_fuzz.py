"""Random programs: the compiled engine and its interpreter against `jax.jit`, bit for bit."""

import jax
import numpy as np
import pytest
from hypothesis import HealthCheck, Phase, given, settings
from hypothesis import strategies as st

from compiler.random_programs import KINDS, SIZE, newest, programs, run
from jaxsat.compiler.llvm.mapped import Mapped

CASES = 37
# A failing program is not shrunk, for every try compiles: add `Phase.shrink` to study one.
SETTINGS = {
    "deadline": None,
    "suppress_health_check": list(HealthCheck),
    "derandomize": True,
    "phases": [Phase.explicit, Phase.generate],
}


def _cases(seed: int) -> dict[str, np.ndarray]:
    """Inputs of many cases, NaN and infinities among them, and of bits of all sizes."""
    rng = np.random.default_rng(seed)
    floats = rng.integers(-40, 40, (CASES, 2 + SIZE)) / 4.0
    rare = rng.choice([np.nan, np.inf, -np.inf, 1024.0, -0.0], floats.shape)
    floats = np.where(rng.random(floats.shape) < 0.15, rare, floats)
    whole = rng.integers(-(2**31), 2**31, (CASES, 2))
    small = rng.integers(-3, 9, (CASES, 2))
    integers = np.where(rng.random((CASES, 2)) < 0.3, whole, small)
    return {
        "f": floats[:, :2],
        "v": floats[:, 2:],
        "i": integers.astype(np.int32),
        "u": rng.integers(0, 2**32, (CASES, 1)).astype(np.uint32),
        "l": rng.integers(-(2**63), 2**63, (CASES, 1)),
        "b": rng.random((CASES, 1)) < 0.5,
    }


SHARED = {"f": np.array([1.5]), "i": np.array([3], np.int32), "b": np.array([True])}


def _function(program):
    """The program as a function of one case and of numbers that all cases share."""

    def function(case, shared):
        pool = {kind: [] for kind in KINDS}
        for source in (shared, case):
            for kind, values in source.items():
                pool[kind] += [values] if kind == "v" else [values[i] for i in range(len(values))]
        return newest(run(program, pool))

    return function


def _check(program, seed: int) -> None:
    cases, function = _cases(seed), _function(program)
    expected = jax.jit(jax.vmap(function, (0, None)))(cases, SHARED)
    one = jax.tree.map(lambda leaf: leaf[0], cases)
    mapped = Mapped(function, one, SHARED)
    for found in (mapped(cases, SHARED), mapped.interpreted(cases, SHARED)):
        for kind in KINDS:
            np.testing.assert_array_equal(found[kind], expected[kind], err_msg=kind)
    _check_companions(mapped, cases)


def _check_companions(mapped: Mapped, cases: dict[str, np.ndarray]) -> None:
    """NaN and infinity in some cases change no bit of any other."""
    clean = {kind: np.nan_to_num(x, posinf=3, neginf=-7) if x.dtype == float else x
             for kind, x in cases.items()}  # fmt: skip
    dirty = {kind: x.copy() for kind, x in clean.items()}
    for kind in "fv":
        dirty[kind][3::8], dirty[kind][5::8] = np.nan, np.inf
    others = ~np.isin(np.arange(CASES) % 8, (3, 5))
    for x, y in zip(*(jax.tree.leaves(mapped(c, SHARED)) for c in (clean, dirty)), strict=True):
        assert x[others].tobytes() == y[others].tobytes()


@pytest.mark.slow
@given(programs, st.integers(0, 9))
@settings(max_examples=40, **SETTINGS)
def test_many_random_programs(program, seed):
    _check(program, seed)
