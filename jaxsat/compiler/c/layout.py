"""C structures made of trees: a named field for each array, in the words of the Python classes."""

import enum
import inspect
import re
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, cast

import equinox as eqx
import jax
import numpy as np
from jaxtyping import PyTree

from jaxsat.compiler.c.helpers import TYPES
from jaxsat.compiler.c.naming import Names, comment, identifier
from jaxsat.compiler.lowering import number_type


@dataclass(frozen=True)
class Field:
    """One array of a tree as a field: `about` is the docstring of its class, the `owner`.

    `number` is the index of the array in the tree, `choices` the enumeration of its numbers, if the
    class declares one: `field: Annotated[type, choices]`.
    """

    name: str
    dtype: np.dtype
    shape: tuple[int, ...]
    path: str
    owner: str
    about: str
    number: int = 0
    choices: type[enum.IntEnum] | None = None

    @property
    def declaration(self) -> str:
        """Type, name and dimensions of the field."""
        return f"{TYPES[self.dtype]} {self.name}{''.join(f'[{n}]' for n in self.shape)}"

    @property
    def size(self) -> int:
        """Number of elements."""
        return int(np.prod(self.shape))

    def elements(self, struct: str) -> list[str]:
        """Return its elements in order, as C expressions."""
        return [
            f"{struct}{self.name}" + "".join(f"[{i}]" for i in index)
            for index in np.ndindex(self.shape)
        ]


@dataclass(frozen=True)
class Struct:
    """A structure type and its fields."""

    name: str
    about: str
    fields: tuple[Field, ...]

    def declaration(self) -> list[str]:
        """Return the type as C text, with each class's docstring before its fields."""
        lines = [*comment(self.about), "typedef struct {"]
        owner = None
        for field in self.fields:
            if field.owner != owner:
                owner = field.owner
                if field.about:
                    lines += comment(f"{field.owner}: {field.about}", "  ")
            first, *rest = comment(field.path)
            lines += [f"  {field.declaration}; {first}", *rest]
        if not self.fields:
            lines.append("  uint8_t unused; /* a structure must have a field */")
        return [*lines, f"}} {self.name};"]

    def layout(self) -> list[str]:
        """Return name and fields without comments, which determine the compiled layout."""
        return [self.name, *(field.declaration for field in self.fields)]

    @property
    def size(self) -> int:
        """Number of elements of all fields."""
        return sum(field.size for field in self.fields)

    def elements(self, struct: str) -> list[str]:
        """Return all elements in order, as C expressions."""
        return [text for field in self.fields for text in field.elements(struct)]


def fields_of(tree: PyTree, names: Names) -> tuple[Field, ...]:
    """Return the fields of a tree in the order of its leaves."""
    fields = []
    for number, (path, leaf) in enumerate(jax.tree_util.tree_leaves_with_path(tree)):
        owner, about = _owner(tree, path)
        words = [_word(key) for key in path]
        name = names.new(identifier(*words))
        aval = jax.typeof(leaf) if isinstance(leaf, jax.Array) else leaf
        path_text = re.sub(r"\['(\w+)'\]", r".\1", jax.tree_util.keystr(path)).lstrip(".") or name
        dtype, shape = number_type(aval.dtype), tuple(aval.shape)
        choices = _choices(tree, path)
        fields.append(Field(name, dtype, shape, path_text, owner, about, number, choices))
    return tuple(field for field in fields if field.size)


def parameter_fields(tree: PyTree) -> tuple[list[Any], tuple[Field, ...], list[int]]:
    """Return the distinct arrays of a tree, their fields, and the index of the array of each leaf.

    An array that several parts share has the name in which their paths end alike.
    """
    paths: dict[int, list[tuple]] = {}
    arrays: list[Any] = []
    place: dict[int, int] = {}
    order = []
    for path, leaf in jax.tree_util.tree_leaves_with_path(tree):
        if id(leaf) not in place:
            place[id(leaf)] = len(arrays)
            arrays.append(leaf)
        paths.setdefault(place[id(leaf)], []).append(path)
        order.append(place[id(leaf)])
    names, fields = Names(fields=True), []
    for number, leaf in enumerate(arrays):
        words = [[_word(key) for key in path] for path in paths[number]]
        common = _common_end(words)
        owner, about = _owner(tree, paths[number][0])
        name = names.new(identifier(*common))
        text = ".".join(common)
        fields.append(
            Field(name, number_type(leaf.dtype), tuple(leaf.shape), text, owner, about, number)
        )
    return arrays, tuple(field for field in fields if field.size), order


def _common_end(words: Sequence[Sequence[str]]) -> Sequence[str]:
    shortest = min(map(len, words))
    if len(words) == 1:
        return words[0]
    length = 1
    while length < shortest and len({tuple(w[-length - 1 :]) for w in words}) == 1:
        length += 1
    return words[0][-length:]


def _word(key: Any) -> str:
    for attribute in ("name", "key", "idx"):
        if hasattr(key, attribute):
            return str(getattr(key, attribute))
    return str(key)


def _owner(tree: PyTree, path: tuple) -> tuple[str, str]:
    """Return the class of which a leaf is a field, and its docstring."""
    owner, now = type(tree), cast(Any, tree)
    for key in path:
        if hasattr(now, "_fields") or issubclass(type(now), eqx.Module):
            owner = type(now)
        name, index = getattr(key, "name", None), getattr(key, "idx", getattr(key, "key", None))
        now = getattr(now, name) if name is not None else now[index]
    if owner in (tuple, list, dict):
        return "", ""
    return owner.__name__, about(owner)


def _choices(tree: PyTree, path: tuple) -> type[enum.IntEnum] | None:
    """Return the enumeration that annotates a leaf, or None."""
    owner = cast(Any, tree)
    for key in path[:-1]:
        name, index = getattr(key, "name", None), getattr(key, "idx", getattr(key, "key", None))
        owner = getattr(owner, name) if name is not None else owner[index]
    name = getattr(path[-1], "name", "") if path else ""
    for one in type(owner).__mro__:
        hint = inspect.get_annotations(one).get(name)
        if hint is not None:
            kinds = [kind for kind in getattr(hint, "__metadata__", ()) if isinstance(kind, type)]
            return next((kind for kind in kinds if issubclass(kind, enum.IntEnum)), None)
    return None


def about(owner: type) -> str:
    """Return a class's docstring as one paragraph."""
    if owner.__doc__ is None or owner.__doc__.startswith(f"{owner.__name__}("):
        return ""
    text = inspect.cleandoc(owner.__doc__)
    return re.sub(r"\s+", " ", text)
