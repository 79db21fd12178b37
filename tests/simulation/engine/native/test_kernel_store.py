"""Kernels kept on disk: found again only where nothing has changed that they depend on."""

import configparser
import dataclasses
import functools
import os
import subprocess
import sys
import time
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsat
from jaxsat.compiler.llvm import cache
from jaxsat.compiler.llvm.arguments import Arguments
from jaxsat.core.fingerprint import fingerprint
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.engine.native import NativeEngine, engine, kernel_store
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.studies.dispersions import Dispersed
from simulation.engine.examples import EXAMPLES, KICKS, program, same_bits

SECOND = 10**9
SURROUNDINGS = kernel_store._surroundings  # before the fixture replaces it


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("JAXSAT_CACHE_DIR", str(tmp_path))
    monkeypatch.delenv(kernel_store.SETTING, raising=False)
    monkeypatch.setattr(cache, "_told", cache.threading.Event())
    monkeypatch.setattr(
        kernel_store, "_surroundings", lambda: "here"
    )  # files may be newer than this run
    code_in_memory(monkeypatch)  # which tests change, and so does their type checker
    monkeypatch.setattr(kernel_store, "loaded_as_written", lambda package: True)
    return tmp_path / "native"


@pytest.fixture
def sources(tmp_path):
    folder = tmp_path / "sources"
    (folder / "inner").mkdir(parents=True)
    (folder / "one.py").write_text("x = 1\n")
    (folder / "inner" / "two.py").write_text("y = 2\n")
    return folder


def later(seconds=3600):
    return time.time_ns() + seconds * SECOND


def test_a_change_of_any_source_file_is_another_hash(sources):
    first = kernel_store.sources_hash(sources)
    assert kernel_store.sources_hash(sources) == first
    status = (sources / "one.py").stat()
    (sources / "one.py").write_text("x = 2\n")
    os.utime(sources / "one.py", ns=(status.st_atime_ns, status.st_mtime_ns))
    second = kernel_store.sources_hash(sources)
    (sources / "inner" / "two.py").rename(sources / "two.py")
    third = kernel_store.sources_hash(sources)
    (sources / "one.py").touch()
    fourth = kernel_store.sources_hash(sources)
    (sources / "new.py").write_text("")
    fifth = kernel_store.sources_hash(sources)
    (sources / "field.shc").write_text("1 0 -29350.0\n")
    sixth = kernel_store.sources_hash(sources)
    assert len({first, second, third, fourth, fifth, sixth}) == 6
    (sources / "__pycache__").mkdir()
    (sources / "__pycache__" / "one.cpython-311.pyc.140").touch()
    assert kernel_store.sources_hash(sources) == sixth


def test_sources_changed_since_they_were_imported_are_told(sources, tmp_path):
    assert kernel_store.unchanged(sources, later())
    assert not kernel_store.unchanged(sources, later(-1))
    assert not kernel_store.unchanged(sources, later(30))  # the file system's clock may be behind
    (sources / "one.py").rename(sources / "three.py")
    os.utime(sources / "three.py", (1, 1))
    assert not kernel_store.unchanged(sources, later(30))  # an older file put in its place
    assert not kernel_store.unchanged(tmp_path / "nothing", later())


def test_surroundings_are_python_packages_and_sources(monkeypatch):
    packages_and_sources = kernel_store._packages_and_sources.__wrapped__  # what is not remembered
    monkeypatch.setattr(kernel_store, "_packages_and_sources", packages_and_sources)
    monkeypatch.setattr(jaxsat, "IMPORTED_NS", later())
    first = SURROUNDINGS()
    assert SURROUNDINGS() == first
    changed = [SURROUNDINGS()]
    for where, name, value in (
        (sys, "version", "4.0"),
        (kernel_store, "PACKAGES", kernel_store.PACKAGES[1:]),
        (kernel_store.importlib.metadata, "version", lambda name: "0.0"),
        (kernel_store, "sources_hash", lambda folder: "other"),
    ):
        with monkeypatch.context() as here:
            here.setattr(where, name, value)
            changed.append(SURROUNDINGS())
    assert len({*changed, None}) == 6
    with monkeypatch.context() as here:
        here.setattr(kernel_store, "PACKAGES", ("a package that is not there",))
        assert SURROUNDINGS() is None
    monkeypatch.setattr(jaxsat, "IMPORTED_NS", 0)
    assert SURROUNDINGS() is None


