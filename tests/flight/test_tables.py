"""Tables of parameters that are indexed by variables, in exported code."""

import re
import subprocess

import numpy as np
import pytest

from helpers.tools import needs
from jaxsat.compiler.c.contexts import column_of
from jaxsat.flight import vectors
from jaxsat.flight.files import export
from jaxsat.flight.program import flight_program
from jaxsat.flight.request import Request
from jaxsat.flight.source import source
from tests.flight.folders import write_files
from tests.flight.laws import Scheduled, loop_of, start


def _loop():
    return loop_of(Scheduled(gains=np.random.default_rng(3).normal(size=(20, 2, 3))))


def test_a_table_of_parameters_is_read_in_place():
    text = source(flight_program(_loop(), start()), [], libm=False)
    rows = re.findall(r"p->law_gains\[(\w+)\]", text)
    assert len(set(rows)) == 2  # the loop's, and that of the count
    assert not any(row.isdigit() for row in rows)
    assert "double array" not in text


def test_an_index_is_compared_with_the_ends_of_its_table_alone():
    text = source(flight_program(_loop(), start()), [], libm=False)
    assert re.search(r"minimum_i32\(\w+, 19\)", text)
    assert not re.search(r"imum_i32\([^;]*(2147483647|INT32_MIN)", text)


def test_columns_are_elements_that_differ_in_one_index():
    assert column_of(["p->x[0][2]", "p->x[1][2]"]) == ("p->x", "[2]")
    assert column_of(["x[1][0]", "x[1][1]"]) == ("x[1]", "")
    assert column_of(["x[0]", "x[2]"]) is None
    assert column_of(["x[0][0]", "x[1][1]"]) is None
    assert column_of(["x[0] + 1", "x[1] + 1"]) is None


@needs("gcc")
@pytest.mark.slow
@pytest.mark.parametrize("single", [False, True], ids=["double", "single"])
def test_what_is_read_in_place_agrees_to_the_bit(tmp_path, monkeypatch, single):
    monkeypatch.setattr(vectors, "SAMPLES", 32)
    monkeypatch.setattr(vectors, "CASES", 2)
    monkeypatch.setattr("jaxsat.flight.files.measured", lambda files: {})
    provenance = {"versions": {"jaxsat": "0"}, "platform": "here", "created": "now"}
    made = export(Request(_loop(), start(), 100.0, "", "", provenance, single=single))
    write_files(tmp_path, made.files)
    done = subprocess.run(
        ["make", "test", "sanitize"], cwd=tmp_path, capture_output=True, text=True
    )
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(" 0 numbers differ") == 4
