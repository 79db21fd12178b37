"""Fingerprint of traced programs: a hash of their operations and of the constants in them.

Names, comments and source positions are no part of a trace, and neither are a program's inputs.
Details without effect on results are left out: unused operations, names of compiled functions,
hints to XLA.
"""

import dataclasses
import enum
import hashlib
import inspect
import operator
import re
from collections.abc import Callable, Mapping
from types import CodeType
from typing import Any

import jax
import jax.numpy as jnp
import numpy as np

from jaxsat.core.jax_internals import WISH
from jaxsat.core.jaxprs import Equation, Jaxpr, Literal
from jaxsat.core.once import once

LIBRARIES = {"jax", "equinox"}
"""Libraries identified by version: the byte code of their functions differs with Python's."""

_ADDRESS = re.compile(r" at 0x[0-9a-fA-F]+")


def fingerprint(traces: Mapping[str, Jaxpr]) -> str:
    """Return a hash of traced programs, the same in every process and on every machine."""
    hashes: dict[int, str] = {}
    return _hash(*(f"{name} {_text_of(trace, hashes)}" for name, trace in sorted(traces.items())))


def parameter_text(equation: Equation) -> str:
    """Return the text of an operation's parameters that affect its result."""
    return _text_of(_params(equation), {})


def _hash(*texts: str) -> str:
    return hashlib.sha256("\n".join(texts).encode()).hexdigest()


def _of_jaxpr(jaxpr: Jaxpr, hashes: dict[int, str]) -> str:
    """Return the hash of how the results follow from the inputs."""
    if id(jaxpr) not in hashes:
        inputs = [*(variable for variable, _ in jaxpr.constants), *jaxpr.inputs]
        kinds = [_kind(variable.aval) for variable in inputs]
        origins: dict[Any, str] = {variable: f"input {i}" for i, variable in enumerate(inputs)}

        def read(atom: Any) -> str:
            return array_text(atom.value, atom.aval) if isinstance(atom, Literal) else origins[atom]

        for equation in jaxpr.equations:
            operands = [read(atom) for atom in equation.inputs]
            if equation.name == WISH:
                origins.update(zip(equation.outputs, operands, strict=True))
                continue
            operation = _hash(equation.name, _text_of(_params(equation), hashes), *operands)
            origins.update(
                (variable, f"{i} {operation}") for i, variable in enumerate(equation.outputs)
            )
        hashes[id(jaxpr)] = _hash(*kinds, "->", *map(read, jaxpr.outputs))
    return hashes[id(jaxpr)]


def _params(equation: Equation) -> dict[str, Any]:
    """Return an operation's parameters without a function's name and without None.

    Another version may lack parameters that are None here.
    """
    parameters = equation.parameters.items()
    return {key: value for key, value in parameters if key != "name" and value is not None}


def _kind(aval: Any) -> str:
    dtype = getattr(aval, "dtype", None)  # none of a token, which orders effects
    return type(aval).__name__ if dtype is None else f"{_name(dtype)}{list(aval.shape)}"


_name = once(str)  # NumPy's type names are slow


def array_text(value: Any, aval: Any = None) -> str:
    """Return type, shape and numbers of an array, or a hash of many, as text."""
    if isinstance(value, jax.Array) and jnp.issubdtype(value.dtype, jax.dtypes.prng_key):
        value, aval = jax.random.key_data(value), None
    array = np.asarray(value, None if aval is None else aval.dtype)
    data = array.tobytes()
    digits = data.hex() if len(data) <= 64 else hashlib.sha256(data).hexdigest()
    return f"{_name(array.dtype)}{list(array.shape)}{digits}"


def _text_of(value: Any, hashes: dict[int, str]) -> str:
    """Return a parameter of an operation as text that depends on its content alone."""
    match value:
        case Jaxpr():
            constants = [array_text(constant) for _, constant in value.constants]
            return " ".join([_of_jaxpr(value, hashes), *constants])
        case None | bool() | str() | bytes() | float() | complex() | np.dtype():
            return repr(value)
        case enum.Enum():
            return f"{type(value).__name__}.{value.name}"
        case int() | np.integer():
            return str(operator.index(value))
        case np.ndarray() | np.generic() | jax.Array():
            return array_text(value)
        case Mapping():
            entries = sorted(
                f"{_text_of(key, hashes)}:{_text_of(value[key], hashes)}" for key in value
            )
            return f"{{{','.join(entries)}}}"
        case set() | frozenset():
            return f"{{{','.join(sorted(_text_of(item, hashes) for item in value))}}}"
        case tuple() | list():
            return f"({','.join(_text_of(item, hashes) for item in value)})"
        case CodeType():
            return _text_of((value.co_code, value.co_names, value.co_consts), hashes)
    if inspect.isfunction(value):
        return _of_function(value, hashes)
    if dataclasses.is_dataclass(value) and not isinstance(value, type):
        fields = {field.name: getattr(value, field.name) for field in dataclasses.fields(value)}
        return f"{type(value).__qualname__}{_text_of(fields, hashes)}"
    return _ADDRESS.sub("", repr(value))


def _of_function(function: Callable, hashes: dict[int, str]) -> str:
    """Return the text of a callback function, without the variables that it closes over."""
    name = f"{function.__module__}.{function.__qualname__}"
    inside = function.__module__.split(".")[0] in LIBRARIES
    return name if inside else f"{name}{_text_of(function.__code__, hashes)}"