def test_a_module_edited_while_a_program_runs_ends_what_is_kept(monkeypatch, sources):
    monkeypatch.setattr(kernel_store, "_surroundings", SURROUNDINGS)
    monkeypatch.setattr(jaxsat, "__file__", str(sources / "one.py"))
    monkeypatch.setattr(jaxsat, "IMPORTED_NS", later())
    assert kernel_store.entry_name(1.0) is not None
    monkeypatch.setattr(jaxsat, "IMPORTED_NS", (sources / "one.py").stat().st_mtime_ns)
    assert kernel_store.entry_name(1.0) is None


def test_names_depend_on_kinds_and_not_on_numbers(monkeypatch):
    name = kernel_store.entry_name({"a": jnp.ones(3)}, 8, False)
    assert name is not None
    assert kernel_store.entry_name({"a": jnp.zeros(3)}, 8, False) == name
    others = [
        ({"a": jnp.ones(4)}, 8, False),
        ({"a": jnp.ones(3, dtype=int)}, 8, False),
        ({"b": jnp.ones(3)}, 8, False),
        ({"a": jnp.ones(3)}, 4, False),
        ({"a": jnp.ones(3)}, 8, True),
        ({"a": jnp.ones(3)}, 8, 0.0),
        ({"a": jnp.ones(3)}, 8, -0.0),
        ({"a": None}, 8, False),
        ({"a": np.ones(3)}, 8, False),
        ({"a": np.zeros(3)}, 8, False),
    ]
    names = [kernel_store.entry_name(*other) for other in others]
    assert len({*names, name, None}) == len(others) + 2
    with jax.threefry_partitionable(not jax.config.jax_threefry_partitionable):
        assert kernel_store.entry_name({"a": jnp.ones(3)}, 8, False) not in (name, None)
    monkeypatch.setattr(kernel_store, "_surroundings", lambda: "elsewhere")
    assert kernel_store.entry_name({"a": jnp.ones(3)}, 8, False) not in (name, None)
    monkeypatch.setattr(kernel_store, "_surroundings", lambda: None)
    assert kernel_store.entry_name({"a": jnp.ones(3)}, 8, False) is None


class Own:
    """A part that is not jaxsat's."""


def test_code_of_others_has_no_name(monkeypatch):
    def local():
        pass

    for part in (Own, Own(), local, functools.partial(later, 1), [{"x": Own()}]):
        assert kernel_store.entry_name(part, 8) is None
    assert kernel_store.entry_name(functools.partial(np.add, 1), PlantState) is not None
    monkeypatch.setattr(kernel_store, "loaded_as_written", lambda package: False)
    assert kernel_store.entry_name(1.0) is None
    monkeypatch.setattr(kernel_store, "loaded_as_written", lambda package: True)
    monkeypatch.setenv(kernel_store.SETTING, "0")
    assert kernel_store.entry_name(1.0) is None


def test_code_that_a_program_can_reach_is_of_packages_below_its_own():
    flight, study = (kernel_store.entry_name(part).packages for part in (PlantState, Dispersed))
    assert flight == ("core", "compiler", "spacecraft", "control", "simulation")
    assert flight < study
    assert study[-1] == "studies"
    contract = configparser.ConfigParser()
    contract.read(Path(__file__).parents[4] / ".importlinter")
    rooms = contract["importlinter:contract:rooms"]["layers"].split("\n")[::-1]
    levels = [{one.strip() for one in room.split("|")} for room in rooms if room]
    assert levels.pop() == {"__main__"}
    at = 0
    for level in levels:
        assert set(kernel_store.LAYERS[at : at + len(level)]) == level
        at += len(level)
    assert at == len(kernel_store.LAYERS)


HASHED = """
import jaxsat.report.document, jaxsat.scenario.build.run, jaxsat.scenario.build.study
from jaxsat.simulation.engine.native.kernel_store import LAYERS, Entries, EntryName
print(*(len(Entries(EntryName("", LAYERS[:count]))._code) for count in (5, 9, 10)))
"""


