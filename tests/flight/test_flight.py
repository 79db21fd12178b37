"""What flies counts samples from its own begin."""

import enum
import re
import shutil
import subprocess
from typing import Annotated, ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array

from jaxsat.flight.flight import Input, Seen, State
from jaxsat.flight.interface import rows
from jaxsat.flight.program import flight_program
from jaxsat.flight.reference import Reference
from jaxsat.flight.source import header, source
from tests.flight.laws import Clocked, Filtered, loop_of, start
from tests.flight.mode_names import bare_modes, enumerated


class Turn(enum.IntEnum):
    """Modes of `Turning`."""

    STOP = 0
    SPIN = 1
    POINT = 2


class TurningMemory(NamedTuple):
    """The mode, and how many samples it has lasted."""

    turn: Array
    samples: Array


class Turning(Clocked):
    """A law of three modes, each with a law of its own, which tables choose."""

    modes: ClassVar[type[enum.IntEnum]] = Turn
    following: Array = eqx.field(converter=jnp.asarray, default=(Turn.SPIN, Turn.POINT, Turn.STOP))

    def init(self, state):
        return TurningMemory(jnp.array(Turn.STOP), jnp.array(0))

    def step(self, t, state, memory):
        after = jnp.array([Turn.POINT, Turn.POINT, Turn.SPIN])[memory.turn]
        due = jnp.where(memory.samples == 2, after, self.following[memory.turn])
        turn = jnp.minimum(jnp.where(state.omega[0] > 0.25, due, memory.turn), Turn.POINT)
        late = turn > Turn.SPIN

        def spin(omega):
            return jnp.tanh(jnp.cumsum(jnp.cos(omega)))[:2]

        def point(omega):
            return jnp.arctan2(jnp.sin(omega), jnp.exp(omega))[:2]

        torque = jax.lax.switch(turn, [lambda omega: omega[:2], spin, point], state.omega)
        return jnp.where(late, -torque, torque), TurningMemory(turn, memory.samples + 1)

    def mode(self, memory):
        return memory.turn


class Step(enum.IntEnum):
    """Parts of `Stepping`."""

    FIRST = 0
    SECOND = 1


class Mode(enum.IntEnum):
    """Modes of `Stepping`."""

    LOW = 4
    HIGH = 5


class SteppingMemory(NamedTuple):
    """The part, and a number that means nothing else."""

    step: Annotated[Array, Step]
    number: Array


class Stepping(Clocked):
    """A law of two parts with modes of its own, whose numbers are one apart or not."""

    modes: ClassVar[type[enum.IntEnum]] = Mode

    def init(self, state):
        return SteppingMemory(jnp.array(Step.FIRST), jnp.array(1))

    def step(self, t, state, memory):
        fast = state.omega[0] > 0.25
        step = jnp.where(fast & (memory.step == Step.FIRST), Step.SECOND, memory.step)
        return state.omega[:2], SteppingMemory(step, jnp.where(fast, 1, memory.number))

    def mode(self, memory):
        return jnp.where(memory.step == Step.SECOND, Mode.HIGH, Mode.LOW)


DRIVER = r"""
#include "controller.h"
#include <stdio.h>
int main(void)
{
  static const uint32_t begins[3] = {0u, 20000u, 1600000000u}; /* 0, 1e4 and 8e8 s */
  for (int which = 0; which < 3; which++) {
    controller_state state;
    controller_output out;
    controller_input in = {.attitude_q = {1.0}, .omega = {0.125, 0.25, 0.5}};
    for (int number = 0; number < 400; number++) {
      in.sample = (int32_t)(begins[which] + (uint32_t)number);
      if (number == 0) {
        controller_init(&controller_default_parameters, &in, &state);
      }
      controller_step(&controller_default_parameters, &in, &state, &out);
    }
    printf("%.17g %.17g\n", (double)out.torque[0], (double)out.torque[1]);
  }
  return 0;
}
"""


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
@pytest.mark.parametrize("single", [False, True], ids=["double", "single"])
def test_commands_are_the_same_whenever_the_controller_begins(tmp_path, single):
    """Also in single precision, whose numbers are 64 apart at 8e8 s."""
    program = flight_program(loop_of(Clocked()), start(), single=single)
    (tmp_path / "controller.h").write_text(header(program, []))
    (tmp_path / "controller.c").write_text(source(program, [], libm=False))
    (tmp_path / "driver.c").write_text(DRIVER)
    strict = ["-std=c99", "-Wall", "-Wextra", "-pedantic", "-Werror", "-ffp-contract=off"]
    built = subprocess.run(
        ["gcc", *strict, "driver.c", "controller.c", "-o", "driver", "-lm"],
        cwd=tmp_path, capture_output=True, text=True, check=False,
    )  # fmt: skip
    assert built.returncode == 0, built.stderr
    lines = subprocess.run([tmp_path / "driver"], capture_output=True, text=True, check=True).stdout
    found = np.array([line.split() for line in lines.splitlines()], float)
    np.testing.assert_array_equal(found, [[199.5, 199.5 * 0.25]] * 3)  # the last of 400 samples


