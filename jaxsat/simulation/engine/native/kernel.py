"""Machine code of a trajectory's entry points, and its calls."""

import ctypes
import operator
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any, cast

import jax
import numpy as np
from jaxtyping import PyTree

from jaxsat.compiler.llvm import cache, target
from jaxsat.compiler.llvm.arguments import AlignedMemory, addresses
from jaxsat.compiler.llvm.drivers import HISTORY, RUN, advance_lanes, history, run_blocks, run_lanes
from jaxsat.compiler.llvm.emitter import Module
from jaxsat.compiler.llvm.entry_points import emit_entry_point
from jaxsat.compiler.llvm.threads import in_own_thread, in_threads
from jaxsat.core.fingerprint import fingerprint
from jaxsat.core.once import once_property
from jaxsat.simulation.engine.interface import stops
from jaxsat.simulation.engine.native.kernel_store import (
    Entries,
    EntryName,
    StoredKernel,
    StoredObserver,
)
from jaxsat.simulation.engine.native.trajectory import LoweredTrajectory

PIECE = 4
"""Number of vectors of cases that a thread takes at a time."""

REFILLED = 64
"""Largest such number where a lane that has ended takes the next case."""

WATCHED = 4096
"""Number of instants of a history between two checks for a stop."""

OBSERVE = "observe"

ENTRY_POINT = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4, *[ctypes.c_int64] * 2)

Trees = Mapping[str, PyTree]
"""Cases (with their axis), a list of the numbers, and gains, by these names."""