def test_jaxsat_itself_has_no_code_of_others():
    done = subprocess.run([sys.executable, "-c", HASHED], check=True, capture_output=True)
    flight, study, scenario = map(int, done.stdout.split())
    assert 150 < flight < study < scenario


def made(number):
    return kernel_store.StoredKernel(
        b"%d" % number, 0, 0, Arguments({}, []), None, None, None, False, ""
    )


def never(*arguments):
    raise AssertionError


def look_up(name, number, make=None):
    entry = None if name is None else kernel_store.EntryName(name, ())
    return kernel_store.Entries(entry).look_up(
        kernel_store.StoredKernel, make or (lambda: made(number))
    )


def test_an_entry_is_made_once_and_again_when_damaged(folder):
    assert look_up("one", 1) == made(1)
    assert look_up("one", 1, never) == made(1)
    entry = folder / "one.StoredKernel.python.kernel"
    content = entry.read_bytes()
    other = folder / "two.StoredKernel.python.kernel"
    other.write_bytes(content)
    other.chmod(0o600)
    assert look_up("two", 2) == made(2)  # under another's name
    entry.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    assert look_up("one", 3) == made(3)
    cache.keep(entry.name, b"what an older jaxsat wrote")
    assert look_up("one", 4) == made(4)
    assert look_up(None, 5) == made(5)


def code_in_memory(monkeypatch, **modules):
    monkeypatch.setattr(kernel_store, "loaded_code", lambda package, known, parts: modules)


def test_an_entry_is_for_code_as_it_was_in_memory(monkeypatch):
    code_in_memory(monkeypatch, law=b"1", plant=b"1")
    assert look_up("one", 1) == made(1)
    code_in_memory(monkeypatch, law=b"1", figures=b"1")  # the plant is not imported yet
    assert look_up("one", 1, never) == made(1)
    code_in_memory(monkeypatch, law=b"2", plant=b"1")
    assert look_up("one", 2) == made(2)
    assert look_up("one", 2, never) == made(2)
    code_in_memory(monkeypatch, law=b"1", plant=b"1")
    assert look_up("one", 3) == made(3)


def test_code_changed_while_an_entry_is_made_is_not_kept(monkeypatch, folder):
    code_in_memory(monkeypatch, law=b"1")

    def make():
        code_in_memory(monkeypatch, law=b"2")
        return made(1)

    assert look_up("one", 1, make) == made(1)
    assert not list(folder.glob("*.kernel"))


def test_what_cannot_be_told_from_memory_is_not_kept(monkeypatch, folder):
    monkeypatch.setattr(kernel_store, "loaded_code", never)
    assert look_up("one", 1) == made(1)
    assert not list(folder.glob("*.kernel"))


def test_the_command_line_trusts_its_own_entries_alone(monkeypatch):
    code_in_memory(monkeypatch, law=b"changed")
    assert look_up("one", 1) == made(1)
    monkeypatch.setenv(kernel_store.SETTING, "1")
    code_in_memory(monkeypatch, law=b"of the file")
    assert look_up("one", 2) == made(2)
    assert look_up("one", 2, never) == made(2)
    monkeypatch.delenv(kernel_store.SETTING)
    assert look_up("one", 2, never) == made(2)
    code_in_memory(monkeypatch, law=b"changed")
    assert look_up("one", 1, never) == made(1)


def study(*changes):
    scenario = load("benchmark-three-axis", ["simulation.duration_s=3", *changes])
    return build_study(scenario, 5, engine="native")


