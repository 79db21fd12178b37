"""Outlining: traced programs cut into functions again, like their Python code.

A jaxpr holds the operations of all called Python functions in sequence. Every operation knows its
calls, so that each call can be put back: equal ones become calls of one function, and long ones
functions of their own. Computations common to several functions are done once, before them, and
passed on.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np

from jaxsat.compiler.passes.call_tree import (
    Node,
    Values,
    call_tree,
    nodes_of,
    place_of,
    without_repeated_calls,
)
from jaxsat.compiler.trace import Frame
from jaxsat.core.fingerprint import parameter_text
from jaxsat.core.jax_internals import CALL
from jaxsat.core.jaxprs import Equation, Jaxpr, Literal, Variable

SHARED, LONE = 10, 80
"""Least number of operations of a function that is called several times, and of one called once."""

MARK = "python:"
"""Prefix of the names of outlined functions."""

MOVES = frozenset((
    "slice", "squeeze", "reshape", "broadcast_in_dim", "concatenate", "transpose", "stack",
    "convert_element_type", "iota", "copy", "copy_p", "expand_dims", "rev", "pad", "split",
    "stop_gradient", "gather", "dynamic_slice", "scatter",
))  # fmt: skip
"""Primitives that only move numbers."""

DEAR = frozenset((
    "acos", "acosh", "asin", "asinh", "atan", "atan2", "atanh", "cbrt", "cos", "cosh", "div",
    "dot_general", "exp", "exp2", "expm1", "log", "log1p", "pow", "rsqrt", "sin", "sinh", "sqrt",
    "tan", "tanh",
))  # fmt: skip
"""Primitives that are slow on a processor without hardware for them."""


@dataclass
class Outline:
    """Functions of a program: jaxprs by identity with name, file and number of calls, and the
    frames of calls by the identity of their equations."""

    functions: dict[int, tuple[Jaxpr, str, str, int]] = field(default_factory=dict)
    frames: dict[int, tuple[Frame, ...]] = field(default_factory=dict)

    owners: list[Any] = field(default_factory=list)
    """Objects that identities belong to, kept alive."""

    def changed(self, eqn: Equation, **parts: Any) -> Equation:
        """Return an equation with other parts, and the same frames."""
        replacement = replace(eqn, **parts)
        if id(eqn) in self.frames:
            self.frames[id(replacement)] = self.frames[id(eqn)]
            self.owners.append(replacement)
        return replacement


def outlined(jaxpr: Jaxpr) -> tuple[Jaxpr, Outline]:
    """Return the program with calls of functions in it."""
    outline = Outline()
    return _outlined(outline, jaxpr, None), outline


def _outlined(outline: Outline, jaxpr: Jaxpr, inside: int | None) -> Jaxpr:
    """Outline a program, or a branch or loop body `inside` so many functions."""
    eqns = [_with_inner(outline, eqn) for eqn in jaxpr.equations]
    root = call_tree(eqns, inside)
    values = Values(jaxpr, eqns)
    levels: dict[int, list[Node]] = {}
    for node in nodes_of(root):
        levels.setdefault(node.height, []).append(node)
    for height in sorted(levels):
        groups: dict[Any, list[Node]] = {}
        for node in levels[height]:
            contents = list(_contents(node, eqns))
            node.eqns = without_repeated_calls(values, contents, _function_of, outline.changed)
            if node is not root:
                groups.setdefault(_shape(node), []).append(node)
        for group in groups.values():
            _make(outline, group, values)
    results = tuple([values.atom(atom) for atom in jaxpr.outputs])
    return replace(jaxpr, outputs=results, equations=tuple(root.eqns))


def _with_inner(outline: Outline, eqn: Equation) -> Equation:
    if eqn.name not in ("cond", "scan", "while"):
        return eqn
    depth = len(place_of(eqn))
    parameters = dict(eqn.parameters)
    for key, inner in parameters.items():
        if isinstance(inner, Jaxpr):
            parameters[key] = _outlined(outline, inner, depth)
        elif key == "branches":
            parameters[key] = tuple([_outlined(outline, branch, depth) for branch in inner])
    return replace(eqn, parameters=parameters)


def _contents(node: Node, eqns: Sequence[Equation]) -> Iterator[Equation]:
    """Yield the equations of a call, with inner calls put back."""
    for item in node.items:
        if isinstance(item, int):
            yield eqns[item]
            continue
        yield from item.before
        if item.call is not None:
            yield item.call
        else:
            yield from item.eqns


def _function_of(eqn: Equation) -> Jaxpr | None:
    """Return the outlined function that an equation calls, or None."""
    is_call = str(eqn.parameters.get("name", "")).startswith(MARK)
    return eqn.parameters["body"] if is_call else None


def _shape(node: Node) -> tuple:
    """Return a key common to calls of one function: all but the external variables."""
    numbers: dict[Any, tuple[int, int]] = {}
    operations = []
    for number, eqn in enumerate(node.eqns):
        operands = []
        for atom in eqn.inputs:
            inside = numbers.get(atom) if isinstance(atom, Variable) else None
            operands.append(inside or str(atom.aval))
        function = _function_of(eqn)
        params = parameter_text(eqn) if function is None else f"{MARK}{id(function)}"
        operations.append((eqn.name, params, *operands))
        numbers |= {var: (number, i) for i, var in enumerate(eqn.outputs)}
    return (node.name, node.file, *operations)


def _make(outline: Outline, group: list[Node], values: Values) -> None:
    """Replace equal calls by calls of one function, if that makes the program clearer."""
    one = group[0]
    cost = sum(map(_cost, one.eqns))
    if one.name.split(".")[-1].startswith("<") or cost < (SHARED if len(group) > 1 else LONE):
        return
    if len(one.eqns) == 1 and _function_of(one.eqns[0]) is not None:
        return  # hands on what it is given
    _put_before(group, values)
    sources = _from_outside(group)
    places: dict[tuple, list[tuple[int, int]]] = {}
    for where, atoms in sources.items():
        places.setdefault(tuple(map(values.identity, atoms)), []).append(where)
    eqns = list(one.eqns)
    params: list[Any] = []
    args: list[list[Any]] = [[] for _ in group]
    for identities, wheres in places.items():
        atoms = sources[wheres[0]]
        if isinstance(atoms[0], Literal) and len(set(identities)) == 1:
            continue
        param = Variable(atoms[0].aval)
        params.append(param)
        for number, place in wheres:
            inputs = list(eqns[number].inputs)
            inputs[place] = param
            eqns[number] = outline.changed(eqns[number], inputs=tuple(inputs))
        for arg, atom in zip(args, atoms, strict=True):
            arg.append(atom)
    results = [
        (number, i)
        for number, eqn in enumerate(one.eqns)
        for i in range(len(eqn.outputs))
        if any(
            values.is_read_outside(node.eqns[number].outputs[i], node.first, node.end)
            for node in group
        )
    ]
    if not results:
        return
    outs = [eqns[number].outputs[i] for number, i in results]
    program = Jaxpr(tuple(params), tuple(outs), tuple(eqns))
    outline.functions[id(program)] = (program, one.name, one.file, len(group))

    for node, arguments in zip(group, args, strict=True):
        outputs = tuple([node.eqns[number].outputs[i] for number, i in results])
        parameters = {"body": program, "name": f"{MARK}{one.name}"}
        node.call = Equation(CALL, tuple(arguments), outputs, parameters, one.eqns[0].source)
        frames = tuple(
            Frame(name.split(".<locals>")[0], file, line) for name, file, line, _ in node.caller
        )
        outline.frames[id(node.call)] = frames
        outline.owners.append(node.call)


def _put_before(group: Sequence[Node], values: Values) -> None:
    """Move expensive computations that other functions share out of the functions."""
    counts = range(len(group[0].eqns))
    sources = [_makers(node) for node in group]
    needs: dict[int, set[int]] = {}  # of what can be before: which equations it needs
    numbers: set[int] = set()
    for number in counts:
        makers = {maker for by_equation in sources for maker in by_equation[number]}
        shared = all(_is_shared(node, number, values) for node in group)
        move = group[0].eqns[number].name in MOVES
        if makers <= needs.keys() and (shared or move):
            needs[number] = {number}.union(*(needs[maker] for maker in makers))
            if shared and _is_dear(group[0].eqns[number]):
                numbers |= needs[number]
    for node in group:
        node.before = [node.eqns[number] for number in counts if number in numbers]
        node.eqns = [node.eqns[number] for number in counts if number not in numbers]


def _makers(node: Node) -> list[set[int]]:
    """Return for each equation of a function the equations that it reads."""
    makers = {id(var): i for i, eqn in enumerate(node.eqns) for var in eqn.outputs}
    return [{makers[id(x)] for x in eqn.inputs if id(x) in makers} for eqn in node.eqns]


def _is_shared(node: Node, number: int, values: Values) -> bool:
    """Whether an equation's result is computed elsewhere, too."""
    outs = node.eqns[number].outputs
    return any(values.is_made_outside(var, node.first, node.end) for var in outs)


