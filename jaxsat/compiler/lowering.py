"""Lowering of a jaxpr to a program of scalars: one rule per primitive, by name.

An array of the jaxpr is a NumPy object array of constants and values. A rule is a function `rule(b,
eqn, *arrays)` that computes the equation's results with the builder `b`; see
`jaxsat.compiler.rules`.
"""

from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import TYPE_CHECKING, Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Function, NativeBug, Scalar, Value, is_uniform
from jaxsat.compiler.passes.dead_code import without_dead_code
from jaxsat.compiler.trace import frames_of, note_elements
from jaxsat.core.errors import JaxsatError
from jaxsat.core.jax_internals import is_tested, summary_of, versions
from jaxsat.core.jaxprs import Equation, Jaxpr, Literal, jaxpr_of
from jaxsat.core.once import once

if TYPE_CHECKING:
    Elements = Any  # type checkers know no arrays of values
else:
    Elements = np.ndarray
"""An object array of scalars."""

Rule = Callable[..., "Elements | Sequence[Elements]"]

REPEATED, LONG = 3, 400
"""Calls and equations from which a function is lowered once, not inlined."""

LONGEST = 20_000
"""Largest number of operations of one equation: LLVM takes minutes over more."""

LONG_SUM = 5
"""Number of terms from which a sum is a loop in a compact program."""

RULES: dict[str, Rule] = {}

KINDS = "fiub"
"""Kinds of numbers: floats, signed and unsigned integers, bools."""

KEYS = np.dtype(np.uint64)
"""Type of a typed random key as one number: its first word above its second one."""


class CannotLower(JaxsatError):
    """A program has an operation that the compiler does not support; the message names it."""

    def __init__(self, what: str, place: str = ""):
        super().__init__(f"{what} ({place})" if place else what)
        self.what, self.place = what, place


@contextmanager
def bugs_in(what: str) -> Iterator[None]:
    """Raise `NativeBug` for any exception inside but `CannotLower`."""
    try:
        yield
    except (CannotLower, NativeBug):
        raise
    except Exception as error:
        raise NativeBug(what, error) from error


def lowers(*names: str) -> Callable[[Rule], Rule]:
    """Register a function as the rule of these primitives."""

    def register(rule: Rule) -> Rule:
        for name in names:
            RULES[name] = rule
        return rule

    return register


def lower(b: Builder, jaxpr: Jaxpr, arrays: Sequence[Elements]) -> list[Elements]:
    """Return the outputs of a jaxpr for these inputs."""
    environment = {variable: as_elements(value) for variable, value in jaxpr.constants}
    environment.update(zip(jaxpr.inputs, arrays, strict=True))

    def read(atom: Any):
        if isinstance(atom, Literal):
            return as_elements(atom.value, atom.aval.dtype)
        return environment[atom]

    note_repeated(b, jaxpr)
    for eqn in jaxpr.equations:
        outputs = _apply(b, eqn, [read(atom) for atom in eqn.inputs])
        environment.update(zip(eqn.outputs, outputs, strict=True))
    return [read(atom) for atom in jaxpr.outputs]


def note_repeated(b: Builder, jaxpr: Jaxpr) -> None:
    """Note long functions that are called several times."""
    bodies = [eqn.parameters["body"] for eqn in jaxpr.equations if eqn.is_call]
    for inner, times in Counter(map(id, bodies)).items():
        body = next(one for one in bodies if id(one) == inner)
        if times >= REPEATED and equations(body) >= LONG:
            b.repeated[inner] = body


def equations(jaxpr: Jaxpr) -> int:
    """Return the number of equations of a jaxpr, with those of inner jaxprs."""
    count = 0
    for eqn in jaxpr.equations:
        repeated = eqn.parameters.get("length", 1) if eqn.name == "scan" else 1
        count += 1 + repeated * sum(map(equations, eqn.programs()))
    return count


def _apply(b: Builder, eqn: Equation, arrays: list[Elements]) -> Sequence[Elements]:
    name = eqn.name
    try:
        if name not in RULES:
            raise CannotLower(f"The primitive `{name}` has no native rule: {versions()}")
        if eqn.unknown:
            raise CannotLower(f"The native rules do not know {eqn.unknown}: {versions()}")
        for var in eqn.outputs:
            number_type(var.aval.dtype)
        before = b.written
        with b.at(() if b.trace is None else frames_of(eqn, b.trace)):
            outputs = RULES[name](b, eqn, *arrays)
            if b.trace is not None:
                note_elements(b.trace, [outputs] if isinstance(outputs, np.ndarray) else outputs)
        if b.written - before > LONGEST and not _is_call(eqn):
            many = b.written - before
            raise CannotLower(f"`{name}` would be written out as {many} operations")
    except CannotLower as error:
        if error.place:
            raise
        what = error.what if f"`{name}`" in error.what else f"{error.what}, in `{name}`"
        raise CannotLower(what if not _is_call(eqn) else error.what, _where(eqn)) from None
    except NativeBug:
        raise
    except Exception as error:
        if not is_tested():
            what = f"The rule of `{name}` broke down ({error!r}): {versions()}"
            raise CannotLower(what, _where(eqn)) from error
        raise NativeBug(f"the rule of `{name}` ({_where(eqn)})", error) from error
    return [outputs] if isinstance(outputs, np.ndarray) else outputs


