"""Traced programs cut into functions again, as the Python code is that they come from.

A jaxpr holds the operations of all the Python functions that were called, one after the other.
Every operation knows the calls that it comes from, so that each call can be put back: equal ones
become calls of one function, and long ones functions of their own.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from typing import Any

import jax
import numpy as np
from jax._src import source_info_util
from jax.extend.core import ClosedJaxpr, DebugInfo, DropVar, Jaxpr, JaxprEqn, Literal, Var

from jaxsat.engine.fingerprint import told_parameters
from jaxsat.engine.native.builder import Frame
from jaxsat.engine.native.lowering import is_wrapper

SHARED, LONE = 10, 40
"""Operations on numbers that a function has at least if it is called several times, or once."""

OFTEN = 5
"""Calls of a function, out of which what depends on parameters alone is worth taking."""

MOVES = frozenset((
    "slice", "squeeze", "reshape", "broadcast_in_dim", "concatenate", "transpose", "stack",
    "convert_element_type", "iota", "copy", "copy_p", "expand_dims", "rev", "pad", "split",
    "stop_gradient", "gather", "dynamic_slice", "scatter",
))  # fmt: skip
"""Primitives that only move numbers."""

Place = tuple[tuple[str, str, int, int], ...]
"""The calls of an operation, from the outermost: function, file, line and column."""


@dataclass
class Outline:
    """The functions of a program: jaxprs by identity with their names, files and how often they are
    called, and the frames of the calls by the identity of their equations."""

    functions: dict[int, tuple[ClosedJaxpr, str, str, int]] = field(default_factory=dict)
    frames: dict[int, tuple[Frame, ...]] = field(default_factory=dict)

    kept: list[Any] = field(default_factory=list)
    """What identities belong to must stay alive."""
    steady: set[Any] = field(default_factory=set)
    """Variables that are the same whenever the program runs."""


@dataclass
class _Node:
    """One call of a Python function, or the whole: equations `first` to before `end`, and calls."""

    name: str
    file: str
    caller: Place
    first: int
    end: int
    items: list["int | _Node"]
    eqns: list[JaxprEqn] = field(default_factory=list)
    before: list[JaxprEqn] = field(default_factory=list)
    call: JaxprEqn | None = None

    @property
    def height(self) -> int:
        """Of the tree of calls below."""
        return max((1 + x.height for x in self.items if isinstance(x, _Node)), default=0)


def outlined(closed: ClosedJaxpr, steady: int = 0) -> tuple[ClosedJaxpr, Outline]:
    """The program with calls of functions in it; the first so many inputs are parameters.

    What follows from parameters alone is computed before a function that is called several times,
    not in it.
    """
    outline = Outline(steady=set(closed.jaxpr.invars[:steady]))
    return _outlined(outline, closed, None), outline


def _outlined(outline: Outline, closed: ClosedJaxpr, inside: int | None) -> ClosedJaxpr:
    """The same of a branch or a loop's body, `inside` so many functions."""
    jaxpr = closed.jaxpr
    eqns = [_with_inner(outline, eqn) for eqn in jaxpr.eqns]
    places = [_place(eqn) for eqn in eqns]
    depth = _common(places)
    if inside is not None:
        depth = min(depth, max(inside - 1, 0))
    root = _grown(places, 0, len(places), depth, _signatures(eqns))
    uses = _uses(jaxpr)
    levels: dict[int, list[_Node]] = {}
    for node in _nodes(root):
        levels.setdefault(node.height, []).append(node)
    for height in sorted(levels):
        groups: dict[Any, list[_Node]] = {}
        for node in levels[height]:
            node.eqns = list(_contents(node, eqns))
            if node is not root:
                groups.setdefault(_shape(node), []).append(node)
        for group in groups.values():
            _make(outline, group, uses)
    contents = list(_contents(root, eqns))
    whole = Jaxpr(
        jaxpr.constvars, jaxpr.invars, jaxpr.outvars, contents, jaxpr.effects, jaxpr.debug_info
    )
    return ClosedJaxpr(whole, closed.consts)


def _with_inner(outline: Outline, eqn: JaxprEqn) -> JaxprEqn:
    """An equation whose branches or body are cut as well."""
    if eqn.primitive.name not in ("cond", "scan", "while"):
        return eqn
    depth = len(_place(eqn))
    params = dict(eqn.params)
    for key, inner in params.items():
        if isinstance(inner, ClosedJaxpr):
            params[key] = _outlined(outline, inner, depth)
        elif key == "branches":
            params[key] = tuple(_outlined(outline, branch, depth) for branch in inner)
    return eqn.replace(params=params)


def _place(eqn: JaxprEqn) -> Place:
    frames = source_info_util.user_frames(eqn.source_info.traceback)
    return tuple(
        (frame.function_name, frame.file_name, frame.start_line, frame.start_column)
        for frame in frames
        if not is_wrapper(frame.file_name)
    )[::-1]


