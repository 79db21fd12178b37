"""Compiled C in the place of the law gives the same closed-loop runs to the bit.

The plant is advanced by the compiled engine without fused operations on both sides, so that the
law is all that differs.
"""

import subprocess
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import PyTree

from jaxsat.compiler.llvm.mapped import Mapped
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.flight import vectors
from jaxsat.flight.external import Library, _Call
from jaxsat.flight.files import export
from jaxsat.flight.flight import Seen, flight_loop
from jaxsat.flight.request import Request
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.spacecraft.wheels import wheel_momentum
from tests.flight.folders import write_files
from tests.flight.sizes import too_large
from tests.flight.traced import check_trace

PROVENANCE = {"versions": {"jaxsat": "0"}, "platform": "here", "created": "now"}
CASES = 16


class _Heard(NamedTuple):
    """A law's memory and what the law was told last."""

    memory: PyTree
    told: PyTree


class _Driven(AbstractSampledController):
    """Gives the command and the memory that it is given, and remembers what it is told."""

    law: AbstractSampledController
    period: Any
    command: Any
    following: PyTree

    def init(self, state):
        return _Heard(self.law.init(state), (jnp.zeros_like(state.omega[0]), state))

    def step(self, t, state, memory):
        del memory
        return self.command, _Heard(self.following, (t, state))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("scenario", "keys", "periods"),
    [
        ("two-torque-free", [], 1500),
        ("cubesat-12u", [], 300),
        ("acceptance-nominal", ["control.law=planned"], 1500),
    ],
)
def test_closed_loops_with_the_compiled_law_are_the_same_to_the_bit(
    tmp_path, monkeypatch, scenario, keys, periods
):
    monkeypatch.setattr(vectors, "SAMPLES", 8)
    monkeypatch.setattr(vectors, "CASES", 1)
    monkeypatch.setattr("jaxsat.flight.files.measured", lambda files: {})
    monkeypatch.setattr("jaxsat.flight.files.found_calls", lambda *given: given[3][:0])
    run = build(load(scenario, keys))
    loop: Any = flight_loop(run.loop, run.start)
    made = export(Request(loop, run.start, 1.0, "", "", PROVENANCE))
    assert too_large(made.files) == {}
    check_trace(made.files["trace.csv"].decode(), made.files["controller.c"].decode())
    write_files(tmp_path, made.files)
    subprocess.run(["make", "build/libcontroller.so", "CC=gcc"], cwd=tmp_path, check=True)
    library = Library(tmp_path / "build" / "libcontroller.so", loop, run.start)
    call = _Call(library, "control")
    arrays = eqx.filter(loop.controller, eqx.is_array)

    period = float(np.asarray(loop.controller.period))
    starts = jax.random.split(jax.random.key(0), CASES), jnp.arange(CASES)
    inside = jax.vmap(lambda *one: loop.start(vectors._start(loop, run.start, *one)))(*starts)
    inside = jax.tree.map(np.asarray, inside)
    first = jax.tree.map(lambda x: x[0], inside)
    instant = jnp.zeros_like(run.start.omega[0])
    command = jax.eval_shape(loop.controller.step, instant, run.start, first.memory)[0]
    zero = np.zeros(command.shape)
    law = _Driven(loop.controller, loop.controller.period, jnp.asarray(zero), first.memory)
    driven = eqx.tree_at(lambda x: x.controller, loop, law)
    like = driven.start(run.start)
    outside: Any = eqx.tree_at(
        lambda x: x.memory,
        inside,
        _Heard(inside.memory, jax.tree.map(lambda x: np.stack([x] * CASES), like.memory.told)),
    )

    def whole(case, shared):
        del shared
        return vectors._after(loop, case[0], period, case[1])

    def with_given(case, shared):
        del shared
        number, state, command, following = case
        given = eqx.tree_at(lambda x: (x.command, x.following), law, (command, following))
        with_it = eqx.tree_at(lambda x: x.controller, driven, given)
        return vectors._after(with_it, number, period, state)

    number = np.zeros((), np.int32)
    plain = Mapped(whole, (number, first), [], contract=False)
    one = jax.tree.map(lambda x: np.asarray(x)[0], outside)
    guided = Mapped(with_given, (number, one, zero, first.memory), [], contract=False)
    commands = np.stack([zero] * CASES)
    mode = jax.jit(jax.vmap(loop.controller.mode))
    modes: set[int] = set()
    for i in range(periods):
        numbers = np.full(CASES, i, np.int32)
        told = guided((numbers, outside, commands, outside.memory.memory), []).memory.told
        seen = Seen(told[1].attitude, told[1].omega, wheel_momentum(told[1]))
        command, memory = call(arrays, numbers, seen, outside.memory.memory)
        outside = guided((numbers, outside, command, memory), [])
        inside = plain((numbers, inside), [])
        modes.update(np.asarray(mode(inside.memory)).tolist())
    same = eqx.tree_at(lambda x: x.memory, outside, outside.memory.memory)
    for found, wanted in zip(jax.tree.leaves(same), jax.tree.leaves(inside), strict=True):
        np.testing.assert_array_equal(found, wanted)
    assert len(modes) == len(loop.controller.modes)  # all parts of the law were at work
