"""What a command tells while it works: soon, everywhere, and nothing with --quiet."""

import os
import subprocess
import sys
import time
from pathlib import Path

import pytest

from jaxsat.cli import progress

ROOT = Path(__file__).parents[2]
TOKENS = ["scenarios", "check", "switching"]

SLOW = """
import sys, time
import jaxsat.cli.app as app
import jaxsat.cli.scenarios as module
from jaxsat.cli.progress import show_progress
def load(name, overrides, purpose):
    assert "jax" not in sys.modules
    show_progress("reading a\\x1b[31m\\nscenario " + "x" * 200)
    time.sleep(float(sys.argv[1]))
    class Scenario: title = "done"
    return Scenario
module.load_scenario = load
module.refusals = lambda scenario: ()
app.import_interruptibly = lambda *modules: None
from jaxsat.cli import main
main(["scenarios", "check", "x"])
"""


def environment(**more):
    return {**os.environ, "PYTHONPATH": str(ROOT), **more}


def slow(seconds):
    """A command that reads a scenario for so long."""
    return [sys.executable, "-c", SLOW, str(seconds)]


def in_a_terminal(seconds, **more):
    """All that appears on a terminal, and what came with the first byte."""
    pty = pytest.importorskip("pty")
    ours, theirs = pty.openpty()
    with subprocess.Popen(
        slow(seconds), stdout=theirs, stderr=theirs, env=environment(**more)
    ) as process:
        os.close(theirs)
        parts = []
        while True:
            try:
                part = os.read(ours, 65536)
            except OSError:  # the other end is closed
                break
            if not part:
                break
            parts.append(part)
        assert process.wait() == 0
    os.close(ours)
    return b"".join(parts).decode(), parts[0].decode()


def on_screen(text):
    """The lines that remain visible after all erasures."""
    return [line.split(progress.ERASE)[-1] for line in text.split("\r\n")]


@pytest.mark.slow
def test_a_live_line_on_a_terminal_before_jax_is_imported():
    text, first = in_a_terminal(
        1.5, TERM="xterm", COLUMNS="40", LINES="24", LC_ALL="C", NO_COLOR="1"
    )
    assert first.startswith(progress.ERASE)
    lines = text.split(progress.ERASE)
    assert all(len(line) < 40 for line in lines[:-1])
    assert any("reading a\\x1b[31m" in line for line in lines)
    assert len(lines) > 8
    assert "\x1b[31m" not in text
    assert on_screen(text) == ["x: valid (done)", ""]  # the live line has gone


@pytest.mark.slow
@pytest.mark.parametrize("columns", ["many", "1", "2", "0"])
def test_narrow_terminals(columns):
    text, _ = in_a_terminal(0.7, TERM="xterm", COLUMNS=columns)
    assert progress.ERASE in text
    assert on_screen(text) == ["x: valid (done)", ""]


@pytest.mark.slow
def test_plain_lines_on_a_dumb_terminal_and_in_a_pipe():
    text, _ = in_a_terminal(3, TERM="dumb")
    assert "\x1b" not in text
    assert "jaxsat: reading a\\x1b[31m\\nscenario" in text  # after a slow start is told
    done = subprocess.run(slow(3), capture_output=True, env=environment(), check=True)
    assert done.stdout == b"x: valid (done)\n"
    lines = done.stderr.decode().splitlines()
    assert 2 <= len(lines) <= 4
    assert all(line.startswith("jaxsat: reading a") for line in lines)


def test_plain_lines_come_less_and_less_often():
    times = [0.8]
    while times[-1] < 600:
        times.append(times[-1] + progress.until_next_line(times[-1]))
    assert len(times) < 20
    gaps = list(map(progress.until_next_line, times))
    assert gaps == sorted(gaps)
    assert gaps[-1] == progress.MAX_INTERVAL_S


@pytest.mark.slow
def test_nothing_with_quiet(command_line, monkeypatch):
    monkeypatch.setattr(progress, "FIRST_DELAYS_S", (0.0, 0.0))
    short = ("--set", "simulation.duration_s=1", "--out")
    assert command_line("simulate", "switching", *short, "loud")[2] != ""
    assert command_line("simulate", "switching", *short, "quiet", "--quiet") == (0, "", "")


@pytest.mark.slow
@pytest.mark.parametrize("unbuffered", ["", "1"])
def test_progress_that_cannot_be_written_is_no_reason_to_fail(unbuffered):
    begin = time.monotonic()
    with open("/dev/full", "w") as full:
        done = subprocess.run(
            slow(1.5), stdout=subprocess.PIPE, stderr=full,
            env=environment(PYTHONUNBUFFERED=unbuffered), check=True,
        )  # fmt: skip
    assert done.stdout == b"x: valid (done)\n"
    assert time.monotonic() - begin > 1.5
