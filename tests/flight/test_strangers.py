"""Laws and scenarios that the exporter has not seen before: their C agrees to the bit, and no
function of it is too large to be reviewed."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from helpers.tools import needs
from jaxsat.flight import vectors
from jaxsat.flight.cfs import table_cautions
from jaxsat.flight.files import export
from jaxsat.flight.request import Request
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.simulation.sampled_loop import SampledLoop
from tests.flight.folders import write_files
from tests.flight.mode_names import bare_modes
from tests.flight.sizes import sizes, too_large
from tests.flight.traced import check_trace

PROVENANCE = {"versions": {"jaxsat": "0"}, "platform": "here", "created": "now"}

SCENARIO = """
title = "A law of someone else's"

[spacecraft]
inertia_kg_m2 = [[4.0, 0.1, 0.0], [0.1, 5.0, -0.2], [0.0, -0.2, 6.0]]
thruster_torque_axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]

[orbit]
rate_rad_s = 0.0011

[initial]
quaternion = [0.8, 0.6, 0.0, 0.0]
omega_rad_s = [0.03, 0.01, -0.02]

[control]
law = "@LAW@"
@KEYS@

[simulation]
duration_s = 100
"""

LAWS = {
    "strangers:RecedingRiccati": "weight = 50",
    "strangers:Moody": "kp = 0.3\nkd = 2.0",
    "strangers:PartlyNew": "kd = 2.0",
    "oddities:RingBuffer": "gain = 2.0",
    "oddities:Quantised": "gain = 2.0",
    "oddities:Tabulated": "gain = 2.0",
    "oddities:Long": "gain = 2.0",
}

LAW_FILES = [Path(__file__).with_name(name) for name in ("strangers.py", "oddities.py")]

BY_RULES = ("strangers:Moody", "oddities:Quantised")
"""Enumerations and branches, casts (loops and arrays: test_export.py). It takes 10 s and more."""

SAMPLED = {
    "one-torque-damping": (False, True),
    "oscillatory-dispersed": (False, True),
    "switching-rounded": (False, True),
    "hybrid-wheels": (False,),
    "thruster-dies": (True,),
}
"""Laws of the library and whether in single precision. The last two are one law of 100,000
operations and more, with wheels and thrusters and with thrusters alone; that of two-torque-free
flies in test_software_in_the_loop.py, that of switching with an estimator in test_export.py."""


@pytest.fixture(autouse=True)
def _few_samples(monkeypatch):
    monkeypatch.setattr(vectors, "SAMPLES", 100)
    monkeypatch.setattr(vectors, "CASES", 4)
    monkeypatch.setattr(vectors, "LONGEST", 2000)
    monkeypatch.setattr("jaxsat.flight.files.measured", lambda files: {})
    monkeypatch.setattr("jaxsat.flight.files.found_calls", lambda *given: given[3][:0])


@pytest.fixture(autouse=True)
def _one_flight_of_a_loop(monkeypatch):
    """Controllers in double and in single precision are given samples of the same runs."""
    flown, fly = {}, vectors._closed_loops

    def once(loop, *given):
        if id(loop) not in flown:
            flown[id(loop)] = fly(loop, *given)
        return flown[id(loop)]

    monkeypatch.setattr(vectors, "_closed_loops", once)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the laws are: a module is imported once."""
    place = tmp_path_factory.mktemp("strangers")
    for file in LAW_FILES:
        shutil.copy(file, place)
    return place


def _agrees(folder: Path, scenario, compilers, precisions=(False, True)) -> None:
    """In double and in single precision.

    Each of two compilers optimises in one of them by the Makefile's default `-O2`, which takes ten
    times as long; one alone does so by `-O1`.
    """
    run = build(scenario)
    assert isinstance(run.loop, SampledLoop)
    for single in precisions:
        made = export(Request(run.loop, run.start, 400.0, "", "", PROVENANCE, single=single))
        assert len(sizes(made.files["controller.c"].decode())) > 10
        assert too_large(made.files) == {}
        names = ("trace.csv", "controller.c", "controller.h")
        table, code, head = (made.files[name].decode() for name in names)
        assert bare_modes(head, code) == []
        check_trace(table, code, LAW_FILES)
        assert table_cautions(made.program) == ()  # cFS's parameter table has a default size
        place = folder / ("single" if single else "double")
        place.mkdir()
        write_files(place, made.files)
        for compiler in compilers:
            level = "-O2" if single == (compiler == "clang") else "-O0"
            level = level if len(compilers) > 1 else "-O1"
            assert " 0 numbers differ" in _make(place, "-B", "test", compiler, level)
            if single == precisions[-1]:
                _make(place, "-B", "build/libcontroller.so", compiler, "-O0")


def _make(folder: Path, *words: str) -> str:
    """What `make` says of targets for a compiler at a level of optimisation."""
    *targets, compiler, level = words
    command = ["make", *targets, f"CC={compiler}", f"CFLAGS={level}"]
    done = subprocess.run(command, cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


@needs("clang")
@needs("cppcheck")
@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_a_plug_in_law_agrees_to_the_bit(tmp_path, folder, law):
    """Without a warning, under the sanitizers and the rules of MISRA C, too."""
    place = folder / f"{law.split(':')[1]}.toml"
    place.write_text(SCENARIO.replace("@LAW@", law).replace("@KEYS@", LAWS[law]))
    _agrees(tmp_path, load(place), ["gcc", "clang"])
    _make(tmp_path / "double", "sanitize", "gcc", "")
    if law == "oddities:Tabulated":  # whose counters are divided and count truth values
        assert "int64_t" not in (tmp_path / "double" / "controller.h").read_text()
        code = (tmp_path / "double" / "controller.c").read_text()
        assert not re.search(r"\? 1 : 0\) [!=]=", code)  # a truth value is compared as one
    if law in BY_RULES:
        _make(tmp_path / "double", "cppcheck", "gcc", "")


@needs("gcc")
@pytest.mark.slow
@pytest.mark.parametrize("name", SAMPLED)
def test_laws_of_the_library_agree_to_the_bit(tmp_path, name):
    _agrees(tmp_path, load(name), ["gcc"], SAMPLED[name])