def _is_dear(eqn: Equation) -> bool:
    return _function_of(eqn) is not None or eqn.name in DEAR


def _from_outside(group: Sequence[Node]) -> dict[tuple[int, int], list[Any]]:
    """Return external operands of calls: by equation and index in it, for every call."""
    reads: dict[tuple[int, int], list[Any]] = {}
    for node in group:
        own_variables: set[Any] = set()
        for number, eqn in enumerate(node.eqns):
            for i, atom in enumerate(eqn.inputs):
                if isinstance(atom, Literal) or atom not in own_variables:
                    reads.setdefault((number, i), []).append(atom)
            own_variables.update(eqn.outputs)
    return reads


def _cost(eqn: Equation) -> float:
    name = eqn.name
    if _function_of(eqn) is not None:
        return 3.0
    size = float(sum(np.prod(getattr(var.aval, "shape", ())) for var in eqn.outputs))
    body = eqn.parameters.get("body")
    programs = eqn.parameters.get("branches", ()) if body is None else (body,)
    if programs:
        return sum((_cost(eqn) for one in programs for eqn in one.equations), 0.0)
    if name == "dot_general":
        (summed, _), _ = eqn.parameters["dimension_numbers"]
        operand: Any = eqn.inputs[0].aval
        return 2 * size * float(np.prod([operand.shape[axis] for axis in summed]))
    return 0.0 if name in MOVES else size
