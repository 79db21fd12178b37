"""Laws with words and memories that C has no place for: their C is valid and agrees to the bit."""

import subprocess

import pytest

from helpers.tools import needs
from jaxsat.flight import vectors
from jaxsat.flight.files import export
from jaxsat.flight.request import Request
from tests.flight.folders import write_files
from tests.flight.hostile import Empty, Forgetful, PartlyEmpty, Worded
from tests.flight.laws import loop_of, start

PROVENANCE = {"versions": {"jaxsat": "0"}, "platform": "here", "created": "now"}


@pytest.fixture(autouse=True)
def _few_samples(monkeypatch):
    monkeypatch.setattr(vectors, "SAMPLES", 8)
    monkeypatch.setattr(vectors, "CASES", 2)
    monkeypatch.setattr(vectors, "LONGEST", 16)
    monkeypatch.setattr("jaxsat.flight.files.measured", lambda files: {})
    monkeypatch.setattr("jaxsat.flight.files.found_calls", lambda *given: given[3][:0])


@needs("clang")
@needs("gcc")
@pytest.mark.slow
@pytest.mark.parametrize(
    ("law", "single"), [(Empty, False), (PartlyEmpty, True), (Forgetful, False), (Worded, True)]
)
def test_a_hostile_law_agrees_to_the_bit(tmp_path, law, single):
    """With sanitizers, and without a warning; the Makefile makes warnings errors."""
    loop = loop_of(law(gain=[3.0, 2.0]))
    title = "A */ title ??/ *\x01/ \\"
    made = export(Request(loop, start(), 100.0, title, "", PROVENANCE, single=single))
    write_files(tmp_path, made.files)
    for compiler in ("gcc", "clang"):
        targets = ["sanitize", "build/controller_guard.o", "build/libcontroller.so"]
        command = ["make", "-B", *targets, f"CC={compiler}"]
        done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
        assert done.returncode == 0, (compiler, done.stdout + done.stderr)
        assert " 0 numbers differ" in done.stdout
        assert "warning" not in done.stderr
