"""What tools tell of an export is asked once."""

import shutil
import subprocess

import pytest

from jaxsat.flight import measure

FILES = {"controller.c": b"int f(void) { return 1; }", "README.md": b"text"}


@pytest.fixture
def calls(tmp_path, monkeypatch):
    """An empty cache, tools that exist, and how often they are asked."""
    tool = tmp_path / "tool"
    tool.write_text("")
    counted = []

    def ask(folder, *, has_emulator):
        assert has_emulator
        assert (folder / "controller.c").read_bytes()
        counted.append(sorted(file.name for file in folder.iterdir()))
        use = measure.ProcessorUse(stack=8, code=100, instructions=12, samples=3)
        return dict.fromkeys(measure.PROCESSORS, use)

    monkeypatch.setenv("JAXSAT_CACHE_DIR", str(tmp_path / "cache"))
    monkeypatch.setattr(shutil, "which", lambda name: str(tool))
    monkeypatch.setattr(measure, "_measure", ask)
    return counted, tool, monkeypatch


def test_equal_code_is_measured_once(calls):
    counted, tool, _ = calls
    first = measure.measured(FILES)
    assert measure.measured(FILES | {"README.md": b"another text"}) == first
    assert counted == [["controller.c"]]
    measure.measured(FILES | {"controller.c": b"int f(void) { return 2; }"})
    assert len(counted) == 2
    tool.write_text("another version")
    measure.measured(FILES)
    assert len(counted) == 3


def test_tools_that_fail_are_asked_again(calls):
    counted, _, monkeypatch = calls
    whole = measure._measure

    def fail(folder, *, has_emulator):
        raise subprocess.TimeoutExpired("tool", 1)

    monkeypatch.setattr(measure, "_measure", fail)
    assert all("TimeoutExpired" in use.why for use in measure.measured(FILES).values())
    monkeypatch.setattr(measure, "_measure", whole)
    assert [use.code for use in measure.measured(FILES).values()] == [100, 100]
    assert len(counted) == 1
