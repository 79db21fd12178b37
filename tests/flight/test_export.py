"""Exported controllers are compiled and agree with the compiled engine to the bit."""

import hashlib
import json
import re
import subprocess
from importlib.metadata import EntryPoint
from pathlib import Path
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.tools import needs
from jaxsat.compiler.builder import Builder
from jaxsat.compiler.c.contexts import has_rows
from jaxsat.compiler.c.naming import Names, comment, identifier
from jaxsat.compiler.c.tidying import rolled
from jaxsat.compiler.lowering import CannotLower, as_elements, lower
from jaxsat.compiler.passes.outlining import outlined
from jaxsat.core.declaration import laws as declared_laws
from jaxsat.core.errors import LibraryError
from jaxsat.core.jaxprs import jaxpr_of
from jaxsat.flight import measure, vectors
from jaxsat.flight.external import Library, with_library
from jaxsat.flight.files import Export, export
from jaxsat.flight.flight import CannotExport
from jaxsat.flight.program import flight_program
from jaxsat.flight.request import Request
from jaxsat.flight.source import source
from jaxsat.flight.templates import is_built
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.store.files import OutputError
from jaxsat.store.folder import OutputFolder
from tests.flight.folders import write_files
from tests.flight.laws import Filtered, Searching, Sliced, loop_of, start

PROVENANCE = {"versions": {"jaxsat": "0"}, "platform": "here", "created": "now"}


@pytest.fixture(scope="module", autouse=True)
def _few_samples():
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(vectors, "SAMPLES", 32)
        patch.setattr(vectors, "CASES", 2)
        patch.setattr(vectors, "LONGEST", 64)
        patch.setattr("jaxsat.flight.files.measured", lambda files: {})
        patch.setattr("jaxsat.flight.files.found_calls", lambda *given: given[3][:0])
        yield


@pytest.fixture(scope="module")
def filtered(_few_samples):
    """The export of the law that has much in it, in double precision: most checks are of it."""
    return export(_request())


def _written(folder: Path, made: Export) -> Export:
    write_files(folder, made.files)
    return made