class Kernel:
    """A program's entry points as machine code for vectors of `lanes` cases.

    `lower` returns them; for a stored kernel, which has a name, only when they are read.
    """

    def __init__(
        self, lower: Callable[[], LoweredTrajectory], lanes: int, name: EntryName | None = None
    ):
        self._lower, self.lanes, self._entries = lower, lanes, Entries(name)
        self._made = self._entries.look_up(StoredKernel, lambda: self._make(name is not None))
        entries = dict.fromkeys(["begin", "advance", "finish"], ENTRY_POINT)
        self._functions = _link(self._made.code, {"run": RUN, **entries})

    @once_property
    def trajectory(self) -> LoweredTrajectory:
        """The lowered entry points."""
        return self._lower()

    @once_property
    def operations(self) -> str:
        """The `fingerprint` of the traced operations."""
        return self._made.operations or fingerprint(self.trajectory.jaxprs)

    @property
    def behind(self) -> bool:
        """Whether signals lie behind the state, see `stops`."""
        return self._made.behind

    @property
    def text(self) -> str:
        """The LLVM code of the kernel."""
        return self._module.text(target.host().attributes())

    @once_property
    def _module(self) -> Module:
        return module_of(self.trajectory, self.lanes, target.host())

    def _make(self, whole: bool) -> StoredKernel:
        """The stored part, with the fingerprint if it is to be `whole`."""
        trajectory = self.trajectory
        return StoredKernel(
            in_own_thread(lambda stopped: cache.object_code(self.text)),
            self._module.arena,
            trajectory.state_size,
            trajectory.arguments,
            trajectory.outputs,
            trajectory.signals,
            trajectory.going,
            trajectory.behind,
            fingerprint(trajectory.jaxprs) if whole else "",
        )

    @once_property
    def _observing(self) -> tuple[Callable[..., None], int]:
        """The driver of replays and its arena's size, compiled (and stored) at the first replay."""
        observer = self._entries.look_up(StoredObserver, self._make_observer)
        return _link(observer.code, {"history": HISTORY})["history"], observer.arena

    def _make_observer(self) -> StoredObserver:
        module = Module(self.lanes, target.host().masks, target.host().fuses)
        for entry in self.trajectory.entry_points:
            if entry.function.name == OBSERVE:
                emit_entry_point(module, entry)
        module.functions["history"] = history(self.lanes)
        text = module.text(target.host().attributes())
        code = in_own_thread(lambda stopped: cache.object_code(text))
        return StoredObserver(code, module.arena)

    def run(self, trees: Trees, intervals: int, workers: int) -> Any:
        """Outputs of all cases.

        At most `workers` of the threads work for this call. An exception of the caller's thread
        (Ctrl-C) ends the call after the current pieces. Raises `TypeError` and `ValueError` for
        arrays of another kind than the machine code was compiled for.
        """
        inputs, count = self._inputs(trees, intervals)
        outputs, leaves = _room(self._made.outputs, count)
        run = self._functions["run"]
        piece = self._piece(count, workers)
        pieces = iter(range(0, count, piece))

        def work(stopped: threading.Event) -> None:
            arena, state = AlignedMemory(self._made.arena), AlignedMemory(self._made.state_size)
            pointers = addresses(arena, [*inputs, *leaves])  # kept alive by `run`
            for begin in pieces:  # next() of a range iterator is atomic
                if stopped.is_set():
                    return
                end = min(begin + piece, count)
                run(pointers, state.address, begin, end, 0, intervals)

        in_threads(work, min(workers, -(-count // piece)))
        return outputs

    def _inputs(self, trees: Trees, intervals: int) -> tuple[list[np.ndarray], int]:
        if not 0 < operator.index(intervals) < 1 << 63:
            raise ValueError(f"Argument `intervals` must be at least 1, but got {intervals}.")
        return self._made.arguments.taken(trees)

    def _piece(self, count: int, workers: int) -> int:
        """Number of cases that a thread takes at a time: larger where lanes are refilled."""
        vectors = PIECE
        if self._made.going is not None:
            vectors = min(max(PIECE, count // (2 * self.lanes * workers)), REFILLED)
        return vectors * self.lanes

    def replay(self, trees: Trees, instants: Sequence[int]) -> tuple[PyTree, PyTree]:
        """Outputs and signals (cases, times) of all cases, stopped at some of the intervals.

        `instants` are their numbers, ascending from 0 to that of the end. The entry points, and
        therefore the bits and the errors, are those of `run`.
        """
        inputs, count = self._inputs(trees, instants[-1])
        outputs, leaves = _room(self._made.outputs, count)
        signals, rows = _room(self._made.signals, len(instants) * count)
        begin, advance, finish = (self._functions[name] for name in ("begin", "advance", "finish"))
        history, arena_size = self._observing
        numbers = np.array(stops(instants, self.behind), np.int64)
        begins = [instants[0], *numbers.tolist()]

        def work(stopped: threading.Event) -> None:
            arena = AlignedMemory(max(self._made.arena, arena_size))
            pointers = addresses(arena, [*inputs, *leaves, *rows])
            for first in range(0, count, self.lanes):
                state, cases, mask = self._block(first, count)
                where = (pointers, state.address, cases.ctypes.data, mask.ctypes.data)
                places = AlignedMemory(8 * self.lanes).bytes.view(np.int64)
                places[:] = cases
                begin(*where, 0, 0)
                for piece in range(0, len(numbers), WATCHED):
                    if stopped.is_set():
                        return
                    watched = numbers[piece : piece + WATCHED]
                    driver_arguments = (places.ctypes.data, watched.ctypes.data, _address(advance))
                    history(*where, *driver_arguments, len(watched), count, begins[piece])
                finish(*where, 0, numbers[-1])

        in_own_thread(work)

        def by_case(leaf: np.ndarray) -> np.ndarray:
            return np.moveaxis(leaf.reshape(len(numbers), count, *leaf.shape[1:]), 0, 1)

        return outputs, jax.tree.map(by_case, signals)

    def _block(self, first: int, count: int):
        numbers = first + np.arange(self.lanes)
        cases = AlignedMemory(8 * self.lanes).bytes.view(np.int64)
        cases[:] = np.minimum(numbers, count - 1)
        return AlignedMemory(self._made.state_size), cases, (numbers < count).astype(np.uint8)


def module_of(trajectory: LoweredTrajectory, lanes: int, cpu: target.Host) -> Module:
    """Module of `run` and all entry points except that of replays, for a processor."""
    module = Module(lanes, cpu.masks, cpu.fuses)
    for entry in trajectory.entry_points:
        if entry.function.name != OBSERVE:
            emit_entry_point(module, entry)
    if trajectory.going is None:
        module.functions["run"] = run_blocks(lanes, ["begin", "advance", "finish"])
    else:
        module.functions["advance"] = advance_lanes(lanes, trajectory.going)
        module.functions["run"] = run_lanes(lanes, trajectory.going)
    return module


def _link(code: bytes, types: Mapping[str, Callable[[int], Any]]) -> dict[str, Any]:
    return in_own_thread(lambda stopped: target.loaded(code, types))


def _address(function: Any) -> int:
    return cast(int, ctypes.cast(function, ctypes.c_void_p).value)


def _room(shapes: PyTree, count: int) -> tuple[PyTree, list[np.ndarray]]:
    arrays = jax.tree.map(lambda leaf: np.zeros((count, *leaf.shape), leaf.dtype), shapes)
    return arrays, jax.tree.leaves(arrays)
