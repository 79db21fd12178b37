"""Wrappers of a controller run on stubs of their frameworks, with the bits of the controller."""

import re
import subprocess
import zlib
from functools import cache
from pathlib import Path

import numpy as np
import pytest

from helpers.tools import needs
from jaxsat.flight import vectors
from jaxsat.flight.cfs import CFS, cfs_app, table_bytes, table_cautions
from jaxsat.flight.fprime import FPRIME, fprime_component
from jaxsat.flight.guard import groups, status_bits
from jaxsat.flight.harness import records_header
from jaxsat.flight.interface import parameters, rows
from jaxsat.flight.program import flight_program
from tests.flight.controllers import estimating, few_samples, filtered, sources
from tests.flight.folders import write_files

STUBS = Path(__file__).with_name("stubs")
STRICT = ["-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-ffp-contract=off", "-g"]
SANITIZED = ["-fsanitize=address,undefined", "-fno-sanitize-recover"]


@pytest.fixture(scope="module", autouse=True)
def _few_samples():
    with few_samples():
        yield


def _with_vectors():
    vectors_seen = ["magnetometer={noise_T=1e-7}", "horizon_sensor={noise_rad=1e-3}"]
    return estimating("orbit.inclination_deg=97", *vectors_seen)


def _driver(kind, program, gain, rate) -> str:
    """The program that runs a wrapper; every fifth sample has a rate that is flagged."""
    given = [field for field in program.structs["input"].fields if field.path != "sample"]
    told = program.structs["output"].fields
    copies = [
        f"memcpy(&to->{x.name}, &in.{x.name}, sizeof(in.{x.name}));" for x in given
    ]  # the same bytes: a truth value is 0 or 1
    back = [f"memcpy(&sent.{x.name}, &told->{x.name}, sizeof(sent.{x.name}));" for x in told]
    others = [group.name for group in groups(program) if group.name != rate]
    flags = f"to->valid_{rate} = (samples % 5) != 4;"
    flags += "".join(f" to->valid_{name} = 1u;" for name in others)
    values = {
        "SEND": "\n".join([*copies, flags]),
        "TOLD": "\n".join(back),
        "VALID": ", ".join(
            [f".{rate} = ((samples - 1) % 5) != 4", *(f".{name} = true" for name in others)]
        ),
        "GAIN": gain,
        "TABLE_BYTES": str(table_bytes(program)),
        "REAL": "float" if program.single else "double",
    }
    text = (STUBS / kind).read_text()
    for name, value in values.items():
        text = text.replace(f"@{name}@", value)
    return text


@cache
def _made(make, single=False):
    """A controller's program, parameters, rows of the interface control document, and samples."""
    loop, first, keys = make()
    program = flight_program(loop, first, single=single)
    table = parameters(program, loop, keys)
    return program, table, rows(program, table), vectors.vectors(program, loop, first, 100.0)[0]


def _write_controller(folder, made):
    """The files of a controller, and its samples, the first of the closed loops at the end."""
    program, table, _, found = made
    samples = np.hstack([found.given, found.expected])[::-1].tobytes()
    records = records_header(program, [])
    files = {**sources(program, table), "controller_records.h": records, "samples": samples}
    write_files(folder, files)


def _run(folder, *words) -> list[str]:
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout.splitlines()


def _bits(program) -> dict[str, int]:
    bits = status_bits(program).items()
    return {name.removeprefix("CONTROLLER_STATUS_"): number for name, (number, _) in bits}