@pytest.mark.parametrize("single", [False, True], ids=["double", "single"])
def test_what_is_expected_counts_from_the_begin(single):
    program = flight_program(loop_of(Clocked()), start(), single=single)
    begin = np.array([0, 20_000, 2**31 - 1], np.int32)
    seen = jnp.array([[1.0, 0, 0, 0]] * 3), np.array([[0.125, 0.25, 0.5]] * 3)
    told = Seen(type(start().attitude)(seen[0]), seen[1])
    now = Input(begin + np.int32(5), told)
    rows = Reference(program).step(now, State(np.zeros(3), begin_sample=begin))
    np.testing.assert_array_equal(rows[:, :2], [[2.5, 2.5 * 0.25]] * 3)
    np.testing.assert_array_equal(rows[:, -1], begin)  # the state keeps it


def test_no_absolute_time_is_part_of_the_interface():
    text = header(flight_program(loop_of(Clocked()), start()), [])
    assert re.search(r"\bint32_t sample;", text)
    assert re.search(r"\bint32_t begin_sample;", text)
    assert not re.search(r"\b(begin_)?time;", text)


def test_a_state_that_wraps_beyond_32_bits_keeps_64_beside_a_mode_of_32():
    text = header(flight_program(loop_of(Filtered(gain=[3.0, 2.0])), start()), [])
    assert "int32_t mode;" in text
    assert "int64_t law_samples;" in text  # which it multiplies by 1103515245


@pytest.mark.parametrize("single", [False, True], ids=["double", "single"])
def test_numbers_of_modes_and_of_annotated_states_have_names(single):
    program = flight_program(loop_of(Stepping()), start(), single=single)
    defines = re.findall(r"#define (CONTROLLER_\w+) INT32_C\((\d)\)", header(program, []))
    assert defines == [
        ("CONTROLLER_MODE_LOW", "4"), ("CONTROLLER_MODE_HIGH", "5"),
        ("CONTROLLER_STEP_FIRST", "0"), ("CONTROLLER_STEP_SECOND", "1"),
    ]  # fmt: skip
    text = " ".join(source(program, [], libm=False).split())
    assert "next->law_step = CONTROLLER_STEP_FIRST;" in text
    first = "(fast && (now->law_step == CONTROLLER_STEP_FIRST))"
    assert f"law_step = {first} ? CONTROLLER_STEP_SECOND : now->law_step;" in text
    assert "next->law_number = 1;" in text  # a number alike is no part
    second = "(next->law_step == CONTROLLER_STEP_SECOND)"
    assert f"out->mode = {second} ? CONTROLLER_MODE_HIGH : CONTROLLER_MODE_LOW;" in text
    assert bare_modes(header(program, []), source(program, [], libm=False)) == []
    ranges = {row.path: row.range for row in rows(program, [])}
    assert ranges["mode"] == "4 LOW, 5 HIGH"
    assert ranges["law.step"] == "0 FIRST, 1 SECOND"
    assert ranges["law.number"] == "any"


@pytest.mark.parametrize("single", [False, True], ids=["double", "single"])
def test_modes_have_names_in_tables_limits_comparisons_and_cases(single):
    program = flight_program(loop_of(Turning()), start(), single=single)
    text = " ".join(source(program, [], libm=False).split())
    stop, spin, point = (f"CONTROLLER_MODE_{one.name}" for one in Turn)
    assert f".law_following = {{{spin}, {point}, {stop}}}," in text
    assert re.search(rf"const int32_t \w+\[3\] = {{{point}, {point}, {spin}}};", text)
    assert re.search(rf"out->mode = minimum_i32\(\w+, {point}\);", text)
    assert f"out->mode > {spin}" in text
    labels = re.findall(r"(case \w+|default): {", text)
    assert labels == [f"case {stop}", f"case {spin}", "default"]
    assert "now->law_samples == 2" in text  # a number alike
    assert "now->law_turn < 0" in text  # the sign of an index
    assert enumerated(header(program, [])) == {"mode", "law_following"}
