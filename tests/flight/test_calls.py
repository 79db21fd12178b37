"""Calls of every entry point with parameters of their own, and those that a search finds."""

import dataclasses
import re
import subprocess

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from helpers.tools import needs
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.keys import number
from jaxsat.flight import search
from jaxsat.flight.calls import COAST, INIT, STEP, call_sizes, drawn_calls, expected_of_calls
from jaxsat.flight.files import export
from jaxsat.flight.harness import calls_header, records_header
from jaxsat.flight.interface import parameters
from jaxsat.flight.program import flight_program
from jaxsat.flight.reference import Reference
from jaxsat.flight.request import Request
from jaxsat.flight.search import NoSearch, found_calls
from jaxsat.flight.source import header, source
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from tests.flight.folders import write_files
from tests.flight.laws import loop_of, start

KEYS = (number("gain", "Gains", "N m s", at_least=1, at_most=50, size=2, tunable=True),)
PROVENANCE = {"versions": {"jaxsat": "0"}, "platform": "here", "created": "now"}


class Narrow(AbstractSampledController):
    """Its memory counts samples at which a rate is nearly some number, which the first has."""

    gain: Float[Array, "2"] = eqx.field(converter=as_float)
    period: Float[Array, ""] = eqx.field(converter=as_float, default=0.5)

    def init(self, state):
        """The rate, and no samples."""
        return state.omega[0] * self.gain[0], jnp.zeros_like(state.omega[0])

    def step(self, t, state, memory):
        """Feedback, and one more sample where the rate is near."""
        near = jnp.abs(state.omega[1] - 0.3217) < 1e-9
        count = jax.lax.cond(near, lambda x: x + jnp.sqrt(1 + x), lambda x: x, memory[1])
        return -self.gain * state.omega[:2], (memory[0], count)


@pytest.fixture(scope="module")
def narrow():
    """The program, its parameters, and samples: rows of inputs and states."""
    loop = loop_of(Narrow(gain=[3.0, 2.0]))
    program = flight_program(loop, start())
    rng = np.random.default_rng(1)
    samples = rng.normal(size=(20, program.structs["input"].size + program.structs["state"].size))
    samples[:, 0] = samples[:, -1] = np.arange(20)  # the first sample and the number of this one
    return program, parameters(program, loop, KEYS), samples


def _parts(program, rows):
    sizes = call_sizes(program)
    ends = np.cumsum(list(sizes.values()))[:-1]
    return dict(zip(sizes, np.split(rows, ends, axis=1), strict=True))


def test_drawn_parameters_are_within_their_ranges_and_at_their_bounds(narrow):
    program, table, samples = narrow
    rows = drawn_calls(program, table, samples)
    parts = _parts(program, rows)
    assert set(parts["kind"][:, 0]) == {STEP, INIT}  # there is no estimator
    place = 0
    for one in table:
        values = parts["parameters"][:, place : place + one.field.size]
        place += one.field.size
        least, most = one.bounds
        assert ((values >= least) & (values <= most)).all()
        assert len(np.unique(values)) > 20
        if one.key is not None:
            assert {least, most} <= set(values.ravel())


def test_whole_numbers_are_drawn_from_one_below_their_range_to_one_above_it(narrow):
    """And from -1, also where that is less."""
    program, table, samples = narrow
    numbers = np.array([3, 5], np.int32)
    field = dataclasses.replace(table[0].field, dtype=numbers.dtype)
    one = dataclasses.replace(table[0], field=field, default=numbers, key=None)
    rows = drawn_calls(program, [one, *table[1:]], samples)
    assert set(_parts(program, rows)["parameters"][:, :2].ravel()) == {*range(-1, 7)}


def test_what_is_expected_of_calls_is_what_the_law_does_with_their_parameters(narrow):
    program, table, samples = narrow
    rows = drawn_calls(program, table, samples)[::7]
    parts = _parts(program, rows)
    found = expected_of_calls(Reference(program), rows)
    names = [field.path for field in program.structs["input"].fields]
    place = sum(f.size for f in program.structs["input"].fields[: names.index("omega")])
    omega = parts["input"][:, place : place + 3]
    gain = parts["parameters"][:, :2]
    assert program.structs["parameters"].fields[0].path == "law.gain"
    begun, stepped = parts["kind"][:, 0] == INIT, parts["kind"][:, 0] == STEP
    assert begun.any()
    assert stepped.any()
    state = found[:, -program.structs["state"].size :]
    np.testing.assert_array_equal(state[begun, 0], (omega[:, 0] * gain[:, 0])[begun])
    np.testing.assert_array_equal(found[stepped, :2], (-gain * omega[:, :2])[stepped])
    np.testing.assert_array_equal(found[begun, :2], 0.0)
    np.testing.assert_array_equal(
        state[:, -1], np.where(begun, parts["input"][:, 0], parts["state"][:, -1])
    )


