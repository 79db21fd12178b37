"""Traced programs in a form that does not change with JAX.

`jaxpr_of` traces a function. What the compiler, the exporter and the fingerprint read are the
classes here; how JAX's own objects look is known to `jaxsat.core.jax_internals` alone.
"""

from collections.abc import Callable, Iterator, Mapping
from dataclasses import dataclass
from typing import Any

import jax
from jaxtyping import PyTree

from jaxsat.core import jax_internals
from jaxsat.core.jax_internals import CALL, ClosedJaxpr, DropVar, Expanded, OpenJaxpr, Place


class Variable:
    """What an equation makes, or a program is given: an array of `aval`'s shape and type.

    No equation reads one that is `dropped`.
    """

    __slots__ = ("aval", "dropped")

    def __init__(self, aval: Any, dropped: bool = False):
        self.aval, self.dropped = aval, dropped


class Literal:
    """A number in the place of a variable."""

    __slots__ = ("aval", "value")

    def __init__(self, aval: Any, value: Any):
        self.aval, self.value = aval, value


Atom = Variable | Literal


@dataclass(frozen=True, eq=False, slots=True)
class Equation:
    """One operation: the name of its primitive, what it reads, and what it makes.

    `parameters` have the names of `jax_internals.layout_of`, and programs in them are `Jaxpr`s.
    `unknown` is empty, or says what of the parameters is not known. `source` is JAX's own, which
    `place` reads.
    """

    name: str
    inputs: tuple[Any, ...]
    outputs: tuple[Variable, ...]
    parameters: Mapping[str, Any]
    source: Any = None
    unknown: str = ""

    @property
    def place(self) -> tuple[Place, ...]:
        """The calls of the source that it comes from, from the outermost."""
        return jax_internals.place_of(self.source)

    @property
    def is_call(self) -> bool:
        """Whether it only calls the program `body`."""
        return self.name == CALL and not self.unknown

    def programs(self) -> Iterator["Jaxpr"]:
        """The programs inside it."""
        for value in self.parameters.values():
            for one in value if isinstance(value, tuple) else (value,):
                if isinstance(one, Jaxpr):
                    yield one


@dataclass(frozen=True, eq=False, slots=True)
class Jaxpr:
    """A program: equations in order, each reading what stands before it.

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
    """The program of a function of trees like these."""
    return jaxpr_and_shapes(function, *examples)[0]


def jaxpr_and_shapes(function: Callable, *examples: PyTree) -> tuple[Jaxpr, PyTree]:
    """The program of such a function, and the shapes and types of its results as a tree."""
    closed, shapes = jax.make_jaxpr(function, return_shape=True)(*examples)
    return _Reader().program(closed, closed.consts), shapes


class _Reader:
    """Reads JAX's objects; what is one program there is one here."""

    def __init__(self) -> None:
        self._known: dict[tuple[int, int], tuple[Any, Jaxpr]] = {}

    def program(self, jaxpr: Any, consts: Any, caller: Any = None) -> Jaxpr:
        """A program; all its equations come from where the `caller` comes from, if there is one."""
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
        """A parameter of an equation that comes from `source`, programs in it read."""
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
        if type(value) is tuple:  # none with names
            return tuple([self._value(one, source, caller) for one in value])
        return value
