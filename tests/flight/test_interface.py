"""What an export tells of its interface is what the C has, and its check refuses bad parameters."""

import csv
import dataclasses
import enum
import subprocess
import zlib

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Bool, Int

from helpers.tools import needs
from jaxsat.core.declaration.keys import number
from jaxsat.flight.flight import UNITS
from jaxsat.flight.guard_source import guard_source
from jaxsat.flight.interface import as_csv, as_markdown, parameters, rows
from jaxsat.flight.program import flight_program
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.derived import hold_samples_of
from tests.flight.controllers import KEYS, sources
from tests.flight.laws import Filtered, loop_of, start

STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror"]
DRIVER = r"""
#include "controller_parameters.h"
#include <stdio.h>
int main(void)
{
  double x;
  controller_parameters p = controller_default_parameters;
  printf("%d %u %u\n", (int)controller_check_parameters(&p),
         (unsigned)controller_parameter_checksum(&p), CONTROLLER_DEFAULT_CHECKSUM);
  while (scanf("%lf", &x) == 1) {
    p = controller_default_parameters;
    p.law_gain[1] = (@REAL@)x;
    printf("%d %u\n", (int)controller_check_parameters(&p),
           (unsigned)controller_parameter_checksum(&p));
  }
  return 0;
}
"""


def _built(folder, program, table, driver):
    files = {**sources(program, table), "driver.c": driver}
    for name, text in files.items():
        (folder / name).write_text(text)
    words = ["gcc", *STRICT, "-ffp-contract=off", "driver.c", "controller.c"]
    words += ["controller_parameters.c", "-o", "driver", "-lm"]
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return lambda given: subprocess.run(
        [folder / "driver"], input=given, capture_output=True, text=True, check=True
    ).stdout.splitlines()


@needs("gcc")
@pytest.mark.parametrize("single", [False, True], ids=["double", "single"])
def test_the_check_tells_each_bad_parameter_and_the_checksum_is_that_of_zlib(tmp_path, single):
    loop = loop_of(Filtered(gain=[3.0, 2.0]))
    program = flight_program(loop, start(), single=single)
    table = parameters(program, loop, KEYS)
    run = _built(
        tmp_path, program, table, DRIVER.replace("@REAL@", "float" if single else "double")
    )
    place = next(i for i, one in enumerate(table, 1) if one.field.path == "law.gain")
    values = ["50", "50.001", "1e-30", "0", "-1", "nan", "inf", "-inf", "2.5"]
    begin, *found = [[int(word) for word in line.split()] for line in run("\n".join(values))]
    assert begin[0] == 0
    assert begin[1] == begin[2]
    assert [row[0] for row in found] == [0, place, 0, place, place, place, place, place, 0]
    for text, (_, checksum) in zip(values, found, strict=True):
        if text == "nan":  # which of its bits are set is the compiler's choice
            continue
        changed = [np.array(one.default) for one in table]
        changed[place - 1][1] = float(text)
        plain = b"".join(x.astype(x.dtype.newbyteorder("<")).tobytes() for x in changed)
        assert checksum == zlib.crc32(plain)
    unbounded = [one for one in table if one.key is None and one.field.dtype.kind == "f"]
    assert unbounded
    assert all(one.range == "finite" for one in unbounded)


class Switchable(Filtered):
    """A law with a truth value among its parameters."""

    on: Bool[Array, "2"] = eqx.field(default_factory=lambda: jnp.array([True, False]))

    def step(self, t, state, memory):
        """Commands of an axis that is on."""
        command, memory = super().step(t, state, memory)
        return jnp.where(self.on, command, 0.0), memory


BYTES = r"""
#include "controller_parameters.h"
#include <stdio.h>
#include <string.h>
int main(void)
{
  for (int byte = 0; byte < 256; byte++) {
    controller_parameters p = controller_default_parameters;
    const unsigned char one = (unsigned char)byte;
    (void)memcpy(&p.law_on[1], &one, 1);
    printf("%d\n", (int)controller_check_parameters(&p));
  }
  return 0;
}
"""


@needs("gcc")
def test_a_byte_that_is_no_truth_value_is_refused(tmp_path):
    loop = loop_of(Switchable(gain=[3.0, 2.0]))
    program = flight_program(loop, start())
    table = parameters(program, loop, KEYS)
    found = _built(tmp_path, program, table, BYTES)("")
    place = next(i for i, one in enumerate(table, 1) if one.field.path == "law.on")
    assert table[place - 1].range == "false, true"
    assert [int(line) for line in found] == [0, 0] + [place] * 254


class Indexed(Filtered):
    """A law with whole numbers of all sizes among its parameters; `order` is a key's."""

    order: Int[Array, ""] = eqx.field(default_factory=lambda: jnp.array(3))
    rows: Int[Array, "2"] = eqx.field(default_factory=lambda: jnp.array([-1, 4]))
    half: Int[Array, "2"] = eqx.field(default_factory=lambda: jnp.array([-300, 2], jnp.int16))
    byte: Int[Array, "2"] = eqx.field(default_factory=lambda: jnp.array([-7, 0], jnp.int8))
    long: Int[Array, "2"] = eqx.field(default_factory=lambda: jnp.array([-5, 2**53 + 1]))

    def step(self, t, state, memory):
        """Commands that depend on all of them."""
        command, memory = super().step(t, state, memory)
        total = self.rows + self.half + self.byte + self.long
        return jnp.where(total > self.order, command, 0.0), memory


