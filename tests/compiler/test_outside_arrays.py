"""Arrays from outside that are the same for all cases: indices read them where they are."""

import ctypes

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.compiler.builder import Builder
from jaxsat.compiler.ir import Function, Value
from jaxsat.compiler.llvm import target
from jaxsat.compiler.llvm.arguments import AlignedMemory, addresses
from jaxsat.compiler.llvm.emitter import Module
from jaxsat.compiler.llvm.entry_points import EntryPoint, emit_entry_point
from jaxsat.compiler.llvm.locations import PerCase, SharedElement
from jaxsat.compiler.llvm.threads import in_own_thread
from jaxsat.compiler.lowering import arrays_of, lower, scalars_of
from jaxsat.core.jaxprs import jaxpr_and_shapes

ENTRY_POINT = ctypes.CFUNCTYPE(None, *[ctypes.c_void_p] * 4, *[ctypes.c_int64] * 2)
WIDTH, INT = 5, np.dtype(np.int32)


def _looked_up(table, here, there):
    """Two elements of a table, and of a part of it that no longer lies in one piece."""
    return table[here, 2], table[there, 3], table[:, 1:4][there, 0]


def _text(rows: int, dtype, lanes: int) -> str:
    examples = np.zeros((rows, WIDTH), dtype), *np.zeros((2, 1), np.int32)[:, 0]
    jaxpr, _ = jaxpr_and_shapes(_looked_up, *examples)
    size = rows * WIDTH
    params = [*(Value(np.dtype(dtype), True) for _ in range(size)), Value(INT, True)]
    params.append(Value(INT, False))
    places = [SharedElement(0, element) for element in range(size)]
    b = Builder()
    b.outside = {params[0].number: params[:size]}
    arrays = arrays_of(params, [aval.shape for aval in jaxpr.in_avals])
    function = Function("begin", params, b.block, scalars_of(lower(b, jaxpr, arrays)))
    inputs = [*places, SharedElement(1, 0), PerCase(2, 0, 1)]
    outputs = [PerCase(3 + number, 0, 1) for number in range(3)]
    module = Module(lanes, target.host().masks)
    emit_entry_point(module, EntryPoint(function, inputs, outputs).optimised())
    return module.text(target.host().attributes())


@pytest.mark.parametrize("dtype", [np.float64, np.int32, bool])
@pytest.mark.parametrize("lanes", [1, 8])
def test_elements_are_those_of_the_array(lanes, dtype):
    code = in_own_thread(lambda stopped: target.object_code(_text(9, dtype, lanes)))
    begin = in_own_thread(lambda stopped: target.loaded(code, {"begin": ENTRY_POINT}))["begin"]
    draw = np.random.default_rng(4)
    table = draw.integers(-99, 99, (9, WIDTH)).astype(dtype)
    here, there = np.array([7], np.int32), draw.integers(0, 9, lanes).astype(np.int32)
    outs = [np.zeros(lanes, dtype) for _ in range(3)]
    cases = AlignedMemory(8 * lanes).bytes.view(np.int64)
    cases[:] = np.arange(lanes)
    wanted, arena = np.ones(lanes, np.uint8), AlignedMemory(1 << 16)
    pointers = addresses(arena, [table, here, there, *outs])
    begin(pointers, 0, cases.ctypes.data, wanted.ctypes.data, 0, 0)
    expected = _looked_up(jnp.asarray(table), here[0], there)
    for found, right in zip(outs, expected, strict=True):
        np.testing.assert_array_equal(found, np.broadcast_to(right, lanes))


def test_the_code_grows_with_copied_parts_alone():
    short, long = (_text(rows, np.float64, 8) for rows in (20, 90))
    assert long.count("store double") - short.count("store double") == 3 * 70
    assert long.count("load double") - short.count("load double") == 3 * 70
