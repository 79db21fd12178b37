"""The host program that flies a recording through the C."""

import csv
import shutil
import subprocess

import numpy as np
import pytest

from jaxsat.flight.harness import records_header
from jaxsat.flight.program import flight_program
from jaxsat.flight.reference import Reference
from jaxsat.flight.source import header, source
from jaxsat.flight.vectors import recorded_flight, recording_program, recording_text, rounding
from tests.flight.folders import write_files
from tests.flight.laws import Filtered, loop_of, start

LENGTH = 200
STRICT = ["-std=c99", "-O1", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror",
          "-ffp-contract=off"]  # fmt: skip


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
@pytest.mark.parametrize("single", [False, True], ids=["double", "single"])
def test_a_recording_is_flown_to_the_bit_and_a_changed_command_noticed(tmp_path, single):
    loop = loop_of(Filtered(gain=[3.0, 2.0]))
    program = flight_program(loop, start(), single=single)
    size = program.structs["input"].size
    inputs = np.zeros((LENGTH, size))
    inputs[:, 0] = np.arange(LENGTH)
    rng = np.random.default_rng(3)
    quaternions = rng.normal(size=(LENGTH, 4))
    inputs[:, 1:5] = quaternions / np.linalg.norm(quaternions, axis=1, keepdims=True)
    inputs[:, 5:8] = 0.1 * rng.normal(size=(LENGTH, 3))
    inputs[40, 6] = np.nan
    text = recording_text(program, recorded_flight(Reference(program), inputs))
    names, *rows = csv.reader(text.splitlines())
    assert len(rows) == LENGTH
    assert names[:2] == ["sample", "attitude_q[0]"]
    assert names[size] == "torque[0]"
    write_files(
        tmp_path,
        {
            "controller.h": header(program, []),
            "controller.c": source(program, [], libm=False),
            "controller_records.h": records_header(program, []),
            "run_controller.c": recording_program(program),
            "flight.csv": text,
        },
    )
    build = ["gcc", *STRICT, "run_controller.c", "controller.c", "-o", "run_controller", "-lm"]
    done = subprocess.run(build, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr

    def fly(*words):
        return subprocess.run(
            ["./run_controller", *words], cwd=tmp_path, capture_output=True, text=True
        )

    flown = fly("flight.csv")
    assert flown.stderr == f"{LENGTH} samples, 0 commands differ\n"
    assert flown.returncode == 0
    commands = np.array([line.split(",") for line in flown.stdout.splitlines()], float)
    recorded = np.array([row[size:] for row in rows], float)
    np.testing.assert_array_equal(commands, recorded)
    assert np.ptp(commands[:40, 0]) > 0
    rows[30][size] = repr(float(np.nextafter(recorded[30, 0], 9.0)))
    changed = "\n".join(map(",".join, [names, *rows, []]))
    write_files(tmp_path, {"changed.csv": changed, "cut.csv": changed.rsplit(",", 1)[0]})
    found = fly("changed.csv")
    assert (found.returncode, found.stderr) == (1, f"{LENGTH} samples, 1 commands differ\n")
    assert fly("changed.csv", "1e-6").returncode == 0
    assert "must be" in fly("cut.csv").stderr
    assert (fly("cut.csv").returncode, fly("none.csv").returncode) == (2, 2)


@pytest.mark.parametrize("single", [False, True], ids=["double", "single"])
def test_round_off_is_a_part_of_the_smallest_kind_of_commands(single):
    program = flight_program(loop_of(Filtered(gain=[3.0, 2.0])), start(), single=single)
    size = program.structs["input"].size
    recording = np.zeros((3, size + program.structs["output"].size))
    commands = recording[:, size:]
    place = 0
    for field in program.structs["output"].fields:
        commands[1, place] = {"torque": -0.25, "thrust": 8.0}.get(field.name, 3.0)
        place += field.size
    commands[2, 0] = np.inf
    part = 2.0 ** (-23 / 3) if single else 2.0 ** (-52 / 3)
    np.testing.assert_allclose(rounding(program, recording), 0.25 * part, rtol=1e-6)
