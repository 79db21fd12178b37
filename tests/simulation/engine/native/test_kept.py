"""Kernels kept on disk: found again only where nothing has changed that they depend on."""

import dataclasses
import functools
import os
import sys
import time

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
from jaxsat.simulation.engine.native import NativeEngine, engine, kept
from jaxsat.spacecraft.dynamics import PlantState
from simulation.engine.examples import EXAMPLES, KICKS, program, same_bits

SECOND = 10**9
SURROUNDINGS = kept._surroundings.__wrapped__  # before the fixture replaces it, and not remembered


@pytest.fixture(autouse=True)
def folder(tmp_path, monkeypatch):
    monkeypatch.setenv("JAXSAT_CACHE_DIR", str(tmp_path))
    monkeypatch.setenv(kept.IN_USE, "1")
    monkeypatch.setattr(cache, "_told", cache.threading.Event())
    monkeypatch.setattr(kept, "_surroundings", lambda: "here")  # files may be newer than this run
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
    first = kept.sources_hash(sources, later())
    assert first is not None
    assert kept.sources_hash(sources, later()) == first
    status = (sources / "one.py").stat()
    (sources / "one.py").write_text("x = 2\n")
    os.utime(sources / "one.py", ns=(status.st_atime_ns, status.st_mtime_ns))
    second = kept.sources_hash(sources, later())
    (sources / "inner" / "two.py").rename(sources / "two.py")
    third = kept.sources_hash(sources, later())
    (sources / "one.py").touch()
    fourth = kept.sources_hash(sources, later())
    (sources / "new.py").write_text("")
    fifth = kept.sources_hash(sources, later())
    (sources / "field.shc").write_text("1 0 -29350.0\n")
    sixth = kept.sources_hash(sources, later())
    assert len({first, second, third, fourth, fifth, sixth}) == 6
    (sources / "__pycache__").mkdir()
    (sources / "__pycache__" / "one.cpython-311.pyc").touch()
    assert kept.sources_hash(sources, later()) == sixth


def test_sources_changed_since_they_were_imported_have_no_hash(sources, tmp_path):
    assert kept.sources_hash(sources, later(-1)) is None
    assert kept.sources_hash(sources, later(30)) is None  # the file system's clock may be behind
    (sources / "one.py").rename(sources / "three.py")
    os.utime(sources / "three.py", (1, 1))
    assert kept.sources_hash(sources, later(30)) is None  # an older file put in its place
    assert kept.sources_hash(tmp_path / "nothing", later()) is None


def test_surroundings_are_python_packages_and_sources(monkeypatch):
    monkeypatch.setattr(jaxsat, "IMPORTED_NS", later())
    first = SURROUNDINGS()
    assert SURROUNDINGS() == first
    changed = [SURROUNDINGS()]
    for where, name, value in (
        (sys, "version", "4.0"),
        (kept, "PACKAGES", kept.PACKAGES[1:]),
        (kept.importlib.metadata, "version", lambda name: "0.0"),
        (kept, "sources_hash", lambda folder, before: "other"),
    ):
        with monkeypatch.context() as here:
            here.setattr(where, name, value)
            changed.append(SURROUNDINGS())
    assert len({*changed, None}) == 6
    with monkeypatch.context() as here:
        here.setattr(kept, "PACKAGES", ("a package that is not there",))
        assert SURROUNDINGS() is None
    monkeypatch.setattr(jaxsat, "IMPORTED_NS", 0)
    assert SURROUNDINGS() is None


def test_names_depend_on_kinds_and_not_on_numbers(monkeypatch):
    name = kept.entry_name({"a": jnp.ones(3)}, 8, False)
    assert name is not None
    assert kept.entry_name({"a": jnp.zeros(3)}, 8, False) == name
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
    names = [kept.entry_name(*other) for other in others]
    assert len({*names, name, None}) == len(others) + 2
    with jax.threefry_partitionable(not jax.config.jax_threefry_partitionable):
        assert kept.entry_name({"a": jnp.ones(3)}, 8, False) not in (name, None)
    monkeypatch.setattr(kept, "_surroundings", lambda: "elsewhere")
    assert kept.entry_name({"a": jnp.ones(3)}, 8, False) not in (name, None)
    monkeypatch.setattr(kept, "_surroundings", lambda: None)
    assert kept.entry_name({"a": jnp.ones(3)}, 8, False) is None


class Own:
    """A part that is not jaxsat's."""


def test_code_of_others_has_no_name(monkeypatch):
    def local():
        pass

    for part in (Own, Own(), local, functools.partial(later, 1), [{"x": Own()}]):
        assert kept.entry_name(part, 8) is None
    assert kept.entry_name(functools.partial(np.add, 1), PlantState) is not None
    monkeypatch.delenv(kept.IN_USE)
    assert kept.entry_name(1.0) is None


def made(number):
    return kept.MadeKernel(b"%d" % number, 0, 0, Arguments({}, []), None, None, None, False, "")


def test_an_entry_is_made_once_and_again_when_damaged(folder):
    def never():
        raise AssertionError

    assert kept.kept_or_made("one.kernel", kept.MadeKernel, lambda: made(1)) == made(1)
    assert kept.kept_or_made("one.kernel", kept.MadeKernel, never) == made(1)
    entry = folder / "one.kernel"
    content = entry.read_bytes()
    (folder / "two.kernel").write_bytes(content)
    (folder / "two.kernel").chmod(0o600)
    assert kept.kept_or_made("two.kernel", kept.MadeKernel, lambda: made(2)) == made(
        2
    )  # under another's name
    entry.write_bytes(content[:-1] + bytes([content[-1] ^ 1]))
    assert kept.kept_or_made("one.kernel", kept.MadeKernel, lambda: made(3)) == made(3)
    cache.keep("one.kernel", b"what an older jaxsat wrote")
    assert kept.kept_or_made("one.kernel", kept.MadeKernel, lambda: made(4)) == made(4)
    assert kept.kept_or_made(None, kept.MadeKernel, lambda: made(5)) == made(5)


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
