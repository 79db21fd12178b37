"""The machine code of a trajectory's entry points, and how it is called."""

import ctypes
import itertools
import operator
import threading
from collections.abc import Callable, Mapping, Sequence
from typing import Any

import jax
import numpy as np
from jaxtyping import PyTree

from jaxsat.engine.fingerprint import fingerprint
from jaxsat.engine.native import cache, target
from jaxsat.engine.native.arguments import Memory, addresses
from jaxsat.engine.native.drivers import RUN, advance_lanes, run_blocks, run_lanes
from jaxsat.engine.native.emitter import Module
from jaxsat.engine.native.entry_points import emit_entry_point
from jaxsat.engine.native.kept import MadeKernel, kept_or_made
from jaxsat.engine.native.threads import in_own_thread, in_threads
from jaxsat.engine.native.trajectory import LoweredTrajectory
from jaxsat.once import once_property

PIECE = 4
"""Vectors of cases that a thread takes at a time."""

REFILLED = 64
"""The same at most, where a lane that has ended takes the next case."""

OBSERVE = "observe"

ENTRY_POINT = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4, *[ctypes.c_int64] * 2)

Trees = Mapping[str, PyTree]
"""Cases (with their axis), a list of the numbers, and gains, by these names."""


class Kernel:
    """A program's entry points as machine code for vectors of `lanes` cases.

    `lower` gives them; where the kernel is `kept` under a name, only when they are looked into.
    """

    def __init__(self, lower: Callable[[], LoweredTrajectory], lanes: int, name: str | None = None):
        self._lower, self.lanes = lower, lanes
        self._made = kept_or_made(name, lambda: self._make(name is not None))
        entries = dict.fromkeys(["begin", "advance", "finish"], ENTRY_POINT)
        self._functions = _linked(self._made.code, {"run": RUN, **entries})

    @once_property
    def trajectory(self) -> LoweredTrajectory:
        """The entry points, lowered."""
        return self._lower()

    @once_property
    def operations(self) -> str:
        """The `fingerprint` of what was traced."""
        return self._made.operations or fingerprint(self.trajectory.jaxprs)

    @property
    def text(self) -> str:
        """The LLVM code."""
        return self._module.text(target.host().attributes())

    @once_property
    def _module(self) -> Module:
        return module_of(self.trajectory, self.lanes, target.host())

    def _make(self, whole: bool) -> MadeKernel:
        """What is kept, without the fingerprint unless it is to be `whole`."""
        lowered = self.trajectory
        return MadeKernel(
            in_own_thread(lambda stopped: cache.object_code(self.text)),
            self._module.arena,
            lowered.state_size,
            lowered.arguments,
            lowered.outputs,
            lowered.signals,
            lowered.going,
            fingerprint(lowered.jaxprs) if whole else "",
        )

    @once_property
    def _observing(self) -> tuple[Callable[..., None], int]:
        """The entry point that only a replay needs, made for the first, and its arena's size."""
        module = Module(self.lanes, target.host().masks)
        for entry in self.trajectory.entry_points:
            if entry.function.name == OBSERVE:
                emit_entry_point(module, entry)
        text = module.text(target.host().attributes())
        code = in_own_thread(lambda stopped: cache.object_code(text))
        return _linked(code, {OBSERVE: ENTRY_POINT})[OBSERVE], module.arena

    def run(self, trees: Trees, intervals: int, workers: int) -> Any:
        """Outputs of all cases.

        At most `workers` of the threads work for this call. An exception of the caller's thread
        (Ctrl-C) ends the call after the pieces under way. Raises `TypeError` and `ValueError` for
        arrays that are not of the kind the machine code was made for.
        """
        inputs, count = self._taken(trees, intervals)
        outputs, leaves = _room(self._made.outputs, count)
        run = self._functions["run"]
        piece = self._piece(count, workers)
        pieces = iter(range(0, count, piece))

        def work(stopped: threading.Event) -> None:
            arena, state = Memory(self._made.arena), Memory(self._made.state_size)
            pointers = addresses(arena, [*inputs, *leaves])  # which live as long as this needs them
            for begin in pieces:  # next() of a range iterator is atomic
                if stopped.is_set():
                    return
                end = min(begin + piece, count)
                run(pointers, state.address, begin, end, 0, intervals)

        in_threads(work, min(workers, -(-count // piece)))
        return outputs

    def _taken(self, trees: Trees, intervals: int) -> tuple[list[np.ndarray], int]:
        if not 0 < operator.index(intervals) < 1 << 63:
            raise ValueError(f"Argument `intervals` must be at least 1, but got {intervals}.")
        return self._made.arguments.taken(trees)

    def _piece(self, count: int, workers: int) -> int:
        """Cases that a thread takes at a time: more where lanes are refilled."""
        vectors = PIECE
        if self._made.going is not None:
            vectors = min(max(PIECE, count // (2 * self.lanes * workers)), REFILLED)
        return vectors * self.lanes

    def replay(self, trees: Trees, instants: Sequence[int]) -> tuple[PyTree, PyTree]:
        """Outputs and signals (cases, times) of all cases, stopped at some of the intervals.

        `instants` are their numbers, ascending from 0 to that of the end. The entry
        points are those of `run`, so the bits are, too, and so are the errors.
        """
        inputs, count = self._taken(trees, instants[-1])
        outputs, leaves = _room(self._made.outputs, count)
        seen, now = _room(self._made.signals, count)
        begin, advance, finish = (self._functions[name] for name in ("begin", "advance", "finish"))
        observe, arena_size = self._observing

        def work(stopped: threading.Event) -> list[PyTree]:
            arena, history = Memory(max(self._made.arena, arena_size)), []
            pointers = addresses(arena, [*inputs, *leaves, *now])
            blocks = [self._block(first, count) for first in range(0, count, self.lanes)]
            for state, cases, wanted in blocks:
                begin(pointers, state.address, cases.ctypes.data, wanted.ctypes.data, 0, 0)
            for number, following in itertools.zip_longest(instants, instants[1:]):
                if stopped.is_set():
                    break
                for state, cases, wanted in blocks:
                    where = (pointers, state.address, cases.ctypes.data, wanted.ctypes.data)
                    observe(*where, number, 0)
                    if following is not None:
                        advance(*where, number, following - number)
                    else:
                        finish(*where, 0, number)
                history.append(jax.tree.map(np.copy, seen))
            return history

        history = in_own_thread(work)
        return outputs, jax.tree.map(lambda *parts: np.stack(parts, axis=1), *history)

    def _block(self, first: int, count: int):
        numbers = first + np.arange(self.lanes)
        cases = Memory(8 * self.lanes).bytes.view(np.int64)
        cases[:] = np.minimum(numbers, count - 1)
        return Memory(self._made.state_size), cases, (numbers < count).astype(np.uint8)


def module_of(trajectory: LoweredTrajectory, lanes: int, cpu: target.Host) -> Module:
    """All entry points but that of replays, and `run`, for a processor."""
    module = Module(lanes, cpu.masks)
    for entry in trajectory.entry_points:
        if entry.function.name != OBSERVE:
            emit_entry_point(module, entry)
    if trajectory.going is None:
        module.functions["run"] = run_blocks(lanes, ["begin", "advance", "finish"])
    else:
        module.functions["advance"] = advance_lanes(lanes, trajectory.going)
        module.functions["run"] = run_lanes(lanes, trajectory.going)
    return module


def _linked(code: bytes, types: Mapping[str, Callable[[int], Any]]) -> dict[str, Any]:
    """Machine code in memory."""
    return in_own_thread(lambda stopped: target.loaded(code, types))


def _room(shapes: PyTree, count: int) -> tuple[PyTree, list[np.ndarray]]:
    arrays = jax.tree.map(lambda leaf: np.zeros((count, *leaf.shape), leaf.dtype), shapes)
    return arrays, jax.tree.leaves(arrays)