def _common(places: Sequence[Place]) -> int:
    """How many of the outermost functions are the same for all, one less."""
    depth = 0
    least = min(map(len, places), default=1)
    while depth < least - 1 and len({place[: depth + 1] for place in places}) == 1:
        depth += 1
    return depth


def _signatures(eqns: Sequence[JaxprEqn]) -> list[tuple]:
    return [(eqn.primitive.name, *(str(var.aval) for var in eqn.outvars)) for eqn in eqns]


def _grown(places: Sequence[Place], first: int, end: int, depth: int, kinds: list) -> _Node:
    """The tree of the calls in a function that stands at this depth of the places."""
    inside = places[first][depth] if first < end and len(places[first]) > depth else ("", "", 0, 0)
    node = _Node(inside[0], inside[1], places[first][:depth] if first < end else (), first, end, [])
    here = first
    while here < end:
        key = _called_at(places[here], depth)
        if key is None:
            node.items.append(here)
            here += 1
            continue
        after = here + 1
        while after < end and _called_at(places[after], depth) == key:
            after += 1
        for begin, stop in _repeats(places, here, after, depth + 1, kinds):
            node.items.append(_grown(places, begin, stop, depth + 1, kinds))
        here = after
    return node


def _called_at(place: Place, depth: int):
    """From where a function at this depth calls which one, or None for an operation of its own."""
    return (*place[depth], *place[depth + 1][:2]) if len(place) > depth + 1 else None


