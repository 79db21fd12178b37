"""Origin of a NaN in a function's result, or in the derivative of a run's cost.

The function is traced and computed one operation after the other, except for passes of loops
without new NaN, and every NaN is traced from its origin. The derivative of a program is a function
like any other: `jax.jvp` inside it is traced too, and its operations have the source lines of the
operations that they differentiate.
"""

from collections.abc import Callable, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxsat.core.jax_internals import (
    CALL,
    ClosedJaxpr,
    Expanded,
    JaxprEqn,
    Literal,
    Place,
    jaxpr_as_fun,
    layout_of,
    place_of,
)
from jaxsat.simulation.engine.fixed import stepper_for
from jaxsat.simulation.engine.program import Program
from jaxsat.simulation.engine.stepper import AbstractStepper


class Origin(NamedTuple):
    """Origin of a NaN: an operation (name of its primitive) and the calls in the source from the
    outermost; or the number of the argument leaf that contained it.

    `step` is the number of the pass of the outermost loop around the operation, zero outside.
    """

    operation: str
    place: tuple[Place, ...] = ()
    argument: int | None = None
    step: int = 0


class NanInRun(NamedTuple):
    """The operation that produces the NaN, and the time (s) at which its interval begins."""

    origin: Origin
    time: float


class _Value(NamedTuple):
    """An array, and the origin of its NaN, None without NaN."""

    array: Any
    origin: Origin | None = None


def nan_origins(function: Callable, *arguments: PyTree) -> Any:
    """Origin of the NaN in each leaf of a function's result, a tree like it; None without a NaN."""
    program, result = jax.make_jaxpr(function, return_shape=True)(*arguments)
    leaves = jax.tree.leaves(arguments)
    values = [_value(leaf, Origin("", (), number)) for number, leaf in enumerate(leaves)]
    origins = [value.origin for value in _compute(program, values)]
    return jax.tree.unflatten(jax.tree.structure(result), origins)


def nan_in_run(
    stepper: AbstractStepper, program: Program, case: PyTree, gains: PyTree, direction: PyTree
) -> NanInRun | None:
    """Origin of a NaN in the derivative of a case's cost along a `direction` of the gains.

    None without a NaN, also where the derivative is infinite.
    """

    def run(gains):
        one = program.case_factory(case, gains)
        steps = stepper_for(stepper, one.loop)

        def interval(progress, number):
            return steps.advance(program, one, progress, number, 1), None

        begin = steps.begin(program, one)
        end = jax.lax.scan(interval, begin, jnp.arange(program.intervals))[0]
        cost = steps.finish(program, one, end, jnp.array(program.intervals)).cost
        return cost, *eqx.filter(((one, begin), end), eqx.is_inexact_array)

    origin, *progress = nan_origins(lambda gains: jax.jvp(run, (gains,), (direction,))[1], gains)
    if origin is None:
        return None
    begin, end = (jax.tree.leaves(x, is_leaf=lambda x: isinstance(x, Origin)) for x in progress)
    number = 0 if origin in begin else origin.step if origin in end else program.intervals
    return NanInRun(origin, number * float(np.asarray(program.interval)))


def _value(array: Any, origin: Origin | None) -> _Value:
    """The array with its origin, if it contains a NaN."""
    return _Value(array, origin if _has_nan(array) else None)


def _has_nan(array: Any) -> bool:
    real = jnp.issubdtype(jnp.result_type(array), jnp.inexact)
    return bool(real and np.isnan(np.asarray(array)).any())


def _compute(program: Any, arguments: Sequence[_Value]) -> list[_Value]:
    """The results of a program, computed one operation after the other."""
    closed = program.jaxpr if isinstance(program, Expanded) else program
    inner = closed.jaxpr if isinstance(closed, ClosedJaxpr) else closed
    constants = [_value(x, Origin("constant")) for x in getattr(closed, "consts", ())]
    environment = dict(
        zip((*inner.constvars, *inner.invars), (*constants, *arguments), strict=True)
    )

    def read(atom: Any) -> _Value:
        if isinstance(atom, Literal):
            return _value(atom.val, Origin("constant"))
        return environment[atom]

    for equation in inner.eqns:
        results = _apply(equation, [read(atom) for atom in equation.invars])
        environment.update(zip(equation.outvars, results, strict=True))
    return [read(atom) for atom in inner.outvars]