def written(
    b: Builder, function: Callable, examples: Sequence[Any], *arrays: Elements
) -> list[Elements]:
    """Lower a function in plain `jax.numpy` in place of a primitive.

    `examples` have the inputs' shapes and types, or an `aval` with them.
    """
    avals = [getattr(example, "aval", example) for example in examples]
    kinds = [jax.ShapeDtypeStruct(aval.shape, aval.dtype) for aval in avals]
    try:
        return lower(b, jaxpr_of(function, *kinds), arrays)
    except CannotLower as error:  # its place would be ours
        raise CannotLower(error.what) from None


def _is_call(eqn: Equation) -> bool:
    """Whether an equation contains equations, so that an inner one has failed."""
    return "body" in eqn.parameters or "branches" in eqn.parameters


def _where(eqn: Equation) -> str:
    return summary_of(eqn.place)


@once
def number_type(dtype: Any) -> np.dtype:
    """Return the type of numbers to which an array of this type is lowered."""
    if jnp.issubdtype(dtype, jax.dtypes.prng_key):
        name = dtype.name.removeprefix("key<").removesuffix(">")
        if name != "fry":
            raise CannotLower(f"Random keys of type `{name}` are not supported")
        return KEYS
    if dtype == jax.dtypes.float0:  # derivatives of what is no real number, never used
        return np.dtype(bool)
    dtype = np.dtype(dtype)
    if dtype.kind not in KINDS or dtype == np.float16:
        raise CannotLower(f"Arrays of type {dtype} are not supported")
    return dtype


def numbers_in(array: Any, dtype: Any = None) -> np.ndarray:
    """Return an array of numbers: typed random keys become one number each."""
    if jnp.issubdtype(getattr(array, "dtype", dtype), jax.dtypes.prng_key):
        number_type(array.dtype)
        words = np.asarray(jax.random.key_data(array)).astype(KEYS)
        return np.asarray(words[..., 0] << KEYS.type(32) | words[..., 1])
    array = np.asarray(array, dtype)
    kind = number_type(array.dtype)
    return array if array.dtype == kind else np.zeros(array.shape, kind)


def as_elements(array, dtype=None) -> Elements:
    """Return a constant array as an object array of NumPy scalars."""
    array = numbers_in(array, dtype)
    out = np.empty(array.shape, object)
    for index in np.ndindex(array.shape):
        out[index] = array[index]
    return out


def each(function: Callable[..., Scalar], *arrays: Elements) -> Elements:
    """Apply a function of scalars element by element to arrays broadcast to one shape."""
    together = list(np.broadcast_arrays(*arrays)) if len(arrays) > 1 else list(arrays)
    shape, size = together[0].shape, together[0].size
    flats = [list(x.flat) for x in together]
    out = np.empty(size, object)
    for i, scalars in enumerate(zip(*flats, strict=True)):
        out[i] = function(*scalars)
    return out.reshape(shape)


def filled(shape: tuple[int, ...], scalar: Scalar) -> Elements:
    """Return an array filled with one scalar."""
    out = np.empty(shape, object)
    out.fill(scalar)  # out[...] = scalar would turn NumPy's scalars into Python's
    return out


def scalars_of(arrays: Sequence[Elements]) -> list[Scalar]:
    """Return all elements of arrays, one array after the other."""
    return [scalar for array in arrays for scalar in array.flat]


def arrays_of(scalars: Sequence[Scalar], shapes: Sequence[tuple[int, ...]]) -> list[Elements]:
    """Invert `scalars_of` for arrays of these shapes."""
    arrays, begin = [], 0
    for shape in shapes:
        size = int(np.prod(shape))
        array = np.empty(size, object)
        array[:] = scalars[begin : begin + size]
        arrays.append(array.reshape(shape))
        begin += size
    return arrays


def function_of(b: Builder, name: str, jaxpr: Jaxpr, args: Sequence[Scalar]) -> Function:
    """Return a jaxpr of scalars as a function, lowered once for each kind of arguments."""
    kinds = tuple((arg.dtype.char, is_uniform(arg)) for arg in args)
    key = (name, kinds)
    if key not in b.functions:
        params = [Value(arg.dtype, is_uniform(arg)) for arg in args]
        inner = Builder(like=b)
        jaxpr = b.cut(jaxpr)
        with b.at(()):
            results = scalars_of(lower(inner, jaxpr, arrays_of(params, [()] * len(params))))
        label = f"{name}.{''.join(char + 'vu'[uniform] for char, uniform in kinds)}"
        b.functions[key] = without_dead_code(Function(label, params, inner.block, results))
    return b.functions[key]
