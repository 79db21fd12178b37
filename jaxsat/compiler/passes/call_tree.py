"""Tree of the Python calls that a traced program's operations come from, and its equal values."""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import numpy as np

from jaxsat.compiler.trace import is_wrapper
from jaxsat.core.fingerprint import parameter_text
from jaxsat.core.jax_internals import Place
from jaxsat.core.jaxprs import Equation, Jaxpr, Literal, Variable

Places = tuple[Place, ...]
"""Calls of an operation, the outermost first."""


@dataclass
class Node:
    """One call of a Python function, or the whole: equations `first` to before `end`, and calls.

    `eqns` are those of the resulting function, `before` those that are computed before its `call`.
    """

    name: str
    file: str
    caller: Places
    first: int
    end: int
    items: list["int | Node"]
    eqns: list[Equation] = field(default_factory=list)
    before: list[Equation] = field(default_factory=list)
    call: Equation | None = None

    @property
    def height(self) -> int:
        """Height of the tree of calls below."""
        return max((1 + x.height for x in self.items if isinstance(x, Node)), default=0)


def call_tree(eqns: Sequence[Equation], inside: int | None) -> Node:
    """Return the tree of a program's calls; a branch or a body is `inside` so many functions."""
    places = [place_of(eqn) for eqn in eqns]
    depth = _common(places)
    if inside is not None:
        depth = min(depth, max(inside - 1, 0))
    kinds = [(eqn.name, *(str(var.aval) for var in eqn.outputs)) for eqn in eqns]
    return _grown(places, 0, len(places), depth, kinds)


def place_of(eqn: Equation) -> Places:
    """Return the calls of an operation, without those of libraries that only call others."""
    return tuple([one for one in eqn.place if not is_wrapper(one.file)])


def nodes_of(node: Node) -> Iterator[Node]:
    """Yield a call and all below it."""
    yield node
    for item in node.items:
        if isinstance(item, Node):
            yield from nodes_of(item)


def _common(places: Sequence[Places]) -> int:
    """Return the number of outermost functions common to all, less one."""
    depth = 0
    least = min(map(len, places), default=1)
    while depth < least - 1 and len({place[: depth + 1] for place in places}) == 1:
        depth += 1
    return depth


def _grown(places: Sequence[Places], first: int, end: int, depth: int, kinds: list) -> Node:
    """Return the tree of the calls in a function at this depth of the places."""
    is_there = first < end and len(places[first]) > depth
    inside = places[first][depth] if is_there else Place("", "", 0, 0)
    node = Node(
        inside.function, inside.file, places[first][:depth] if first < end else (), first, end, []
    )
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


def _called_at(place: Places, depth: int):
    """Return place and callee of a call at this depth, or None for an own operation."""
    return (*place[depth], *place[depth + 1][:2]) if len(place) > depth + 1 else None


def _repeats(places, first: int, end: int, depth: int, kinds) -> list[tuple[int, int]]:
    """Split the calls of one function in one place, of which a loop makes several."""
    signs = [(kinds[i], places[i][depth:]) for i in range(first, end)]
    size = len(signs)
    for length in range(1, size // 2 + 1):
        if size % length == 0 and signs[length:] == signs[:-length]:
            return [(first + i, first + i + length) for i in range(0, size, length)]
    own = [place[depth][1:] if len(place) > depth else None for place in places[first:end]]
    begins = [i for i in range(1, size) if own[i] == own[0] != own[i - 1]]
    parts = list(pairwise([0, *begins, size]))
    if len({frozenset(own[begin:stop]) for begin, stop in parts}) > 1:
        return [(first, end)]  # a loop inside the function
    return [(first + begin, first + stop) for begin, stop in parts]


class Values:
    """Value numbering of a jaxpr's variables: equal numbers for the same operations.

    `uses` are the indices of equations that read a variable; the results come after all of them.
    """

    def __init__(self, jaxpr: Jaxpr, eqns: Sequence[Equation]):
        self._numbers: dict[Any, tuple[int, int]] = {}
        self._places: dict[tuple[int, int], list[int]] = {}
        self._same: dict[Any, Any] = {}
        self.uses: dict[Any, list[int]] = {}
        numbers: dict[Any, int] = {}
        for place, eqn in enumerate(eqns):
            key = (eqn.name, parameter_text(eqn), *map(self.identity, eqn.inputs))
            number = numbers.setdefault(key, len(numbers))
            for i, var in enumerate(eqn.outputs):
                self._numbers[var] = value = (number, i)
                self._places.setdefault(value, []).append(place)
            for atom in eqn.inputs:
                self._read(atom, place)
        for atom in jaxpr.outputs:
            self._read(atom, len(eqns))

    def _read(self, atom: Any, place: int) -> None:
        if isinstance(atom, Variable):
            self.uses.setdefault(atom, []).append(place)

    def identity(self, atom: Any) -> Any:
        """Return a key that only equal values share."""
        if isinstance(atom, Literal):
            value = np.asarray(atom.value)
            return (str(atom.aval), value.dtype.char, value.tobytes())
        return self._numbers.get(atom, id(atom))

    def is_made_outside(self, var: Any, first: int, end: int) -> bool:
        """Whether equations outside `first` to before `end` make the same value."""
        places = self._places.get(self._numbers.get(var, (-1, 0)), ())
        return any(not first <= place < end for place in places)

    def is_read_outside(self, var: Any, first: int, end: int) -> bool:
        """Whether equations outside `first` to before `end` read the variable."""
        return any(not first <= place < end for place in self.uses.get(var, ()))

    def unite(self, var: Any, other: Any) -> None:
        """Replace `other` by the variable from now on."""
        self._same[other] = var
        self.uses.setdefault(var, []).extend(self.uses.get(other, ()))

    def atom(self, atom: Any) -> Any:
        """Return the variable that now stands for this one."""
        while isinstance(atom, Variable) and atom in self._same:
            atom = self._same[atom]
        return atom


def without_repeated_calls(
    values: Values,
    eqns: Sequence[Equation],
    function_of: Callable[[Equation], Any],
    changed: Callable[..., Equation],
) -> list[Equation]:
    """Remove calls that repeat earlier ones.

    `function_of` gives the function of a call, and None for other equations; `changed` replaces
    parts of an equation.
    """
    unique: list[Equation] = []
    calls: dict[Any, int] = {}
    for eqn in eqns:
        renamed = tuple([values.atom(atom) for atom in eqn.inputs])
        if any(new is not old for new, old in zip(renamed, eqn.inputs, strict=True)):
            eqn = changed(eqn, inputs=renamed)
        function = function_of(eqn)
        if function is not None:
            key = (id(function), *map(values.identity, eqn.inputs))
            if key in calls:
                unique[calls[key]] = _with_results(values, unique[calls[key]], eqn, changed)
                continue
            calls[key] = len(unique)
        unique.append(eqn)
    return unique


def _with_results(values: Values, first: Equation, other: Equation, changed) -> Equation:
    """Return a call with the additional results of an equal one."""
    outs = []
    for one, two in zip(first.outputs, other.outputs, strict=True):
        if not (one.dropped or two.dropped):
            values.unite(one, two)
        outs.append(two if one.dropped else one)
    return changed(first, outputs=tuple(outs))