@pytest.mark.slow
def test_a_kept_kernel_has_the_same_bits_and_operations_and_lowers_nothing(monkeypatch):
    lowered = []
    lower = engine.lower_trajectory
    monkeypatch.setattr(engine, "lower_trajectory", lambda *a: lowered.append(a) or lower(*a))
    monkeypatch.setattr(engine, "_kernels", {})
    first = study()
    numbers = np.arange(5)
    outputs, identity = first.evaluate(numbers), first.program_identity()
    again = dataclasses.replace(first, history=3).values(numbers)
    assert len(lowered) == 1
    assert identity["operations"] == fingerprint(
        first.engine.traced(first.program, first.cases(numbers))
    )

    engine._kernels.clear()
    second = study("control.k3=0.06")  # other numbers alone
    assert second.evaluate(numbers).cost[0] != outputs.cost[0]
    engine._kernels.clear()
    third = study()
    same_bits(third.evaluate(numbers), outputs)
    assert third.program_identity() == identity
    assert len(lowered) == 1
    for name, values in dataclasses.replace(third, history=3).values(numbers).items():
        np.testing.assert_array_equal(values, again[name])
    assert len(lowered) == 1

    study("control.internal_model=false").evaluate(numbers)
    study('simulation.solver={name="tsit5"}').evaluate(numbers)
    assert len(lowered) == 3


@pytest.mark.slow
def test_a_loop_of_somebody_else_is_lowered_each_time(monkeypatch, folder):
    example = EXAMPLES["corners"]()
    monkeypatch.setattr(engine, "_kernels", {})
    NativeEngine(example.scan.stepper).evaluate(program(example), KICKS[:2])
    assert not list(folder.glob("*.kernel"))


SESSION = """
import dataclasses, inspect, os, sys
sys.path.insert(0, os.getcwd())
import jax, jaxsat
jax.config.update("jax_enable_x64", True)
from jaxsat.control.rate import RateLaw
from jaxsat.scenario.build.load import load
from jaxsat.simulation.engine.native import engine
from jaxsat.simulation.engine.native.trajectory import lower_trajectory
from own_law import OwnLaw

FACTOR, CHANGED = float(sys.argv[1]), sys.argv[2] == "changed"
jaxsat.IMPORTED_NS += 10**12  # as if the sources had been there for long

lowered, lower = [], inspect.unwrap(lower_trajectory).__code__

def watch(frame, *_):  # a function in the place of another would be other code
    if frame.f_code is lower:
        lowered.append(frame.f_lineno)

class NotebookLaw(RateLaw):
    def feedback(self, *parts):
        return FACTOR * super().feedback(*parts)

def fly(kind):
    engine._kernels.clear()
    before = len(lowered)
    run = jaxsat.build(load("paper-rate", ["simulation.duration_s=5"]))
    law = kind(**vars(run.loop.controller))
    run = dataclasses.replace(run, loop=dataclasses.replace(run.loop, controller=law))
    sys.settrace(watch)
    rates = run.simulate().signals.omega
    sys.settrace(None)
    print(len(lowered) - before, *rates[-1].tolist())

for kind in (RateLaw, NotebookLaw, OwnLaw):
    fly(kind)
if CHANGED:
    feedback = RateLaw.feedback
    RateLaw.feedback = lambda self, *parts: 2 * feedback(self, *parts)
    fly(RateLaw)
"""

OWN_LAW = """
from jaxsat.control.rate import RateLaw

class OwnLaw(RateLaw):
    def feedback(self, *parts):
        return {} * super().feedback(*parts)
"""


@pytest.mark.slow
def test_a_session_uses_kernels_of_another_for_the_same_code_alone(tmp_path):
    """Of the library; never of laws of a notebook or of a module of its own, or changed ones."""

    def session(factor, change):
        (tmp_path / "own_law.py").write_text(OWN_LAW.format(factor))
        command = [sys.executable, "-B", "-c", SESSION, str(factor), change]
        environment = os.environ | {"JAXSAT_CACHE_DIR": str(tmp_path / "cache")}
        done = subprocess.run(
            command, cwd=tmp_path, env=environment, check=True, capture_output=True, text=True
        )
        lines = [line.split(maxsplit=1) for line in done.stdout.splitlines()]
        return [int(count) for count, _ in lines], [state for _, state in lines]

    counts, states = session(1.5, "same")
    assert counts == [1, 1, 1]
    assert states[1] == states[2] != states[0]
    counts, other = session(2.0, "changed")
    assert counts == [0, 1, 1, 1]
    assert other[0] == states[0]
    assert other[1] == other[2] == other[3]
    assert other[1] not in states
