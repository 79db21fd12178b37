"""Text of LLVM code during printing: types, constants, modules, names, operands, memory."""

import abc
import struct
from collections.abc import Callable

import numpy as np

from jaxsat.compiler.ir import Block, Function, Memory, Scalar, Value, numbers_of
from jaxsat.compiler.llvm.threads import STACK
from jaxsat.compiler.lowering import CannotLower
from jaxsat.core.once import once

TYPES = {"float64": "double", "float32": "float", "bool": "i1"} | {
    f"{sign}int{bits}": f"i{bits}" for sign in ("", "u") for bits in (8, 16, 32, 64)
}


@once
def scalar_type(dtype: np.dtype) -> str:
    """Return the type of one number."""
    return TYPES[dtype.name]


def vector_of(kind: str, lanes: int) -> str:
    """Return the type of a scalar of this type in every lane.

    One lane is a scalar: LLVM would turn the vector into one anyway.
    """
    return kind if lanes == 1 else f"<{lanes} x {kind}>"


@once
def vector_type(dtype: np.dtype, lanes: int) -> str:
    """Return the type of a number in every lane."""
    return vector_of(scalar_type(dtype), lanes)


def splat(typed: str, lanes: int) -> str:
    """Return a constant, given with its type before it, in every lane."""
    return typed.split(" ", 1)[1] if lanes == 1 else f"splat ({typed})"


def extract(kind: str, lanes: int, vector: str, lane: int) -> str:
    """Return the instruction that takes the number of a lane out of a vector."""
    if lanes == 1:
        return f"bitcast {kind} {vector} to {kind}"
    return f"extractelement {vector_of(kind, lanes)} {vector}, i64 {lane}"


def insert(kind: str, lanes: int, vector: str, number: str, lane: int) -> str:
    """Return the instruction that puts a number into a lane of a vector."""
    if lanes == 1:
        return f"bitcast {kind} {number} to {kind}"
    return f"insertelement {vector_of(kind, lanes)} {vector}, {kind} {number}, i64 {lane}"


def type_of(x, lanes: int) -> str:
    """Return the type of a value of the program; constants are scalars."""
    uniform = not isinstance(x, Value) or x.uniform
    return scalar_type(x.dtype) if uniform else vector_type(x.dtype, lanes)


def memory_type(dtype: np.dtype) -> str:
    """Return the type of one number in memory."""
    return "i8" if dtype.kind == "b" else scalar_type(dtype)


def constant(x: np.generic) -> str:
    """Return the text of a number."""
    if x.dtype.kind == "b":
        return "true" if x else "false"
    if x.dtype.kind == "f":
        return f"0x{struct.unpack('<Q', struct.pack('<d', float(x)))[0]:016X}"
    return str(int(x))


def conversion(old: np.dtype, new: np.dtype) -> str:
    """Return the instruction that converts between types, except from floats to integers."""
    if old.kind == "f":
        return "fptrunc" if new.itemsize < old.itemsize else "fpext"
    if new.kind == "f":
        return "sitofp" if old.kind == "i" else "uitofp"
    if old.kind == "b" or new.itemsize > old.itemsize:
        return "sext" if old.kind == "i" else "zext"
    return "trunc" if new.itemsize < old.itemsize else "bitcast"


def suffix(dtype: np.dtype, lanes: int | None) -> str:
    """Return the suffix of an intrinsic function's name: v16f64 or f64."""
    kind = "f" if dtype.kind == "f" else "i"
    bits = 1 if dtype.kind == "b" else dtype.itemsize * 8
    return f"{kind}{bits}" if lanes in (None, 1) else f"v{lanes}{kind}{bits}"


COLD = "!0"
"""Weights of a switch whose second branch hardly ever runs, to keep its costs out of the first."""

ON_STACK = 64 << 10
"""Largest total size of a module's memories on the stack, bytes; others are in its arena."""

MAX_ARENA = 1 << 30
"""Largest size of an arena, bytes; every thread has one."""

ALIGNMENT = 128
"""Alignment of memory for vectors, bytes: that of the largest vector."""

NUMBER = 8
"""Bytes of the largest number."""

LARGEST = STACK // 2
"""Largest total size of a module's values, bytes, so that any of them may be on the stack."""


