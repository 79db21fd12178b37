"""Traced programs in a form that is independent of JAX's version.

`jaxpr_of` traces a function. The compiler, the exporter and the fingerprint read the classes here;
only `jaxsat.core.jax_internals` knows JAX's own objects.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import jax
from jaxtyping import PyTree

from jaxsat.core import jax_internals
from jaxsat.core.jax_internals import CALL, ClosedJaxpr, DropVar, Expanded, OpenJaxpr, Place


class Variable:
    """An output of an equation, or an input of a program: an array of `aval`'s shape and type.

    No equation reads a `dropped` variable.
    """

    __slots__ = ("aval", "dropped")

    def __init__(self, aval: Any, dropped: bool = False):
        self.aval, self.dropped = aval, dropped


class Literal:
    """A constant number in place of a variable."""

    __slots__ = ("aval", "value")

    def __init__(self, aval: Any, value: Any):
        self.aval, self.value = aval, value


Atom = Variable | Literal


@dataclass(frozen=True, eq=False, slots=True)
class Equation:
    """One operation: the name of its primitive, its inputs, and its outputs.

    `parameters` have the names of `jax_internals.layout_of`, and programs in them are `Jaxpr`s.
    `unknown` is empty, or describes the unknown parameters. `source` is JAX's own, which `place`
    reads.
    """

    name: str
    inputs: tuple[Any, ...]
    outputs: tuple[Variable, ...]
    parameters: Mapping[str, Any]
    source: Any = None
    unknown: str = ""

    @property
    def place(self) -> tuple[Place, ...]:
        """Calls in the source that led to the operation, from the outermost."""
        return jax_internals.place_of(self.source)

    @property
    def is_call(self) -> bool:
        """Whether the operation only calls the program `body`."""
        return self.name == CALL and not self.unknown

    def programs(self) -> Iterator["Jaxpr"]:
        """Yield the programs inside the operation."""
        for value in self.parameters.values():
            for one in value if isinstance(value, tuple) else (value,):
                if isinstance(one, Jaxpr):
                    yield one


@dataclass(frozen=True, eq=False, slots=True)
class Jaxpr:
    """A program: equations in order, each reading only earlier results.

    `constants` are variables and their values.
    """

    inputs: tuple[Variable, ...]
    outputs: tuple[Any, ...]
    equations: tuple[Equation, ...]
    constants: tuple[tuple[Variable, Any], ...] = ()

    @property
    def in_avals(self) -> list[Any]:
        """Shapes and types of the inputs."""
        return [variable.aval for variable in self.inputs]

    @property
    def out_avals(self) -> list[Any]:
        """Shapes and types of the outputs."""
        return [atom.aval for atom in self.outputs]


def jaxpr_of(function: Callable, *examples: PyTree) -> Jaxpr:
    """Trace a function of trees like `examples` into a program."""
    return jaxpr_and_shapes(function, *examples)[0]


def jaxpr_and_shapes(function: Callable, *examples: PyTree) -> tuple[Jaxpr, PyTree]:
    """Trace a function into a program, and the shapes and types of its results as a tree."""
    closed, shapes = jax.make_jaxpr(function, return_shape=True)(*examples)
    return _Reader().program(closed, closed.consts), shapes


class _Reader:
    """Reader of JAX's objects that keeps the identity of shared programs."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, int], tuple[Any, Jaxpr]] = {}

    def program(self, jaxpr: Any, consts: Any, caller: Any = None) -> Jaxpr:
        """Read a program; with a `caller`, all its equations have the caller's source position."""
        inner = jaxpr.jaxpr if isinstance(jaxpr, ClosedJaxpr) else jaxpr
        arguments = [*inner.constvars, *inner.invars]
        variables = {one: Variable(one.aval) for one in arguments}

        def atom(one: Any) -> Atom:
            if isinstance(one, jax_internals.Literal):
                return Literal(one.aval, one.val)
            return variables[one]

        equations = []
        for equation in inner.eqns:
            name, parameters, unknown = jax_internals.layout_of(equation)
            source = equation.source_info if caller is None else caller
            operands = tuple([atom(one) for one in equation.invars])
            results = tuple([Variable(x.aval, isinstance(x, DropVar)) for x in equation.outvars])
            variables.update(zip(equation.outvars, results, strict=True))
            parameters = {
                key: self._value(value, source, caller) for key, value in parameters.items()
            }
            equations.append(Equation(name, operands, results, parameters, source, unknown))
        inputs, count = [variables[one] for one in arguments], len(consts)
        return Jaxpr(
            tuple(inputs[count:]),
            tuple([atom(one) for one in inner.outvars]),
            tuple(equations),
            tuple(zip(inputs[:count], consts, strict=True)),
        )

    def _value(self, value: Any, source: Any, caller: Any) -> Any:
        """Read a parameter of an equation from `source`, with programs in it."""
        match value:
            case ClosedJaxpr() | jax_internals.Jaxpr():
                key = (id(value), id(caller))
                if key not in self._known:
                    program = self.program(value, getattr(value, "consts", ()), caller)
                    self._known[key] = (value, program)  # which keeps the identity
                return self._known[key][1]
            case OpenJaxpr():
                return self.program(*value, caller)
            case Expanded(closed):
                return self.program(closed, closed.consts, source)
        if type(value) is tuple:  # no NamedTuple
            return tuple([self._value(one, source, caller) for one in value])
        return value
