"""Interface of a C file to the statements of its functions."""

import abc
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jaxsat.compiler.c.naming import Names
from jaxsat.compiler.ir import Function, Memory
from jaxsat.compiler.trace import Trace

POINTERS = ("p", "at", "in", "attitude", "seen", "now", "next", "out")
"""Structures that functions may take, in the order of their parameters."""


@dataclass(frozen=True)
class CallSignature:
    """Signature of a function: the arrays that are passed, and how results come back.

    A result is a "field" written where it belongs, a returned "value", or a "pointer" written for
    the caller. `pointers` are the structures and `counts` the numbers before the arrays. With too
    many arrays, those passed are fields of the record `arguments`, or results that come back by a
    pointer are those of `outputs`, or both.
    """

    name: str
    passed: Sequence[bool]
    results: Sequence[str]
    pointers: Sequence[str]
    counts: Sequence[str] = ()
    arguments: "Record | None" = None
    outputs: "Record | None" = None


@dataclass(frozen=True)
class Record:
    """A structure of arguments or results: the name of its type, and declared fields by name."""

    kind: str
    fields: dict[str, str]

    def declaration(self) -> list[str]:
        """Return the lines that define the type."""
        fields = [f"  {one};" for one in self.fields.values()]
        return ["typedef struct {", *fields, f"}} {self.kind};", ""]


class AbstractUnit(abc.ABC):
    """A C file during printing: `types` of pointers to structures, and `shapes` of their arrays."""

    types: dict[str, str]
    shapes: dict[str, tuple[int, ...]]

    @abc.abstractmethod
    def scope(self) -> Names:
        """Return a new scope of names of a function, none of which the file has."""

    @abc.abstractmethod
    def need(self, name: str, dtype: np.dtype, other: np.dtype | None = None) -> str:
        """Return the name of a helper, which is printed once."""

    @abc.abstractmethod
    def memory(self, memory: Memory) -> str:
        """Return the name of an indexed array of constants."""

    @abc.abstractmethod
    def table(self, numbers: Sequence[np.generic], shape: tuple[int, ...], wish: str) -> str:
        """Return the name of an array of constants; equal ones are shared."""

    @abc.abstractmethod
    def elementary(self, function: Function, trace: Trace) -> str:
        """Return the name of an elementary function of numbers."""

    @abc.abstractmethod
    def python(self, function: Function, trace: Trace) -> CallSignature:
        """Print a function of the Python code once, and return its signature."""