def _repeats(places, first: int, end: int, depth: int, kinds) -> list[tuple[int, int]]:
    """The calls of one function in one place: a loop makes several of them."""
    signs = [(kinds[i], places[i][depth:]) for i in range(first, end)]
    size = len(signs)
    for length in range(1, size // 2 + 1):
        if size % length == 0 and signs[length:] == signs[:-length]:
            return [(first + i, first + i + length) for i in range(0, size, length)]
    return [(first, end)]


def _nodes(node: _Node) -> Iterator[_Node]:
    yield node
    for item in node.items:
        if isinstance(item, _Node):
            yield from _nodes(item)


def _uses(jaxpr: Jaxpr) -> dict[Any, list[Any]]:
    """Where variables are read, by the numbers of equations; the results after all of them."""
    uses: dict[Any, list[Any]] = {}
    for number, eqn in enumerate(jaxpr.eqns):
        for atom in eqn.invars:
            if isinstance(atom, Var):
                uses.setdefault(atom, []).append(number)
    for atom in jaxpr.outvars:
        if isinstance(atom, Var):
            uses.setdefault(atom, []).append(np.inf)
    return uses


def _contents(node: _Node, eqns: Sequence[JaxprEqn]) -> Iterator[JaxprEqn]:
    """The equations of a call, those of the calls inside it put back as calls where they are."""
    for item in node.items:
        if isinstance(item, int):
            yield eqns[item]
        elif item.call is not None:
            yield from item.before
            yield item.call
        else:
            yield from item.eqns


def _shape(node: _Node) -> tuple:
    """What is alike for calls of one function: all but the variables that come from outside."""
    numbers: dict[Any, tuple[int, int]] = {}
    told = []
    for number, eqn in enumerate(node.eqns):
        read = []
        for atom in eqn.invars:
            inside = numbers.get(atom) if isinstance(atom, Var) else None
            read.append(inside or str(atom.aval))
        told.append((eqn.primitive.name, _params_of(eqn), *read))
        numbers |= {var: (number, i) for i, var in enumerate(eqn.outvars)}
    return (node.name, node.file, *told)


def _params_of(eqn: JaxprEqn) -> str:
    inner = eqn.params.get("jaxpr")
    if inner is not None and str(eqn.params.get("name", "")).startswith(MARK):
        return f"{MARK}{id(inner)}"
    return told_parameters(eqn)


MARK = "python:"
"""Begin of the names of functions made here."""


def _make(outline: Outline, group: list[_Node], uses: dict[Any, list[Any]]) -> None:
    """Put calls of one function in the place of equal ones, if that makes the program clearer."""
    one = group[0]
    cost = sum(map(_cost, one.eqns))
    if one.name.split(".")[-1].startswith("<") or cost < (SHARED if len(group) > 1 else LONE):
        return
    if len(one.eqns) == 1 and str(one.eqns[0].params.get("name", "")).startswith(MARK):
        return  # hands on what it is given
    if len(group) >= OFTEN:
        _put_before(outline, group)
    sources = _from_outside(group)
    places: dict[tuple, list[tuple[int, int]]] = {}
    for where, atoms in sources.items():
        places.setdefault(tuple(map(_identity, atoms)), []).append(where)
    eqns = list(one.eqns)
    params: list[Any] = []
    args: list[list[Any]] = [[] for _ in group]
    for identities, wheres in places.items():
        atoms = sources[wheres[0]]
        if isinstance(atoms[0], Literal) and len(set(identities)) == 1:
            continue
        param = Var(atoms[0].aval)
        params.append(param)
        for number, place in wheres:
            read = list(eqns[number].invars)
            read[place] = param
            changed = eqns[number].replace(invars=read)
            if id(eqns[number]) in outline.frames:
                outline.frames[id(changed)] = outline.frames[id(eqns[number])]
                outline.kept.append(changed)
            eqns[number] = changed
        for arg, atom in zip(args, atoms, strict=True):
            arg.append(atom)
    results = [
        (number, i)
        for number, eqn in enumerate(one.eqns)
        for i in range(len(eqn.outvars))
        if any(_is_read_outside(node, node.eqns[number].outvars[i], uses) for node in group)
    ]
    if not results:
        return
    outs = [eqns[number].outvars[i] for number, i in results]
    told = DebugInfo("jit", one.name, ("",) * len(params), ("",) * len(outs))
    closed = ClosedJaxpr(Jaxpr((), params, outs, eqns, debug_info=told), ())
    outline.functions[id(closed)] = (closed, one.name, one.file, len(group))

    for node, given in zip(group, args, strict=True):
        made: list[Any] = []
        for number, i in results:
            var = node.eqns[number].outvars[i]
            made.append(DropVar(outs[len(made)].aval) if isinstance(var, DropVar) else var)
        node.call = _call(closed, f"{MARK}{one.name}", given, made, one.eqns[0])
        frames = tuple(
            Frame(name.split(".<locals>")[0], file, line) for name, file, line, _ in node.caller
        )
        outline.frames[id(node.call)] = frames
        outline.kept.append(node.call)


def _put_before(outline: Outline, group: Sequence[_Node]) -> None:
    """Calls that depend on parameters alone, out of the functions."""
    every = zip(*(node.eqns for node in group), strict=True)
    moved = {
        number for number, eqns in enumerate(every) if all(_is_steady(outline, e) for e in eqns)
    }
    for node in group:
        node.before = [eqn for number, eqn in enumerate(node.eqns) if number in moved]
        node.eqns = [eqn for number, eqn in enumerate(node.eqns) if number not in moved]
        outline.steady.update(var for eqn in node.before for var in eqn.outvars)


def _is_steady(outline: Outline, eqn: JaxprEqn) -> bool:
    is_call = str(eqn.params.get("name", "")).startswith(MARK)
    return is_call and all(isinstance(x, Literal) or x in outline.steady for x in eqn.invars)


def _from_outside(group: Sequence[_Node]) -> dict[tuple[int, int], list[Any]]:
    """What calls read that they do not make: by equation and place in it, for every call."""
    found: dict[tuple[int, int], list[Any]] = {}
    for node in group:
        made: set[Any] = set()
        for number, eqn in enumerate(node.eqns):
            for i, atom in enumerate(eqn.invars):
                if isinstance(atom, Literal) or atom not in made:
                    found.setdefault((number, i), []).append(atom)
            made.update(eqn.outvars)
    return found


def _identity(atom: Any):
    if isinstance(atom, Literal):
        value = np.asarray(atom.val)
        return (str(atom.aval), value.dtype.char, value.tobytes())
    return id(atom)


def _is_read_outside(node: _Node, var: Any, uses: dict[Any, list[Any]]) -> bool:
    return any(not node.first <= place < node.end for place in uses.get(var, ()))


def _cost(eqn: JaxprEqn) -> float:
    """About how many operations on numbers an equation is."""
    name = eqn.primitive.name
    if str(eqn.params.get("name", "")).startswith(MARK):
        return 3.0
    size = sum(float(np.prod(getattr(var.aval, "shape", ()))) for var in eqn.outvars)
    inner = [eqn.params.get(key) for key in ("jaxpr", "call_jaxpr", "body_jaxpr")]
    branches = [*filter(None, inner), *eqn.params.get("branches", ())]
    if branches:
        return sum(sum(map(_cost, getattr(one, "jaxpr", one).eqns)) for one in branches)
    if name == "dot_general":
        (summed, _), _ = eqn.params["dimension_numbers"]
        left: Any = eqn.invars[0].aval
        return 2 * size * float(np.prod([left.shape[axis] for axis in summed]))
    return 0.0 if name in MOVES else size


def _call(closed: ClosedJaxpr, name: str, args: list, outs: list, like: JaxprEqn) -> JaxprEqn:
    """A call as JAX has it of a compiled function."""
    example = jax.make_jaxpr(jax.jit(lambda x: x + 1))(1.0).eqns[0]
    params: Any = example.params | {"jaxpr": closed, "name": name}
    return example.replace(
        invars=args, outvars=outs, params=params, source_info=like.source_info, ctx=like.ctx
    )