WHOLES = r"""
#include "controller_parameters.h"
#include <stdio.h>
int main(void)
{
  int which;
  long long x;
  while (scanf("%d %lld", &which, &x) == 2) {
    controller_parameters p = controller_default_parameters;
    switch (which) {
    case 0: p.law_order = (int32_t)x; break;
    case 1: p.law_rows[1] = (int32_t)x; break;
    case 2: p.law_half[1] = (int16_t)x; break;
    case 3: p.law_byte[1] = (int8_t)x; break;
    default: p.law_long[1] = x; break;
    }
    printf("%d %u\n", (int)controller_check_parameters(&p),
           (unsigned)controller_parameter_checksum(&p));
  }
  return 0;
}
"""


@needs("gcc")
def test_a_whole_number_out_of_its_range_is_refused(tmp_path):
    """A key's own range, or that of the scenario's numbers: each end and its neighbour."""
    loop = loop_of(Indexed(gain=[3.0, 2.0]))
    program = flight_program(loop, start())
    keys = (*KEYS, number("order", "Order", above=0.5, at_most=9, default=3, tunable=True))
    table = parameters(program, loop, keys)
    names = [f"law.{name}" for name in ("order", "rows", "half", "byte", "long")]
    ends = [(1, 9), (-1, 4), (-300, 2), (-7, 0), (-5, 2**53 + 1)]
    by_path = {one.field.path: (place, one) for place, one in enumerate(table, 1)}
    assert [by_path[name][1].range for name in names] == [f"{x} to {y}" for x, y in ends]
    asked = [
        (which, value, 0 if low <= value <= high else by_path[names[which]][0])
        for which, (low, high) in enumerate(ends)
        for value in (low - 1, low, high, high + 1)
    ]
    lines = "\n".join(f"{which} {value}" for which, value, _ in asked)
    found = [line.split() for line in _built(tmp_path, program, table, WHOLES)(lines)]
    for (which, value, wrong), (told, checksum) in zip(asked, found, strict=True):
        assert int(told) == wrong, (names[which], value)
        changed = [np.array(one.default.astype(one.field.dtype)) for one in table]
        changed[by_path[names[which]][0] - 1].flat[-1] = value
        assert int(checksum) == zlib.crc32(b"".join(x.tobytes() for x in changed))


def test_a_number_of_an_enumeration_is_one_of_its_members():
    loop = loop_of(Indexed(gain=[3.0, 2.0]))
    table = parameters(flight_program(loop, start()), loop, KEYS)
    one = next(one for one in table if one.field.path == "law.rows")
    field = dataclasses.replace(one.field, choices=enum.IntEnum("Phase", {"IDLE": 0, "SAFE": 9}))
    named = dataclasses.replace(one, field=field, default=np.array([0, 9]))
    assert named.bounds == (0, 9)
    assert named.range == "0 IDLE, 9 SAFE"


@needs("gcc")
@pytest.mark.slow
@pytest.mark.parametrize("name", ["two-torque-free", "cubesat-12u"])
def test_rows_are_the_members_that_the_compiler_has(tmp_path, name):
    scenario = load(name)
    run = build(scenario)
    program = flight_program(run.loop, run.start)
    table = parameters(program, run.loop, scenario.law.declaration.keys)
    read = list(csv.DictReader(as_csv(rows(program, table)).splitlines()))
    assert all(UNITS[row["path"].split(".")[0]] for row in read
               if row["structure"] == "controller_output" and row["type"] == "double")  # fmt: skip
    assert not any("64" in row["type"] for row in read)  # counters and modes have 32 bits
    members = [row for row in read if row["structure"] != "controller_guard_step"]
    lines = "".join(
        f'  printf("%u %u\\n", (unsigned)offsetof({row["structure"]}, {row["name"]}),\n'
        f"         (unsigned)sizeof((({row['structure']} *)0)->{row['name']}));\n"
        for row in members
    )
    driver = '#include "controller_guard.h"\n#include <stddef.h>\n#include <stdio.h>\n'
    found = _built(
        tmp_path, program, table, f"{driver}int main(void)\n{{\n{lines}  return 0;\n}}\n"
    )
    end, before = 0, None
    for row, line in zip(members, found(""), strict=True):
        offset, size = map(int, line.split())
        end = end if row["structure"] == before else 0
        assert size == int(row["bytes"])
        assert end <= offset < end + 8  # no member between two rows
        end, before = offset + size, row["structure"]
    declared = [row for row in read if row["path"].startswith("control.")]
    assert len(declared) >= 2
    assert all(row["range"] not in ("finite", "any") for row in declared)
    assert "## controller_output" in as_markdown("title", rows(program, table))


def test_the_scenario_tells_for_how_long_commands_are_held():
    assert hold_samples_of(load("switching")) == 10
    count = hold_samples_of(load("switching", ["sampling.hold_samples=3"]))
    program = flight_program(loop_of(Filtered(gain=[3.0, 2.0])), start())
    assert ".hold_samples = 3," in guard_source(program, [], count)
    (row,) = (one for one in rows(program, [], count) if one.name == "hold_samples")
    assert row.range == "at least 0; default 3"