def _apply(equation: JaxprEqn, operands: list[_Value]) -> list[_Value]:
    name, parameters, unknown = layout_of(equation)
    if name == CALL and not unknown:
        return _compute(parameters["body"], operands)
    if name in _LOOPS and not unknown:
        return _LOOPS[name](parameters, operands)
    arrays = equation.primitive.bind(*[value.array for value in operands], **equation.params)
    arrays = arrays if equation.primitive.multiple_results else [arrays]
    if not any(map(_has_nan, arrays)):
        return [_Value(array) for array in arrays]
    origin = _inherited_origin(name, arrays, operands)
    if origin is None or origin.operation == "constant":
        origin = Origin(name, place_of(equation.source_info))
    return [_value(array, origin) for array in arrays]


def _inherited_origin(name: str, arrays: list[Any], operands: list[_Value]) -> Origin | None:
    """Origin of a NaN in an operation's result that an operand already had."""
    if name == "select_n":
        which, *cases = operands
        selector = np.asarray(which.array).astype(int)
        nan = np.isnan(np.asarray(arrays[0]))
        operands = [case for number, case in enumerate(cases) if np.any(nan & (selector == number))]
    return next((value.origin for value in operands if value.origin is not None), None)


class _LoopBody:
    """The body of a loop. From the second pass it is compiled, and only a pass with a new NaN is
    computed operation by operation."""

    def __init__(self, body: ClosedJaxpr):
        self.body, self._compiled, self._first = body, jax.jit(jaxpr_as_fun(body)), True

    def __call__(
        self, operands: list[_Value], before: Sequence[Origin | None], step: int
    ) -> list[_Value]:
        """Compute pass `step`; `before` has the origin of each NaN in the results of the last."""
        if not self._first:
            arrays = self._compiled(*[value.array for value in operands])
            pairs = list(zip(arrays, before, strict=True))
            if all(origin is not None or not _has_nan(array) for array, origin in pairs):
                return [_value(array, origin) for array, origin in pairs]
        self._first = False
        inherited = {id(value.origin) for value in operands}
        return [
            value
            if id(value.origin) in inherited or value.origin is None
            else value._replace(origin=value.origin._replace(step=step))
            for value in _compute(self.body, operands)
        ]


def _scan(parameters: Any, operands: list[_Value]) -> list[_Value]:
    body, length, consts = parameters["body"], parameters["length"], parameters["n_consts"]
    end = consts + parameters["n_carry"]
    values, rows = operands[consts:end], []
    once = _LoopBody(body)
    before = [value.origin for value in values] + [None] * (len(body.out_avals) - len(values))
    order = range(length)
    for step, number in enumerate(reversed(order) if parameters["reverse"] else order):
        row = [_value(x.array[number], x.origin) for x in operands[end:]]
        values = once([*operands[:consts], *values[: end - consts], *row], before, step)
        before = [value.origin for value in values]
        rows.append(values[end - consts :])
    if parameters["reverse"]:
        rows.reverse()
    return [*values[: end - consts], *map(_stack, zip(*rows, strict=True))]


def _stack(rows: Sequence[_Value]) -> _Value:
    origin = next((row.origin for row in rows if row.origin is not None), None)
    return _Value(jnp.stack([row.array for row in rows]), origin)


def _while(parameters: Any, operands: list[_Value]) -> list[_Value]:
    begin = parameters["n_test"]
    end = begin + parameters["n_body"]
    carry, once = operands[end:], _LoopBody(parameters["body"])
    goes_on = jax.jit(jaxpr_as_fun(parameters["test"]))
    step = 0
    while bool(goes_on(*[value.array for value in (*operands[:begin], *carry)])[0]):
        carry = once([*operands[begin:end], *carry], [value.origin for value in carry], step)
        step += 1
    return carry


def _cond(parameters: Any, operands: list[_Value]) -> list[_Value]:
    branches = parameters["branches"]
    number = min(max(int(operands[0].array), 0), len(branches) - 1)
    return _compute(branches[number], operands[1:])


_LOOPS: dict[str, Callable[[Any, list[_Value]], list[_Value]]] = {
    "scan": _scan,
    "while": _while,
    "cond": _cond,
}
