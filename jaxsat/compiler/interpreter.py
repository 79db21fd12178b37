"""Interpreter of programs in NumPy: slow, and the reference for machine code.

A varying value is an array over the lanes, a uniform one a NumPy scalar.
"""

from collections.abc import Sequence
from typing import Any

import numpy as np

from jaxsat.compiler import ir
from jaxsat.compiler.operations import evaluate


def interpret(function: ir.Function, args: Sequence[np.ndarray | np.generic]) -> list[np.ndarray]:
    """Return the results of a function for these arguments."""
    lanes = max((np.size(arg) for arg in args), default=1)
    run = _Run(lanes)
    for param, arg in zip(function.params, args, strict=True):
        run.values[param.number] = np.asarray(arg, param.dtype)
    run.block(function.block)
    return [np.asarray(run.value(result)) for result in function.results]


class _Run:
    """One run of a function: values and memories so far, by number."""

    def __init__(self, lanes: int):
        self.lanes = lanes
        self.values: dict[int, np.ndarray] = {}
        self.memories: dict[int, np.ndarray] = {}

    def value(self, x) -> Any:
        return self.values[x.number] if isinstance(x, ir.Value) else x

    def memory(self, memory: ir.Memory) -> np.ndarray:
        if memory.number not in self.memories:
            if memory.initial is not None:
                self.memories[memory.number] = memory.initial
            else:
                shape = (memory.size,) if memory.uniform else (memory.size, self.lanes)
                self.memories[memory.number] = np.zeros(shape, memory.dtype)
        return self.memories[memory.number]

    def block(self, block: ir.Block) -> None:
        for step in block.steps:
            match step:
                case ir.Operation():
                    args = tuple(self.value(arg) for arg in step.args)
                    array = np.asarray(evaluate(step.name, args, step.out.dtype))
                    self.values[step.out.number] = array.astype(step.out.dtype)
                case ir.Load():
                    cells, index = self.memory(step.memory), self.value(step.index)
                    if not ir.is_uniform(step.index) and not step.memory.uniform:
                        self.values[step.out.number] = cells[index, np.arange(self.lanes)]
                    else:
                        self.values[step.out.number] = cells[index].copy()
                case ir.Store():
                    self.memory(step.memory)[self.value(step.index)] = self.value(step.value)
                case ir.Loop():
                    self._loop(step)
                case ir.BlockSwitch():
                    number = int(np.ravel(self.value(step.index))[0])  # the same in all lanes
                    self.block(step.blocks[number])
                    for out, result in zip(step.outs, step.yields[number], strict=True):
                        self._set(out, self.value(result))
                case ir.Call():
                    inner = _Run(self.lanes)
                    for param, arg in zip(step.function.params, step.args, strict=True):
                        inner._set(param, self.value(arg))
                    inner.block(step.function.block)
                    for out, result in zip(step.outs, step.function.results, strict=True):
                        self._set(out, inner.value(result))

    def _set(self, target: ir.Value, value) -> None:
        value = np.asarray(value, target.dtype)
        self.values[target.number] = (
            value if target.uniform else np.broadcast_to(value, (self.lanes,))
        )

    def _loop(self, step: ir.Loop) -> None:
        for param, first in zip(step.params, step.before, strict=True):
            self._set(param, self.value(first))
        while True:
            self.block(step.condition)
            if not np.any(self.value(step.active)):
                return
            self.block(step.body)
            after = [self.value(result) for result in step.after]
            for param, value in zip(step.params, after, strict=True):
                self._set(param, value)
