"""Numbers that an entry point hands on from arrays of cases to the state, as they are."""

import ctypes

import numpy as np
import pytest

from jaxsat.compiler.ir import Block, Function, Value
from jaxsat.compiler.llvm import target
from jaxsat.compiler.llvm.arguments import AlignedMemory, addresses
from jaxsat.compiler.llvm.emitter import ALIGNMENT, Module
from jaxsat.compiler.llvm.entry_points import EntryPoint, emit_entry_point
from jaxsat.compiler.llvm.locations import PerCase, Slot
from jaxsat.compiler.llvm.threads import in_own_thread

ENTRY_POINT = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4, *[ctypes.c_int64] * 2)
CASES, SIZE = 11, 40
DTYPES = (np.dtype(np.float64), np.dtype(np.int32), np.dtype(bool))


def _entry_point(size: int) -> EntryPoint:
    """It copies all elements of an array of each type but the first, which has another order."""
    elements = [*range(1, size), 0]
    places = [(array, element) for array in range(len(DTYPES)) for element in elements]
    params = [Value(DTYPES[array], False) for array, _ in places]
    inputs = [PerCase(array, element, size) for array, element in places]
    outputs = [Slot(number * ALIGNMENT, False) for number in range(len(places))]
    return EntryPoint(Function("begin", params, Block(), list(params)), inputs, outputs)


def _text(size: int, lanes: int) -> str:
    module = Module(lanes, target.host().masks)
    emit_entry_point(module, _entry_point(size))
    return module.text(target.host().attributes())


@pytest.mark.parametrize(("lanes", "first"), [(1, 0), (1, 1), (2, 0), (8, 0)])
def test_wanted_lanes_get_their_cases_numbers(lanes, first):
    code = in_own_thread(lambda stopped: target.object_code(_text(SIZE, lanes)))
    begin = in_own_thread(lambda stopped: target.loaded(code, {"begin": ENTRY_POINT}))["begin"]
    rng = np.random.default_rng(3)
    arrays = [rng.integers(-99, 99, (CASES, SIZE)).astype(dtype) for dtype in DTYPES]
    cases = AlignedMemory(8 * lanes).bytes.view(np.int64)
    cases[:] = rng.permutation(CASES)[:lanes]
    wanted = ((first + np.arange(lanes)) % 3 != 1).astype(np.uint8)
    state = AlignedMemory(len(DTYPES) * SIZE * ALIGNMENT)
    state.bytes[:] = 77
    pointers = addresses(AlignedMemory(0), arrays)
    begin(pointers, state.address, cases.ctypes.data, wanted.ctypes.data, 0, 0)
    for number in range(len(DTYPES) * SIZE):
        array, place = arrays[number // SIZE], (number % SIZE + 1) % SIZE
        here = state.bytes[number * ALIGNMENT :]
        vector = here[: lanes * array.itemsize].view(array.dtype)
        there = wanted.astype(bool)
        assert np.array_equal(vector[there], array[cases[there], place])
        kept = here[: lanes * array.itemsize].reshape(lanes, -1)[~there]
        assert (kept == 77).all()


def test_the_code_does_not_grow_with_the_arrays():
    assert _text(1000, 8).count("\n") == _text(SIZE, 8).count("\n")
