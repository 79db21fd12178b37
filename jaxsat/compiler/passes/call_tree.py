"""Tree of the Python calls that the operations of a traced program come from."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from itertools import pairwise

from jaxsat.compiler.trace import is_wrapper
from jaxsat.core.jax_internals import Place
from jaxsat.core.jaxprs import Equation

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
