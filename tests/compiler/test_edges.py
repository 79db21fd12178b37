"""Every rule at the edges of every type: variable, uniform, constant, interpreted, against XLA.

XLA takes subnormal numbers as zero when it runs and as they are when it folds constants; machine
code takes them as they are, so there NumPy is the reference. Integer divisors and shifts are never
given to XLA as constants: it divides by zero then, which ends the process.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import cache

import jax
import numpy as np
import pytest

from compiler.edge_programs import ALIASES, LENGTH, PROGRAMS, Use
from compiler.edge_table import ELEMENTWISE, ULPS, XLA_ULPS, Edge
from compiler.edge_values import ALL, MISSING, edge_pairs, edge_values
from helpers.compiling import fully_optimised
from jaxsat.compiler import Mapped
from jaxsat.compiler.builder import Builder
from jaxsat.compiler.lowering import RULES, as_elements, lower
from jaxsat.core.jaxprs import jaxpr_of

QUICK = ("float64", "int32", "bool")
TYPES = [
    pytest.param(dtype, id=str(dtype), marks=() if dtype.name in QUICK else pytest.mark.slow)
    for dtype in ALL
]
"""Every type, those beyond the quick ones in the slow checks."""

Edges = dict[str, Edge]


def _edges(dtype: np.dtype, arity: int) -> Edges:
    found = {f"{name} {i}": edge for name, edges in ELEMENTWISE.items()
             for i, edge in enumerate(edges)}  # fmt: skip
    return {name: e for name, e in found.items() if e.arity == arity and dtype in e.dtypes}


def _arguments(edge: Edge, dtype: np.dtype) -> tuple[np.ndarray, ...]:
    return (edge_values(dtype),) if edge.arity == 1 else edge_pairs(dtype, edge.second)


def _subnormal(*arrays: np.ndarray) -> np.ndarray:
    """Where any number is subnormal, or the least normal one that XLA may round to zero."""
    found = np.zeros(np.shape(arrays[-1]), bool)
    for x in map(np.asarray, arrays):
        if x.dtype.kind == "f":
            found |= (x != 0) & (np.abs(x) <= np.finfo(x.dtype).smallest_normal)
    return found


@dataclass(frozen=True)
class Reference:
    """What a use of a primitive gives for all edge values: by XLA, and by NumPy where close."""

    arguments: tuple[np.ndarray, ...]
    expected: np.ndarray
    rounded: np.ndarray | None

    def at(self, places: np.ndarray | slice) -> "Reference":
        rounded = None if self.rounded is None else self.rounded[places]
        arguments = tuple(x[places] for x in self.arguments)
        return Reference(arguments, self.expected[places], rounded)


@cache
def _references(dtype: np.dtype, arity: int) -> dict[str, Reference]:
    edges = _edges(dtype, arity)
    arguments = {name: _arguments(edge, dtype) for name, edge in edges.items()}
    by_xla = fully_optimised(
        lambda given: {name: (e.xla or e.function)(*given[name]) for name, e in edges.items()}
    )(arguments)
    return {
        name: _reference(edge, arguments[name], np.array(by_xla[name]))
        for name, edge in edges.items()
    }


def _reference(edge: Edge, arguments: tuple[np.ndarray, ...], found: np.ndarray) -> Reference:
    rounded = None
    with np.errstate(all="ignore"):
        if edge.ieee is not None:
            exact = np.asarray(edge.ieee(*arguments)).astype(found.dtype)
            tiny = _subnormal(*arguments, exact, found)
            found[tiny] = exact[tiny]
        if edge.close and edge.ieee is not None and found.dtype.kind == "f":
            wide = [x.astype(float) for x in arguments]
            rounded = np.asarray(edge.ieee(*wide)).astype(found.dtype)
    return Reference(arguments, found, rounded)


def _same(found: np.ndarray, expected: np.ndarray, ulps: int) -> np.ndarray:
    """Where numbers agree: NaN with NaN, zeros with their signs, others within `ulps`."""
    if expected.dtype.kind != "f":
        return found == expected
    with np.errstate(all="ignore"):
        near = np.abs(found - expected) <= ulps * np.spacing(np.abs(expected))
    finite = np.isfinite(found) & np.isfinite(expected)
    same = (found == expected) | (near & finite)
    return (np.isnan(found) & np.isnan(expected)) | (
        same & (np.signbit(found) == np.signbit(expected))
    )


def _wrong(name: str, reference: Reference, found, how: str) -> list[str]:
    """What differs from XLA, and where it is close from NumPy as well."""
    found, expected, rounded = np.asarray(found), reference.expected, reference.rounded
    assert found.dtype == expected.dtype, (name, how)
    if rounded is None:
        return _differing(name, reference.arguments, found, expected, 0, f"{how}, by XLA")
    return [
        *_differing(name, reference.arguments, found, expected, XLA_ULPS, f"{how}, by XLA"),
        *_differing(name, reference.arguments, found, rounded, ULPS, f"{how}, by NumPy"),
    ]


def _differing(name, arguments, found, expected, ulps: int, how: str) -> list[str]:
    wrong = ~_same(found, expected, ulps)
    if not wrong.any():
        return []
    i = np.flatnonzero(wrong if wrong.ndim == 1 else wrong.any(tuple(range(1, wrong.ndim))))[0]
    numbers = ", ".join(repr(x[i]) for x in arguments)
    count = f"{wrong.sum()} of {wrong.size}"
    return [f"{name} {how} ({count}): {numbers} gives {found[i]!r}, not {expected[i]!r}"]


@pytest.mark.slow
@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("arity", [1, 2])
def test_variables(dtype, arity):
    references, edges = _references(dtype, arity), _edges(dtype, arity)
    cases = {name: reference.arguments for name, reference in references.items()}
    longest = max(len(x) for xs in cases.values() for x in xs)
    cases = jax.tree.map(lambda x: np.resize(x, longest), cases)
    mapped = Mapped(
        lambda case, _: {name: edge.function(*case[name]) for name, edge in edges.items()},
        jax.tree.map(lambda x: x[0], cases),
    )
    with np.errstate(all="ignore"):
        results = {"compiled": mapped(cases), "interpreted": mapped.interpreted(cases)}
    assert not [
        message
        for how, found in results.items()
        for name, reference in references.items()
        for message in _wrong(name, reference, found[name][: len(reference.expected)], how)
    ]


@pytest.mark.slow
@pytest.mark.parametrize("dtype", TYPES)
@pytest.mark.parametrize("arity", [1, 2])
def test_constants(dtype, arity):
    messages = []
    for name, edge in _edges(dtype, arity).items():
        reference = _references(dtype, arity)[name]
        if edge.close and arity == 2:  # a function folded takes a millisecond or more
            reference = reference.at(slice(None, None, len(reference.expected) // 50))
        found = _folded(edge.function, reference.arguments)
        messages += _wrong(name, reference, found, "folded")
    assert not messages


def _folded(function: Callable, arguments: tuple[np.ndarray, ...]) -> np.ndarray:
    jaxpr = jaxpr_of(function, *arguments)
    (found,) = lower(Builder(), jaxpr, [as_elements(x) for x in arguments])
    assert all(isinstance(x, np.generic) for x in found.flat)
    return np.array(list(found.flat), jaxpr.out_avals[0].dtype)


def _check_beside(dtype: np.dtype, fixed: np.ndarray) -> None:
    """Variables with constants and with uniform numbers on either side."""
    edges = {name: e for name, e in _edges(dtype, 2).items() if not e.close}  # those are calls
    x = edge_values(dtype)

    def function(case, shared):
        return {
            (name, of, side): [edge.function(*(case, y)[::side]) for y in several]
            for name, edge in edges.items()
            for of, several in (("constant", fixed), ("uniform", shared))
            for side in (1, -1)
        }

    with np.errstate(all="ignore"):  # NumPy's scalars in a function of JAX warn of overflow
        found = Mapped(function, x[0], fixed)(x, fixed)
    places = np.array([_place(x, y) for y in fixed])[:, None]
    messages = []
    for (name, of, side), several in found.items():
        here, there = np.arange(len(x))[None, :], places
        rows = here * len(x) + there if side == 1 else there * len(x) + here
        reference = _references(dtype, 2)[name].at(rows.reshape(-1))
        messages += _wrong(name, reference, np.concatenate(several), f"beside a {of} number")
    assert not messages


def _place(values: np.ndarray, one: np.generic) -> int:
    """Where a number is among values, by its bits."""
    return [x.tobytes() for x in values].index(one.tobytes())


@pytest.mark.slow
@pytest.mark.parametrize("dtype", ALL, ids=str)
def test_all_constants_and_uniform_numbers_beside_variables(dtype):
    values = edge_values(dtype)
    for some in np.array_split(values, min(3, len(values))):
        _check_beside(dtype, some)


INDICES = tuple(map(np.dtype, (np.int32, np.int8, np.uint8, np.int64, np.uint32, np.uint64)))
"""Types of indices; every type of elements is tried with one."""


def _uses(dtype: np.dtype) -> dict[str, Use]:
    found = {f"{name} {i}": use for name, uses in PROGRAMS.items() for i, use in enumerate(uses)}
    return {name: use for name, use in found.items() if dtype in use.dtypes}


def _vectors(dtype: np.dtype, seed: int) -> np.ndarray:
    """Edge values by chance, the same ones often; no subnormal numbers, for XLA moves them only."""
    values = edge_values(dtype)
    values = values[~_subnormal(values)]
    rng = np.random.default_rng(seed)
    found = values[rng.integers(len(values), size=(4 * len(values), LENGTH))]
    return np.where(rng.random(found.shape) < 0.3, found[:, :1], found)


@pytest.mark.slow
@pytest.mark.parametrize("dtype", TYPES)
def test_programs(dtype):
    uses, index = _uses(dtype), INDICES[ALL.index(dtype) % len(INDICES)]
    x, y = _vectors(dtype, 0), _vectors(dtype, 1)
    small = np.arange(-4 if index.kind == "i" else 0, 9)
    numbers = np.concatenate([edge_values(index), small.astype(index)])
    cases = x, y, np.resize(numbers, len(x))
    one = jax.tree.map(lambda a: a[0], cases)
    mapped = Mapped(lambda c, _: {name: use.function(*c) for name, use in uses.items()}, one)
    expected = jax.jit(jax.vmap(lambda *c: {name: use.function(*c) for name, use in uses.items()}))(
        *cases
    )
    with np.errstate(all="ignore"):
        results = {"compiled": mapped(cases), "interpreted": mapped.interpreted(cases)}
    assert not [
        message
        for how, found in results.items()
        for name, use in uses.items()
        for one, other in zip(*map(jax.tree.leaves, (found[name], expected[name])), strict=True)
        for message in _differing(name, cases, np.asarray(one), np.asarray(other), use.ulps, how)
    ]


def _primitives(jaxpr) -> set[str]:
    found = set()
    for eqn in jaxpr.equations:
        found |= {eqn.name}.union(*map(_primitives, eqn.programs()))
    return found


def test_every_rule_is_tried_at_the_edges():
    assert set(RULES) - MISSING == {*ELEMENTWISE, *PROGRAMS, *ALIASES}
    for name, same in ALIASES.items():
        assert RULES[name] is RULES[same], name
    for name, edges in ELEMENTWISE.items():
        examples = [[x[0] for x in _arguments(edge, edge.dtypes[-1])] for edge in edges]
        assert any(map(_uses_it(name), [edge.function for edge in edges], examples)), name
    for name, uses in PROGRAMS.items():
        vectors = [[*np.zeros((2, LENGTH), use.dtypes[0]), np.int32(0)] for use in uses]
        assert any(map(_uses_it(name), [use.function for use in uses], vectors)), name


def _uses_it(name: str) -> Callable[..., bool]:
    return lambda function, examples: name in _primitives(jaxpr_of(function, *examples))
