"""The page docs/your-own-disturbance.md, done as it says."""

import re
import sys
from pathlib import Path

import pytest

from jaxsat.core import process

PAGE = Path(__file__).parents[2] / "docs" / "your-own-disturbance.md"
TEXT = PAGE.read_text(encoding="utf-8")
COMMANDS = re.findall(r"^    jaxsat (.*)$", TEXT, re.MULTILINE)


@pytest.fixture(autouse=True)
def _files(tmp_path, monkeypatch):
    """The three files of the page in the current folder."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(process, "_ADDED", [])
    solar, valves = blocks("python")
    files = {"solar.py": solar, "valves.py": valves, "disturbed.toml": blocks("toml")[0]}
    for name, text in files.items():
        (tmp_path / name).write_text(text, encoding="utf-8")
    yield
    for name in ("solar", "valves"):
        sys.modules.pop(name, None)


def blocks(kind):
    return re.findall(rf"^```{kind}\n(.*?)^```$", TEXT, re.MULTILINE | re.DOTALL)


def test_its_scenario_is_all_right(command_line):
    status, out, err = command_line(*COMMANDS[0].split())
    valid = "disturbed.toml: valid (A failed thruster in sunlight)"
    assert (status, out.splitlines()[0]) == (0, valid), err


@pytest.mark.slow
def test_its_commands_simulate_and_disperse(command_line):
    status, out, err = command_line(*COMMANDS[1].split())
    assert status == 0, err
    status, out, err = command_line(*COMMANDS[2].replace("-n 1000", "-n 8").split())
    assert status == 0, err
    assert "8 settled, 0 unsettled" in out
    assert "not the native engine" not in err


@pytest.mark.slow
def test_commands_that_cannot_know_them_say_so(command_line):
    status, _, err = command_line("bound", "disturbed.toml")
    assert status == 2
    assert "actuators: must be left out for a bound" in err
    status, out, err = command_line("controllability", "disturbed.toml")
    assert status == 0, err
    assert "Disturbances not included: panel." in out