LANES = (1, 2, 4, 8, 16)
"""Allowed numbers of cases in a vector: its cells have no gaps, and are aligned."""


def require_lanes(lanes: int, name: str = "lanes") -> None:
    """Raise `ValueError` for a number of lanes that no vector has."""
    if lanes not in LANES:
        raise ValueError(f"Argument `{name}` must be 1, 2, 4, 8 or 16, but got {lanes}.")


class Module:
    """Text of a module: functions, constant arrays and declarations.

    With `masks` the processor stores some lanes of a vector at once. A module that `fuses` has
    products and sums as one operation with one rounding (`FunctionEmitter`). Memories too large for
    the stack are in the *arena*, `arena` bytes that the caller provides to each of its threads.
    Every memory has its own place in it, as there is no recursion.
    """

    def __init__(self, lanes: int, masks: bool = False, fuses: bool = False):
        require_lanes(lanes)
        self.lanes, self.masks, self.fuses = lanes, masks, fuses
        self.functions: dict[str, str] = {}
        self.printed: dict[int, tuple[str, Function, bool]] = {}  # by identity: `llvm.internal`
        self._constants: dict[int, str] = {}  # by the number of the memory
        self.declarations: set[str] = set()
        self.arena = self._on_stack = 0
        self._offsets: dict[int, int | None] = {}  # by the number of the memory

    def offset(self, memory: Memory) -> int | None:
        """Return the offset of a memory in the arena; None if it is on the stack.

        Raises `CannotLower` where the arena becomes too large.
        """
        if memory.number not in self._offsets:
            room = memory.size * memory.dtype.itemsize * (1 if memory.uniform else self.lanes)
            room = -(-room // ALIGNMENT) * ALIGNMENT
            self._offsets[memory.number] = None
            if self._on_stack + room <= ON_STACK:
                self._on_stack += room
            elif self.arena + room > MAX_ARENA:
                raise CannotLower(
                    f"Its arrays would take more than {MAX_ARENA >> 20} MiB in every thread"
                )
            else:
                self._offsets[memory.number] = self.arena
                self.arena += room
        return self._offsets[memory.number]

    def constant(self, memory: Memory) -> str:
        """Return the name of a memory that is never written, the same in all functions."""
        if memory.number not in self._constants:
            assert memory.initial is not None
            kind = memory_type(memory.dtype)
            numbers = ", ".join(
                f"{kind} {constant(x) if kind != 'i8' else int(x)}" for x in memory.initial
            )
            head = f"@c{len(self._constants)} = internal constant [{memory.size} x {kind}]"
            self._constants[memory.number] = f"{head} [{numbers}], align 128"
        return self._constants[memory.number].split(" ", 1)[0]

    def text(self, attributes: str) -> str:
        """Return the whole text, every function with these attributes.

        Raises `CannotLower` for so many lines that their values might not all be on the stack.
        """
        lines = sum(text.count("\n") for text in self.functions.values())
        if lines * self.lanes * NUMBER > LARGEST:
            raise CannotLower(f"It would become {lines} lines of LLVM code")
        parts = [*self._constants.values(), *self.functions.values(), *sorted(self.declarations)]
        attributes = f"attributes #0 = {{ {attributes} }}"
        weights = f'{COLD} = !{{!"branch_weights", i32 100000, i32 1}}'
        return "\n".join([*parts, attributes, weights, ""])


class AbstractEmitter(abc.ABC):
    """Lines of one function during printing: access to values and memory."""

    def __init__(self, module: Module):
        self.module = module
        self.written: list[str] = []
        self._first: list[str] = []
        self.in_arena = False  # whether it needs %arena, the arena's address
        self._count = 0
        self.label = "entry"
        self.spread: list[dict[int | tuple[str, int], str]] = [{}]
        self.readers: dict[int, Callable[[str], None]] = {}
        self.outside: dict[int, Callable[[], str]] = {}  # addresses of values in arrays, by number
        self._memories: dict[int, str] = {}
        self._names: dict[int, str] = {}

    def text(self) -> list[str]:
        """Return its lines, stack memory first."""
        return ["entry:", *self._first, *self.written]

    def line(self, line: str) -> None:
        """Append a line."""
        self.written.append(line)

    def fresh(self, prefix: str = "t") -> str:
        """Return an unused name."""
        self._count += 1
        return f"%{prefix}{self._count}"

    def name(self, value: Value) -> str:
        """Return the name of a value; one with a reader is read again in every block."""
        reader = self.readers.get(value.number)
        if reader is None:
            return self._names.setdefault(value.number, f"%v{len(self._names)}")
        return self.once_in_block(("value", value.number), reader)

    def once_in_block(self, key: tuple[str, int], reader: Callable[[str], None]) -> str:
        """Return the name of what `reader` names, here or in an enclosing block."""
        for names in reversed(self.spread):
            if key in names:
                return names[key]
        out = self.fresh("r")
        reader(out)
        self.spread[-1][key] = out
        return out

    def operand(self, x: Scalar, varying: bool = False) -> str:
        """Return a value or constant, spread over all lanes if `varying`."""
        if not isinstance(x, Value):
            if not varying:
                return constant(x)
            return splat(f"{scalar_type(x.dtype)} {constant(x)}", self.module.lanes)
        if not varying or not x.uniform or self.module.lanes == 1:
            return self.name(x)
        for names in reversed(self.spread):
            if x.number in names:
                return names[x.number]
        wide = vector_type(x.dtype, self.module.lanes)
        one, all_ = self.fresh(), self.fresh()
        kind = scalar_type(x.dtype)
        self.line(f"{one} = {insert(kind, self.module.lanes, 'poison', self.name(x), 0)}")
        self.line(
            f"{all_} = shufflevector {wide} {one}, {wide} poison, "
            f"<{self.module.lanes} x i32> zeroinitializer"
        )
        self.spread[-1][x.number] = all_
        return all_

    @abc.abstractmethod
    def steps(self, block: Block) -> None:
        """Print the steps of a block."""

    def kind(self, dtype: np.dtype, wide: bool) -> str:
        """Return the type of a number, in all lanes if `wide`."""
        return vector_type(dtype, self.module.lanes) if wide else scalar_type(dtype)

    def begin(self, label: str) -> None:
        """Begin a basic block with its label."""
        self.line(f"{label}:")
        self.label = label

    def memory(self, memory: Memory) -> str:
        """Return the name of a memory, created on first use, or the address of an external one."""
        if memory.elements:
            return self.outside[numbers_of(memory.elements)[0]]()
        if memory.number in self._memories:
            return self._memories[memory.number]
        kind = memory_type(memory.dtype)
        if memory.initial is not None:
            name = self.module.constant(memory)
        else:
            name, offset = f"%m{len(self._memories)}", self.module.offset(memory)
            if offset is None:
                room = memory.size * (1 if memory.uniform else self.module.lanes)
                self._first.append(f"{name} = alloca [{room} x {kind}], align {ALIGNMENT}")
            else:
                self.in_arena = True
                self._first.append(f"{name} = getelementptr i8, ptr %arena, i64 {offset}")
        self._memories[memory.number] = name
        return name

    def address(self, memory: Memory, index: Scalar) -> str:
        """Return the address of an element of a memory, by a uniform index."""
        place, kind = self.fresh("p"), memory_type(memory.dtype)
        cell = kind if memory.uniform else vector_of(kind, self.module.lanes)
        typed = f"{scalar_type(index.dtype)} {self.operand(index)}"
        self.line(f"{place} = getelementptr {cell}, ptr {self.memory(memory)}, {typed}")
        return place

    def put(self, place: str, value: str, dtype: np.dtype, wide: bool) -> None:
        """Write a value to memory."""
        kind = self.kind(dtype, wide)
        if dtype.kind == "b":
            byte, small = self.fresh(), vector_of("i8", self.module.lanes if wide else 1)
            self.line(f"{byte} = zext {kind} {value} to {small}")
            kind, value = small, byte
        self.line(f"store {kind} {value}, ptr {place}")

    def get(self, out: str, place: str, dtype: np.dtype, wide: bool) -> None:
        """Read a value from memory."""
        kind = self.kind(dtype, wide)
        if dtype.kind == "b":
            byte, small = self.fresh(), vector_of("i8", self.module.lanes if wide else 1)
            self.line(f"{byte} = load {small}, ptr {place}")
            self.line(f"{out} = icmp ne {small} {byte}, zeroinitializer")
        else:
            self.line(f"{out} = load {kind}, ptr {place}")