@needs("cc")
def test_a_search_finds_calls_that_take_a_branch_which_no_drawn_one_takes(
    narrow, monkeypatch, tmp_path
):
    monkeypatch.setenv("JAXSAT_CACHE_DIR", str(tmp_path))
    monkeypatch.setattr(search, "BLOCKS", 20_000)
    program, table, samples = narrow
    drawn = drawn_calls(program, table, samples)
    files = {
        "controller.h": header(program, []),
        "controller.c": source(program, [], libm=False),
        "controller_records.h": records_header(program, []),
        "controller_calls.h": calls_header(program, []),
    }
    found = found_calls(files, program, table, drawn, samples)

    def near(rows):
        parts = _parts(program, rows)
        begin = sum(field.size for field in program.structs["input"].fields) - 3
        rate = parts["input"][:, begin + 1]
        return (parts["kind"][:, 0] == STEP) & (np.abs(rate - 0.3217) < 1e-9)

    assert not near(drawn).any()
    assert near(found).any()
    values = _parts(program, found)["parameters"]
    bounds = [(*one.bounds,) for one in table for _ in range(one.field.size)]
    assert (values >= np.array(bounds)[:, 0]).all()
    assert (values <= np.array(bounds)[:, 1]).all()


def test_why_there_was_no_search_is_told(narrow, monkeypatch, tmp_path):
    monkeypatch.setenv("JAXSAT_CACHE_DIR", str(tmp_path))
    program, table, samples = narrow
    drawn = drawn_calls(program, table, samples)
    monkeypatch.setattr(search, "HOST", "no-such-compiler")
    with pytest.raises(NoSearch, match=r"no C compiler \(no-such-compiler\) is installed"):
        found_calls({"controller.c": ""}, program, table, drawn, samples)
    compiler = tmp_path / "compiler"
    compiler.write_text("#!/bin/sh\necho 'one\nx.c: error: no block' >&2\nexit 3\n")
    compiler.chmod(0o755)
    monkeypatch.setattr(search, "HOST", str(compiler))
    with pytest.raises(NoSearch, match=r"^compiler failed with code 3: x.c: error: no block$"):
        found_calls({"controller.c": ""}, program, table, drawn, samples)


@needs("gcc")
@needs("gcov")
@pytest.mark.slow
def test_test_vectors_run_every_line_and_nearly_every_branch(tmp_path, monkeypatch):
    monkeypatch.setattr("jaxsat.flight.files.measured", lambda files: {})
    monkeypatch.setattr("jaxsat.flight.vectors.SAMPLES", 64)
    monkeypatch.setattr(search, "BLOCKS", 50_000)
    scenario = load(
        "switching",
        ["gyro.bias_sigma_rad_s=1e-5", "star_tracker={across_rad=1e-5, along_rad=1e-4}"],
    )
    run = build(scenario)
    keys = scenario.law.declaration.keys
    made = export(Request(run.loop, run.start, 100.0, "", "", PROVENANCE, keys=keys))
    write_files(tmp_path, made.files)
    assert COAST in made.calls.given[:, 0]
    done = subprocess.run(
        ["make", "coverage", "CC=gcc"], cwd=tmp_path, capture_output=True, text=True, check=False
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(" 0 numbers differ") == 4
    assert done.stdout.count("elementary functions: 0 numbers differ") == 2
    assert (tmp_path / "build" / "mcdc.log").read_text().count(" 0 numbers differ") == 4
    effects = re.search(r"independent effect \(MC/DC\): ([\d.]+)% of", done.stdout)
    assert effects is not None
    assert float(effects.group(1)) > 90
    told = done.stdout[done.stdout.index("File 'controller.c'") :]
    lines = re.search(r"Lines executed:([\d.]+)%", told)
    branches = re.search(r"Taken at least once:([\d.]+)%", told)
    assert lines is not None
    assert branches is not None
    assert float(lines.group(1)) == 100
    assert float(branches.group(1)) > 95
