"""What the statements of a C function need of the file that they are in."""

import abc
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from jaxsat.compiler.c.naming import Names
from jaxsat.compiler.ir import Function, Memory
from jaxsat.compiler.trace import Trace

POINTERS = ("p", "at", "in", "attitude", "seen", "now", "next", "out")
"""The structures that functions may be given, in the order of their parameters."""


@dataclass(frozen=True)
class CallSignature:
    """A function as it is called: which of its arrays are handed over, and how results come back:
    "field" is written where it belongs, "value" returned, and "pointer" written for the caller.

    `pointers` are the structures and `counts` the numbers that come before the arrays. If there are
    too many arrays, those handed over are fields of the record `arguments`, or results that
    come back by a pointer are those of `found`, or both.
    """

    name: str
    passed: Sequence[bool]
    results: Sequence[str]
    pointers: Sequence[str]
    counts: Sequence[str] = ()
    arguments: "Record | None" = None
    found: "Record | None" = None


@dataclass(frozen=True)
class Record:
    """A structure of arguments or results: the name of its type, and its fields as declared, by
    their names, in order."""

    kind: str
    fields: dict[str, str]

    def declaration(self) -> list[str]:
        """The lines that define the type."""
        fields = [f"  {one};" for one in self.fields.values()]
        return ["typedef struct {", *fields, f"}} {self.kind};", ""]


class AbstractUnit(abc.ABC):
    """A C file while it is printed: the `types` of pointers to structures, and the `shapes` of the
    arrays there."""

    types: dict[str, str]
    shapes: dict[str, tuple[int, ...]]

    @abc.abstractmethod
    def scope(self) -> Names:
        """The names of a function: none that the file has."""

    @abc.abstractmethod
    def need(self, name: str, dtype: np.dtype, other: np.dtype | None = None) -> str:
        """The name of a helper, which is printed once."""

    @abc.abstractmethod
    def memory(self, memory: Memory) -> str:
        """The name of an array of constants that is indexed."""

    @abc.abstractmethod
    def table(self, numbers: Sequence[np.generic], shape: tuple[int, ...], wish: str) -> str:
        """The name of an array of constants; equal ones are one."""

    @abc.abstractmethod
    def elementary(self, function: Function, trace: Trace) -> str:
        """The name of an elementary function of numbers."""

    @abc.abstractmethod
    def python(self, function: Function, trace: Trace) -> CallSignature:
        """A function of the Python code, printed once."""