def _make(folder: Path, *words: str) -> str:
    done = subprocess.run(["make", *words], cwd=folder, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    return done.stdout


def _request(law=None, **options) -> Request:
    law = Filtered(gain=[3.0, 2.0]) if law is None else law
    return Request(loop_of(law), start(), 100.0, "A */ title", "", PROVENANCE, **options)


@needs("gcc")
@pytest.mark.slow
@pytest.mark.parametrize("single", [False, True], ids=["double", "single"])
def test_a_law_with_branches_loops_and_functions_agrees_to_the_bit(tmp_path, filtered, single):
    made = _written(tmp_path, export(_request(single=True)) if single else filtered)
    assert "0 numbers differ" in _make(tmp_path, "test", "CC=gcc")
    assert made.vectors.expected.shape[0] == 64 + vectors.EDGES
    assert np.isfinite(made.vectors.expected[:64]).all()
    assert np.isnan(made.vectors.expected).any()  # edge cases reach what is not a number
    text = made.files["controller.c"].decode()
    assert "for (" in text
    assert "} else {" in text
    assert "malloc" not in text


def _by_xla(function, cases, shared=None):
    return jax.jit(jax.vmap(function, (0, None)))


@pytest.mark.slow
def test_closed_loops_are_those_that_xla_flies(monkeypatch):
    request = _request(Sliced(gain=[3.0, 2.0]))
    program = flight_program(request.loop, request.start)
    flown, recorded = vectors.vectors(program, request.loop, request.start, request.duration)
    monkeypatch.setattr(vectors, "_over_cases", _by_xla)
    by_xla, recorded_by_xla = vectors.vectors(
        program, request.loop, request.start, request.duration
    )
    np.testing.assert_allclose(flown.given[:64], by_xla.given[:64], rtol=1e-9, atol=1e-12)
    np.testing.assert_allclose(recorded, recorded_by_xla, rtol=1e-9, atol=1e-12)
    np.testing.assert_array_equal(recorded[:, 0], np.arange(32))  # all, from the first on
    size = program.structs["input"].size
    every_second = flown.given[:16, 1:size]
    np.testing.assert_array_equal(recorded[1::2, 1:], every_second)


@needs("cppcheck")
@pytest.mark.slow
@pytest.mark.parametrize("libm", [False, True], ids=["own", "libm"])
def test_no_rule_of_misra_is_broken_but_those_that_are_told(tmp_path, filtered, libm):
    made = _written(tmp_path, export(_request(libm=True)) if libm else filtered)
    listed = set((tmp_path / "misra_deviations.txt").read_text().split())
    readme = made.files["README.md"].decode()
    assert all(rule in readme for rule in listed)
    if libm:
        _make(tmp_path, "cppcheck")  # fails on a rule that is not listed
        found = re.search(r"^DIFFERENCE \?= (\S+)$", (tmp_path / "Makefile").read_text(), re.M)
        assert found
        assert 0.0 < float(found[1]) < 1e-3
        _make(tmp_path, "fly")
        return
    (tmp_path / "misra_deviations.txt").write_text("missingIncludeSystem\nunusedStructMember\n")
    command = ["make", "cppcheck"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode != 0
    found = set(re.findall(r"misra-c2012-[\d.]+", done.stdout + done.stderr))
    assert found
    assert found <= listed


@needs("cmake")
@needs("ctest")
@pytest.mark.slow
def test_cmake_builds_and_tests_it_and_the_folder_can_be_replaced(tmp_path, filtered):
    target = tmp_path / "flight"

    def export_again(overwrite):
        place = OutputFolder(target, kind="code", overwrite=overwrite, is_made_of_it=is_built)
        with place as folder:
            for name, content in filtered.files.items():
                folder.write(name, content)

    export_again(overwrite=False)
    for command in ("cmake -S . -B build", "cmake --build build", "ctest --test-dir build"):
        done = subprocess.run(command.split(), cwd=target, capture_output=True, text=True)
        assert done.returncode == 0, done.stdout + done.stderr
    assert "100% tests passed" in done.stdout
    digest = json.loads(filtered.files["export.json"])["source_sha256"]
    assert digest.encode() in (target / "build" / "libcontroller.so").read_bytes()
    with (target / "controller.c").open("a") as code:
        code.write("/* edited */\n")
    subprocess.run(["cmake", "--build", "build"], cwd=target, capture_output=True, check=True)
    digest = hashlib.sha256(b"".join((target / f"controller.{x}").read_bytes() for x in "hc"))
    assert digest.hexdigest().encode() in (target / "build" / "libcontroller.so").read_bytes()
    (target / "controller.c").write_bytes(filtered.files["controller.c"])
    export_again(overwrite=True)
    assert not (target / "build").exists()
    _make(target, "all", "CC=gcc")
    (target / "build" / "notes.txt").write_text("mine")
    with pytest.raises(OutputError, match="notes"):
        export_again(overwrite=True)
    assert (target / "build" / "notes.txt").read_text() == "mine"
    assert (target / "build" / "test_controller").exists()


def test_what_a_build_makes_is_known_by_its_names():
    assert is_built("build")
    assert is_built("build/controller.o")
    assert is_built("build/CMakeFiles/controller.dir/link.txt")
    assert is_built("__pycache__/machine_code.cpython-312.pyc")
    assert not is_built("build/notes.txt")
    assert not is_built("build/CMakeFilesOfMine")
    assert not is_built("notes.txt")


def _bent(x):
    return jnp.sin(x) * x + 1.0


def _whole(p, x):
    once = _bent(x)
    twice = _bent(2 * x)
    return once + twice * _bent(p)


def test_equal_calls_of_a_python_function_become_calls_of_one():
    p, x = jnp.arange(6.0), jnp.linspace(0.1, 2.0, 6)
    cut, outline = outlined(jaxpr_of(_whole, p, x))
    assert [(name, count) for _, name, _, count in outline.functions.values()] == [("_bent", 3)]
    assert [e.is_call for e in cut.equations].count(True) == 3
    np.testing.assert_allclose(_folded(cut, p, x), _whole(p, x), rtol=1e-14)  # XLA fuses


def _folded(jaxpr, *arrays):
    """The first result of a program for known arrays."""
    found = lower(Builder(), jaxpr, [as_elements(x) for x in arrays])[0]
    return np.array(found.tolist())


def _inner(p):
    return jnp.sqrt(p @ p + 1.0) * jnp.outer(p, p)


def _first(p, x):
    return jnp.sum(_inner(p) @ jnp.sin(x)) + jnp.cos(x).sum() + jnp.tanh(x).sum()


def _second(p, x):
    return jnp.sum(_inner(p) @ jnp.cos(x)) + jnp.sinh(x).sum() + jnp.exp(x).sum()


def _outer(p, x):
    return _first(p, x) * _second(p, x) + jnp.sum(x)


def test_what_two_functions_compute_alike_is_computed_once_before_them():
    p, x = jnp.arange(7.0), jnp.linspace(0.1, 2.0, 7)
    cut, outline = outlined(jaxpr_of(_outer, p, x))
    called = [e.parameters["name"] for e in cut.equations if e.is_call]
    assert called == ["python:_inner", "python:_first", "python:_second"]
    told = {name: closed for closed, name, _, _ in outline.functions.values()}
    assert not any(e.is_call for e in told["_first"].equations)
    np.testing.assert_allclose(_folded(cut, p, x), _outer(p, x), rtol=1e-13)


@needs("clang")
@pytest.mark.slow
def test_clang_and_the_sanitizers_find_nothing(tmp_path, filtered):
    _written(tmp_path, filtered)
    assert "0 numbers differ" in _make(tmp_path, "test", "sanitize", "CC=clang")


@needs("gcc")
@pytest.mark.slow
def test_the_test_program_notices_one_changed_bit(tmp_path, filtered):
    made = _written(tmp_path, filtered)
    rows = np.frombuffer(made.files["test_vectors.bin"], "<f8").copy()
    width = made.vectors.given.shape[1] + made.vectors.expected.shape[1]
    place = 4 + 5 * width + made.vectors.given.shape[1]
    rows[place] = np.nextafter(rows[place], 9.0)
    (tmp_path / "test_vectors.bin").write_bytes(rows.tobytes())
    done = subprocess.run(["make", "test"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode != 0
    assert re.search(r" 1 numbers? differ", done.stdout)


TESTED = [
    "estimator.false_alarm_probability=1e-3",
    "estimator.patience=2",
    "estimator.probation=3",
    'failure=[{of="star_tracker",at_s=5,kind="spiking",spike_rad=0.1,spike_probability=0.4}]',
]
"""A test of innovations that excludes the star tracker and uses it again, many times over."""


@needs("gcc")
@pytest.mark.slow
@pytest.mark.parametrize("more", [[], TESTED], ids=["untested", "tested"])
def test_estimator_and_modulation_agree_to_the_bit(tmp_path, more):
    scenario = load(
        "switching",
        [
            "gyro.noise_density_rad_s_sqrt_Hz=1.5e-5",
            "star_tracker.across_rad=2.4e-5",
            "star_tracker.along_rad=1.2e-4",
            "star_tracker.latency_s=0.2",
            *more,
        ],
    )
    run = build(scenario)
    request = Request(run.loop, run.start, 100.0, "With a filter", "", PROVENANCE)
    made = _written(tmp_path, export(request))
    assert made.program.estimates
    assert "0 numbers differ" in _make(tmp_path, "test", "CC=gcc")
    _make(tmp_path, "fly", "CC=gcc")
    commands = np.loadtxt(tmp_path / "build" / "commands.csv", delimiter=",")
    assert len(commands) == vectors.SAMPLES  # of one run
    assert np.isfinite(commands).all()


@needs("qemu-system-arm")
@needs("arm-none-eabi-gcc")
@pytest.mark.slow
def test_an_emulated_cortex_m_agrees_to_the_bit(tmp_path, filtered):
    _written(tmp_path, filtered)
    told = _make(tmp_path, "cortex-m")
    assert told.count(" 0 numbers differ") == 4
    counts = re.findall(r"(\d+) instructions a step at most, (\d+) behind the guard", told)
    (m4, guarded_m4), (m7, guarded_m7) = ((int(one), int(other)) for one, other in counts)
    assert 100 < m7 < m4 / 2  # its unit has double precision
    assert m4 / 2 < guarded_m4 < 2 * m4
    assert m7 / 2 < guarded_m7 < 2 * m7
    bounds = [int(one) for one in re.findall(r"(\d+) instructions at most", told)]
    for count, bound in zip((m4, guarded_m4, m7, guarded_m7), bounds, strict=True):
        assert count < bound < 20 * count


@needs("gcc")
@pytest.mark.slow
def test_the_library_runs_in_the_place_of_the_law(tmp_path, filtered):
    request, made = _request(), _written(tmp_path, filtered)
    _make(tmp_path, "build/libcontroller.so", "CC=gcc")
    library = Library(tmp_path / "build" / "libcontroller.so", request.loop, request.start)
    assert isinstance(request.loop, SampledLoop)
    law, state = request.loop.controller, request.start
    assert isinstance(law, Filtered)
    outside: Any = with_library(request.loop, library).controller
    states = jax.vmap(lambda x: PlantState(state.attitude, x * state.omega))(jnp.arange(1.0, 4.0))
    memory = jax.vmap(law.init)(states)
    for t in jnp.array([0.0, 0.5]):
        inside = jax.vmap(law.step, (None, 0, 0))(t, states, memory)
        found = jax.jit(jax.vmap(outside.step, (None, 0, 0)))(t, states, memory)
        for one, other in zip(jax.tree.leaves(inside), jax.tree.leaves(found), strict=True):
            np.testing.assert_allclose(other, one, rtol=1e-9, atol=1e-12)
        memory = found[1]
    stronger = eqx.tree_at(lambda x: x.law.gain, outside, 2 * law.gain)  # as a case may have it
    once = outside.step(jnp.array(1.0), state, law.init(state))[0]
    np.testing.assert_array_equal(
        stronger.step(jnp.array(1.0), state, law.init(state))[0], 2 * once
    )
    assert made.program.hash == library.program.hash
    record = json.loads(made.files["export.json"])
    assert library.identity["source_sha256"] == record["source_sha256"]
    with pytest.raises(LibraryError, match="export it again"):
        Library(library.path, loop_of(_Other(gain=[1.0, 1.0])), request.start)


class _Other(Filtered):
    """Another law."""

    def step(self, t, state, memory):
        command, memory = super().step(t, state, memory)
        return command + 1.0, memory


def test_a_file_that_is_no_library_is_told(tmp_path):
    place = tmp_path / "libcontroller.so"
    place.write_text("none")
    with pytest.raises(LibraryError, match="`make` built"):
        Library(place, loop_of(Filtered(gain=[1.0, 1.0])), start())


def test_a_loop_without_a_bound_is_told_with_its_line():
    with pytest.raises(CannotLower, match=r"`while`.*no bound.*laws\.py:\d+ \(Searching\.step\)"):
        export(_request(Searching(gain=[1.0, 1.0])))


def test_a_law_in_continuous_time_is_refused():
    run = build(load("paper-rate"))
    with pytest.raises(CannotExport, match="once a period"):
        export(Request(run.loop, run.start, 1.0, "", "", PROVENANCE))


def test_the_law_that_plans_itself_is_refused_at_once():
    run = build(load("acceptance-nominal", ["control.law=planned"]))
    with pytest.raises(CannotExport, match=r"got planned: it plans in flight"):
        flight_program(run.loop, run.start)


class Grounded(Filtered):
    """A law that does not become flight code."""

    no_flight_code = "it needs a computer on the ground"


def test_a_law_without_flight_code_is_told_as_a_scenario_names_it():
    told = f"control.law: must be a law with flight code, got {__name__}:Grounded: it needs"
    with pytest.raises(CannotExport, match=told):
        export(_request(Grounded(gain=[1.0, 1.0])))


def test_a_packages_law_without_flight_code_is_told_by_its_name(monkeypatch):
    own = EntryPoint("grounded", f"{__name__}:Grounded", "jaxsat.laws")
    groups = {"jaxsat.laws": [own]}
    monkeypatch.setattr(declared_laws, "entry_points", lambda group: groups[group])
    with pytest.raises(CannotExport, match="with flight code, got grounded: it needs a computer"):
        export(_request(Grounded(gain=[1.0, 1.0])))


def test_comments_end_where_they_should():
    told = "\n".join(comment(r"a */ b /* c // d ??/ e \ ω² " + "word " * 40))
    assert told.count("/*") == told.count("*/") == 1
    assert told.isascii()
    assert "//" not in told
    assert "??" not in told
    assert "omega^2" in told
    assert comment("a *\x01/ ?\x01?/ b") == ["/* a * / ? ?/ b */"]  # what is left out joins nothing


def test_names_are_identifiers_of_c_and_differ():
    names = Names()
    found = [names.new(identifier(*word)) for word in (["double"], ["A", "b"], ["a_b"], ["ω", "1"])]
    assert found == ["double_2", "a_b", "a_b_2", "omega_1"]


def test_repeated_statements_become_loops_in_the_same_order():
    lines = [f"  x[{i}][{j}] = y[{j}] * z[{i + 1}];" for i in range(4) for j in range(5)]
    assert rolled(lines) == [
        "  for (int32_t j = 0; j < 4; j++) {",
        "    for (int32_t i = 0; i < 5; i++) {",
        "      x[j][i] = y[i] * z[j + 1];",
        "    }",
        "  }",
    ]


def test_parts_of_longer_rows_are_no_array_of_their_own():
    """x[i][:4] of rows of seven, given as rows of four, would be read at the wrong places."""
    shapes = {"x": (3, 7), "now->field": (3, 4)}
    assert not has_rows("x", (3, 4), shapes)
    assert has_rows("x", (2, 7), shapes)  # its first rows
    assert has_rows("x[2]", (4,), shapes)  # the beginning of one
    assert has_rows("now->field", (3, 4), shapes)
    assert not has_rows("next->field", (3, 4), shapes)  # nothing is known of it


def test_parts_of_longer_rows_are_copied_wherever_they_are():
    """In fields of the next state and in arrays that a function gives back."""
    program = flight_program(loop_of(Sliced(gain=[3.0, 2.0])), start())
    text = source(program, [], libm=False)
    calls = re.findall(r"^ +product_4x3_3\((.*?),", text, re.MULTILINE)
    assert len(calls) == 2  # the step's own, and that of a function which is called twice
    for given in calls:
        assert re.search(rf"^ +const double {re.escape(given)}\[4\]\[3\] = ", text, re.MULTILINE)


@needs("gcc")
@pytest.mark.slow
@pytest.mark.parametrize("single", [False, True], ids=["double", "single"])
def test_parts_of_longer_rows_agree_to_the_bit(tmp_path, single):
    made = _written(tmp_path, export(_request(Sliced(gain=[3.0, 2.0]), single=single)))
    assert "0 numbers differ" in _make(tmp_path, "test", "CC=gcc")
    assert np.isfinite(made.vectors.expected[:64]).all()
    assert len(np.unique(made.vectors.expected[:64], axis=0)) == 64  # it does not come to rest


@needs("cc")
@needs("gcc")
@needs("gcov")
@needs("frama-c")
@pytest.mark.slow
def test_frama_c_finds_no_run_time_error_and_one_that_is_put_in(tmp_path, filtered):
    _written(tmp_path, filtered)
    assert "0 alarms generated" in _make(tmp_path, "prove")
    text = (tmp_path / "controller.c").read_text()
    begin = "  state->begin_sample = in->sample;"
    assert text.count(begin) == 1
    wrong = f"  state->law_rates[in->sample & 7][0] = 0.0;\n{begin}"
    (tmp_path / "controller.c").write_text(text.replace(begin, wrong))
    done = subprocess.run(["make", "prove"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode != 0
    assert "accessing out of bounds index" in done.stdout


@pytest.mark.slow
def test_emulated_are_all_samples_that_reach_new_code(tmp_path, filtered, monkeypatch):
    """Counted by gcov: with the samples chosen, as many lines run as with all."""
    _written(tmp_path, filtered)
    monkeypatch.setattr(measure, "DEAREST", 3)
    chosen = measure.samples_worth_emulating(tmp_path)
    every = (tmp_path / "test_vectors.bin").read_bytes()
    count = len(filtered.vectors.given)
    assert 3 < len(chosen) < count / 4
    some = measure._some_of(every, chosen)
    assert _lines_run(tmp_path, some) == _lines_run(tmp_path, every)
    fewer = measure._some_of(every, chosen[-1:])
    assert _lines_run(tmp_path, fewer) < _lines_run(tmp_path, every)
    monkeypatch.setattr(measure, "HOST", "no-such-compiler")
    assert len(measure.samples_worth_emulating(tmp_path)) == count


def _lines_run(folder: Path, samples: bytes) -> float:
    """Percent of the lines of controller.c that these samples run."""
    (folder / "some.bin").write_bytes(samples)
    for old in folder.glob("*.gcda"):
        old.unlink()
    command = "gcc -O0 -ffp-contract=off --coverage test_controller.c controller.c -o covered -lm"
    subprocess.run(command.split(), cwd=folder, check=True)
    subprocess.run(["./covered", "some.bin"], cwd=folder, check=True, capture_output=True)
    command = ["gcov", "-n", "covered-controller.gcda"]
    told = subprocess.run(command, cwd=folder, check=True, capture_output=True, text=True).stdout
    found = re.search(r"File 'controller.c'\nLines executed:([\d.]+)%", told)
    assert found is not None
    return float(found.group(1))
