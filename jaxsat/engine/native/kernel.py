"""The machine code of a trajectory's stages, and how it is called."""

import ctypes
import functools
import itertools
import os
import threading
from collections.abc import Sequence
from concurrent.futures import Future, ThreadPoolExecutor
from functools import cached_property
from typing import Any

import jax
import numpy as np
from jaxtyping import PyTree

from jaxsat.engine.native import cache, target
from jaxsat.engine.native.drivers import advance_lanes, run_blocks, run_lanes
from jaxsat.engine.native.lines import Module
from jaxsat.engine.native.stages import add_stage
from jaxsat.engine.native.trajectory import ALIGNMENT, TrajectoryStages
from jaxsat.processors import all_processors

PIECE = 4
"""Vectors of cases that a thread takes at a time."""

REFILLED = 64
"""The same at most, where a lane that has ended takes the next case."""

OBSERVE = "observe"

RUN = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 2, *[ctypes.c_int64] * 4)
STAGE = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4, *[ctypes.c_int64] * 2)


_making = threading.Lock()


def _threads() -> ThreadPoolExecutor:
    """The threads in which machine code runs: as many as processors, however many callers wait.

    Callers are served in turn, so several at once keep all processors busy and no more.
    """
    with _making:
        return _threads_of(os.getpid())  # a process that was forked has none of its parent's


@functools.cache
def _threads_of(process: int) -> ThreadPoolExecutor:
    del process
    return ThreadPoolExecutor(all_processors(), thread_name_prefix="jaxsat-native")


class Kernel:
    """A program's stages as machine code for vectors of `lanes` cases."""

    def __init__(self, stages: TrajectoryStages, lanes: int):
        self.stages, self.lanes = stages, lanes
        module = Module(lanes, target.host().masks)
        for stage in stages.stages:
            if stage.function.name != OBSERVE:
                add_stage(module, stage)
        if stages.going is None:
            module.functions["run"] = run_blocks(lanes, ["begin", "advance", "finish"])
        else:
            module.functions["advance"] = advance_lanes(lanes, stages.going)
            module.functions["run"] = run_lanes(lanes, stages.going)
        self.text = module.text(target.host().attributes())
        names = ["run", "begin", "advance", "finish"]
        self._keep, self._addresses = target.loaded(cache.object_code(self.text), names)

    @cached_property
    def _observing(self) -> tuple[object, dict[str, int]]:
        """The stage that only a replay needs, made for the first one."""
        module = Module(self.lanes, target.host().masks)
        for stage in self.stages.stages:
            if stage.function.name == OBSERVE:
                add_stage(module, stage)
        text = module.text(target.host().attributes())
        return target.loaded(cache.object_code(text), [OBSERVE])

    def run(self, inputs: Sequence[np.ndarray], count: int, intervals: int, workers: int) -> Any:
        """Outputs of `count` cases, whose arrays come first among the inputs.

        At most `workers` of the threads work for this call. An exception of the caller's thread
        (Ctrl-C) ends the call after the pieces under way.
        """
        outputs, leaves = _room(self.stages.outputs, count)
        run = RUN(self._addresses["run"])
        piece = self._piece(count, workers)
        pieces = iter(range(0, count, piece))
        stopped = False

        def work() -> None:
            pointers = _pointers([*inputs, *leaves])  # which live as long as this needs them
            state = _State(self.stages.state_size)
            for begin in pieces:  # next() of a range iterator is atomic
                if stopped:
                    return
                end = min(begin + piece, count)
                run(pointers, state.address, begin, end, 0, intervals)

        workers = min(workers, -(-count // piece))
        futures: list[Future] = []
        try:
            for _ in range(workers):
                futures.append(_threads().submit(work))
            for future in futures:
                future.result()
        finally:
            stopped = True
            for future in futures:
                if not future.cancel():
                    future.exception()  # waits
        return outputs

    def _piece(self, count: int, workers: int) -> int:
        """Cases that a thread takes at a time: more where lanes are refilled."""
        vectors = PIECE
        if self.stages.going is not None:
            vectors = min(max(PIECE, count // (2 * self.lanes * workers)), REFILLED)
        return vectors * self.lanes

    def replay(
        self, inputs: Sequence[np.ndarray], count: int, instants: Sequence[int]
    ) -> tuple[PyTree, PyTree]:
        """Outputs and signals (cases, times) of `count` cases, stopped at some of the intervals.

        `instants` are their numbers, ascending from 0 to that of the end. The stages are those of
        `run`, so the bits are, too.
        """
        outputs, leaves = _room(self.stages.outputs, count)
        seen, now = _room(self.stages.signals, count)
        pointers = _pointers([*inputs, *leaves, *now])
        begin, advance, finish = (
            STAGE(self._addresses[name]) for name in ("begin", "advance", "finish")
        )
        observe = STAGE(self._observing[1][OBSERVE])
        blocks = [self._block(first, count) for first in range(0, count, self.lanes)]
        history = []
        for state, cases, wanted in blocks:
            begin(pointers, state.address, cases.ctypes.data, wanted.ctypes.data, 0, 0)
        for number, following in itertools.zip_longest(instants, instants[1:]):
            for state, cases, wanted in blocks:
                where = (pointers, state.address, cases.ctypes.data, wanted.ctypes.data)
                observe(*where, number, 0)
                if following is not None:
                    advance(*where, number, following - number)
                else:
                    finish(*where, 0, number)
            history.append(jax.tree.map(np.copy, seen))
        return outputs, jax.tree.map(lambda *parts: np.stack(parts, axis=1), *history)

    def _block(self, first: int, count: int):
        numbers = first + np.arange(self.lanes)
        cases = _aligned(8 * self.lanes).view(np.int64)
        cases[:] = np.minimum(numbers, count - 1)
        return _State(self.stages.state_size), cases, (numbers < count).astype(np.uint8)


class _State:
    """Memory of one vector of cases."""

    def __init__(self, size: int):
        self._memory = _aligned(size)
        self.address = self._memory.ctypes.data


def _aligned(size: int) -> np.ndarray:
    room = np.zeros(size + ALIGNMENT, np.uint8)
    skipped = -room.ctypes.data % ALIGNMENT
    return room[skipped : skipped + size]


def _room(shapes: PyTree, count: int) -> tuple[PyTree, list[np.ndarray]]:
    arrays = jax.tree.map(lambda leaf: np.zeros((count, *leaf.shape), leaf.dtype), shapes)
    return arrays, jax.tree.leaves(arrays)


def _pointers(arrays: Sequence[np.ndarray]):
    return (ctypes.c_void_p * len(arrays))(*(array.ctypes.data for array in arrays))