@needs("gcc")
@pytest.mark.parametrize(
    ("make", "key", "rate", "single"),
    [
        (filtered, "gain", "omega", False),
        pytest.param(estimating, "k1", "rate", True, marks=pytest.mark.slow),
        pytest.param(_with_vectors, "k1", "rate", False, marks=pytest.mark.slow),
    ],
)
def test_the_app_of_cfs_steps_at_each_wake_up_with_the_bits_of_the_controller(
    tmp_path, make, key, rate, single
):
    made = _made(make, single)
    program, table, told_of, found = made
    _write_controller(tmp_path, made)
    place, gain = next((n, x) for n, x in enumerate(table, 1) if x.key and x.key.name == key)
    element = gain.field.elements("")[-1]
    write_files(tmp_path, cfs_app(program, told_of, [], 10))
    (tmp_path / "main.c").write_text(_driver("cfs/main.c", program, element, rate))
    parts = [f"controller{part}.c" for part in ("", "_guard", "_parameters")]
    parts += ["main.c", f"{CFS}/controller_app.c", f"{CFS}/controller_tbl.c"]
    include = [f"-I{folder}" for folder in (".", CFS, STUBS / "cfs")]
    _run(tmp_path, "gcc", "-std=c99", *STRICT, *SANITIZED, *include, *parts, "-o", "app", "-lm")
    told = _run(tmp_path, tmp_path / "app", "samples")
    bits = _bits(program)
    without = sum(bits[group.bit.removeprefix("CONTROLLER_STATUS_")] for group in groups(program))
    held, begun = without | bits["HELD"], without | bits["ZERO"]
    assert told[:4] == [f"subscribed 0x18C{i}" for i in range(4)]
    assert told[4] == f"event 1 2 CONTROLLER: initialized, program {program.hash[:12]}"
    samples, judged, differing, changes, told_changes = map(int, re.findall(r"\d+", told[5]))
    assert samples == len(found.given)
    assert judged >= 51  # all of the closed loops but those with flags
    assert differing == 0
    assert told_changes == changes
    assert (changes > 0) == (len(program.modes) > 1)
    last = (int(found.given[0, 0]) + 1 + 2**31) % 2**32 - 2**31
    numbers = [np.array(one.default) for one in table]
    numbers[place - 1].ravel()[-1] = 2.5  # the gain that is uploaded
    checksum = zlib.crc32(b"".join(one.tobytes() for one in numbers))
    assert told[6:] == [
        f"output {last} 0x{held:X}",
        f"event 11 3 CONTROLLER: status 0x{held:X} after 0x0 at step {samples + 1}",
        f"event 3 2 CONTROLLER: NOOP, program {program.hash[:12]}",
        "event 7 3 CONTROLLER: no command has the function code 99",
        "event 8 3 CONTROLLER: message of 10 bytes, expected 8",
        f"event 8 3 CONTROLLER: message of 8 bytes, expected {told[11].split()[-1]}",
        "event 6 3 CONTROLLER: message 0x1999 is not expected",
        f"event 14 3 CONTROLLER: parameters refused: number {place} is out of range",
        f"housekeeping 1 3 steps {samples + 1} missing 1 updates 0 parameters 1",
        f"event 13 2 CONTROLLER: parameters with checksum 0x{checksum:08X} in use",
        f"housekeeping 1 3 steps {samples + 1} missing 1 updates 1 parameters 1",
        "state 0",
        "event 5 2 CONTROLLER: begins anew",
        f"output 0 0x{begun:X}",
        f"event 11 3 CONTROLLER: status 0x{begun:X} after 0x{held:X} at step 1",
        "event 4 2 CONTROLLER: counters reset",
        "housekeeping 0 0 steps 1 missing 0 updates 0 parameters 1",
        "event 9 3 CONTROLLER: pipe cannot be read, RC = 0xFFFFFFFF",
        "exit 3",
    ]


def test_a_table_that_is_larger_than_the_default_of_cfs_is_told(monkeypatch):
    program = _made(filtered)[0]
    size = table_bytes(program)
    monkeypatch.setattr("jaxsat.flight.cfs.TABLE_LIMIT", size)
    assert table_cautions(program) == ()
    monkeypatch.setattr("jaxsat.flight.cfs.TABLE_LIMIT", size - 1)
    (words,) = table_cautions(program)
    assert f"{size} bytes: set CFE_PLATFORM_TBL_MAX_SNGL_TABLE_SIZE" in words


@needs("g++")
def test_the_component_of_fprime_steps_with_the_bits_of_the_controller(tmp_path):
    made = _made(filtered)
    program, table, told_of, found = made
    _write_controller(tmp_path, made)
    write_files(tmp_path, fprime_component(program, told_of, table, [], 10))
    for name in ("controller", "controller_guard", "controller_parameters"):
        _run(tmp_path, "gcc", "-std=c99", *STRICT, *SANITIZED, "-c", f"{name}.c")
    parts = [f"{FPRIME}/Controller.cpp", STUBS / "fprime/main.cpp"]
    parts += [f"controller{part}.o" for part in ("", "_guard", "_parameters")]
    include = [f"-I{folder}" for folder in (".", FPRIME, STUBS / "fprime")]
    _run(tmp_path, "g++", "-std=c++14", *STRICT, *SANITIZED, *include, *parts, "-o", "component")
    told = _run(tmp_path, tmp_path / "component", "samples")
    samples, judged, differing, outputs = map(int, re.findall(r"\d+", told[0]))
    assert samples == outputs == len(found.given)
    assert judged >= 51  # all of the closed loops but those with flags
    assert differing == 0
    bits = _bits(program)
    without = bits["INVALID_OMEGA"] | bits["INVALID_ATTITUDE"]
    held, begun = without | bits["HELD"], without | bits["ZERO"]
    last = int(found.given[0, 0])
    numbers = [np.array(one.default) for one in table]
    numbers[0][1] = 2.5  # the gain, which the tester sets
    checksum = zlib.crc32(b"".join(one.tobytes() for one in numbers))
    assert told[1:] == [
        f"status 0x{held:X} 0x0",
        *(f"step {last + 1 + i} 0x{held:X} missing {i + 1}" for i in range(2)),
        "refused 0x1 0x0",
        f"step {last + 3} 0x{held:X} missing 3",
        "refused 0x0 0x0",
        f"step {last + 4} 0x{held:X} missing 4",
        f"in use 0x{checksum:X} 0x0",
        f"step {last + 5} 0x{held:X} missing 5",
        "restarted 0x0 0x0",
        "response 32 5 0",
        "response 33 6 0",
        f"status 0x{begun:X} 0x{held:X}",
        f"step 0 0x{begun:X} missing 1",
        f"checksum 0x{checksum:X}",
    ]


@needs("fpp-check")
@pytest.mark.parametrize(
    ("make", "single"),
    [(filtered, False), pytest.param(estimating, True, marks=pytest.mark.slow)],
)
def test_the_model_of_fprime_is_one(tmp_path, make, single):
    program, table, told_of, _ = _made(make, single)
    write_files(tmp_path, fprime_component(program, told_of, table, [], 10))
    _run(tmp_path, "fpp-check", STUBS / "fprime/Fw.fpp", f"{FPRIME}/Controller.fpp")
