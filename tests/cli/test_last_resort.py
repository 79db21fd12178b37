"""What no command expects: bugs, full disks, closed streams, signals at the worst moment."""

import errno
import os
import re
import signal
import stat
import subprocess
import sys
import threading
from pathlib import Path

import jax
import pytest

from jaxsat.cli.app import failure_of
from jaxsat.cli.computing import interruptibly

ROOT = Path(__file__).parents[2]


def recursion():
    recursion()


def raising(error):
    def fail(*_):
        raise error

    return fail


class Unprintable(Exception):
    def __repr__(self):
        raise ValueError("no")


@pytest.fixture
def failing(command_line, monkeypatch, tmp_path):
    """Run a command that does something instead of printing."""
    (tmp_path / "tmp").mkdir()
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "tmp"))

    def run(action):
        monkeypatch.setattr("jaxsat.cli.scenarios.print_text", lambda _: action())
        return command_line("scenarios", "show", "switching")

    return run


@pytest.mark.parametrize(
    ("action", "message"),
    [
        (raising(ValueError("what\n\x1b[31mever")), "ValueError: what"),
        (raising(KeyError("k")), "KeyError: 'k'"),
        (raising(Unprintable("odd")), "Unprintable: odd"),
        (raising(OSError(errno.EISDIR, "Is a directory", "x")), "IsADirectoryError"),
        (raising(ExceptionGroup("several", [ValueError("one")])), "ExceptionGroup: several"),
        (recursion, "RecursionError: maximum recursion depth exceeded"),
        (lambda: interruptibly(raising(LookupError("in a thread"))), "LookupError: in a thread"),
        (raising(BaseException("no Exception")), "BaseException: no Exception"),
        (lambda: interruptibly(raising(GeneratorExit())), "GeneratorExit"),
    ],
)
def test_a_bug_is_one_line_and_a_private_file(failing, tmp_path, action, message):
    status, out, err = failing(action)
    assert (status, out) == (1, "")
    assert err.startswith(f"jaxsat: {message}")
    assert "this is a bug in jaxsat" in err
    assert err.count("\n") == 1
    (file,) = (tmp_path / "tmp").iterdir()
    assert str(file) in err
    assert stat.S_IMODE(file.stat().st_mode) == 0o600
    assert "Traceback" in file.read_text(encoding="utf-8")


def test_a_bug_of_the_native_engine_is_told_and_no_reason_to_fall_back(
    command_line, monkeypatch, tmp_path
):
    from jaxsat.compiler.lowering import RULES

    monkeypatch.setattr("tempfile.tempdir", str(tmp_path))
    monkeypatch.setitem(RULES, "mul", raising(IndexError("beyond the end")))
    finer = "simulation.solver.substeps=37"  # that no other test has made code for
    status, _, err = command_line(
        "montecarlo", "switching-dispersed", "-n", "2", "--set", finer, "--out", str(tmp_path / "s")
    )
    assert status == 1, err
    assert "NativeBug: The native engine broke down in the rule of `mul`" in err
    assert "this is a bug in jaxsat" in err
    assert not (tmp_path / "s").exists()


@pytest.mark.parametrize(
    ("error", "message"),
    [
        (MemoryError(), "not enough memory"),
        (RuntimeError("RESOURCE_EXHAUSTED: Out of memory allocating 9 bytes"), "not enough memory"),
        (RuntimeError("can't start new thread"), "not enough memory"),
        (OSError(errno.ENOSPC, "No space left on device", "a\x1bb"), "a\\x1bb: No space left"),
    ],
)
def test_a_lack_of_memory_or_disk_is_no_bug(failing, tmp_path, error, message):
    status, out, err = failing(raising(error))
    assert (status, out) == (1, "")
    assert message in err
    assert err.count("\n") == 1
    assert not list((tmp_path / "tmp").iterdir())


@pytest.mark.parametrize("code", [0, None, 1, "words"])
def test_code_of_others_that_ends_python_is_no_success(failing, code):
    status, out, err = failing(raising(SystemExit(code)))
    assert (status, out) == (2, "")
    assert err.startswith("jaxsat: control.law")
    assert "got sys.exit(" in err
    assert "test_last_resort.py:" in err


def test_a_pipe_that_is_closed_inside_is_no_success(failing, tmp_path):
    status, _, err = failing(raising(BrokenPipeError(errno.EPIPE, "Broken pipe")))
    assert status == 1
    assert "has exited" in err
    assert not list((tmp_path / "tmp").iterdir())


def test_a_traceback_that_cannot_be_written_is_not_printed(failing, tmp_path, monkeypatch):
    monkeypatch.setattr("tempfile.tempdir", str(tmp_path / "nowhere"))
    status, _, err = failing(raising(KeyError("k")))
    assert status == 1, err
    assert "cannot be written (No such file or directory)" in err
    assert "Traceback" not in err


def test_a_thread_that_ends_by_a_bug_is_told_once(failing):
    def end_two_threads():
        for _ in range(2):
            thread = threading.Thread(target=raising(KeyError("aside")))
            thread.start()
            thread.join()

    status, _, err = failing(end_two_threads)
    assert status == 0
    assert re.fullmatch(r"jaxsat: KeyError: 'aside'; this is a bug in jaxsat, .*\n", err)


def shell(command):
    program = f"{sys.executable} -m jaxsat"
    return subprocess.run(
        ["bash", "-o", "pipefail", "-c", command.replace("jaxsat", program)],
        capture_output=True, env={**os.environ, "PYTHONPATH": str(ROOT)}, timeout=60, check=False,
    )  # fmt: skip


@pytest.mark.slow
@pytest.mark.skipif(not Path("/dev/full").exists(), reason="only on Linux")
@pytest.mark.parametrize(
    ("command", "status"),
    [
        ("jaxsat --help > /dev/full", 1),
        ("jaxsat scenarios show switching > /dev/full", 1),
        ("jaxsat scenarios show switching >&-", 0),
        ("jaxsat scenarios show nothing 2> /dev/full", 2),
        ("jaxsat scenarios show nothing >&- 2>&- <&-", 2),
        ("jaxsat --help | true", 141),
        ("jaxsat scenarios show nothing 2> /dev/null | true", 2),
    ],
)
def test_streams_that_fail(command, status):
    done = shell(command)
    assert done.returncode == status
    lines = [line for line in done.stderr.decode().splitlines() if "starting" not in line]
    assert len(lines) == (status == 1), lines
    assert all("No space left on device" in line for line in lines)


SIGNALS_AT_IMPORT = """
import os, signal, sys
numbers = {numbers}
class Finder:
    def find_spec(self, name, path=None, target=None):
        if name == "cyclopts" and numbers:
            os.kill(os.getpid(), numbers.pop(0))
sys.meta_path.insert(0, Finder())
class Stream:
    def write(self, text):
        if numbers and "nothing was written" in text:
            os.kill(os.getpid(), numbers.pop(0))
        os.write(2, text.encode())
    def flush(self): pass
sys.stderr = Stream()
from jaxsat.cli import main
main(["scenarios", "show", "switching"])
"""


@pytest.mark.slow
@pytest.mark.parametrize(
    ("numbers", "status"),
    [
        ([signal.SIGINT], 130),
        ([signal.SIGTERM], 143),
        ([signal.SIGHUP], 129),
        ([signal.SIGINT, signal.SIGINT], 130),
        ([signal.SIGINT, signal.SIGTERM], 130),
        ([signal.SIGTERM, signal.SIGINT, signal.SIGINT], 143),
    ],
)
def test_signals_while_starting_and_while_the_first_is_told(numbers, status):
    code = SIGNALS_AT_IMPORT.format(numbers=[int(number) for number in numbers])
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True, env={**os.environ, "PYTHONPATH": str(ROOT)}, timeout=60, check=False,
    )  # fmt: skip
    assert done.returncode == status
    assert done.stdout == b""
    told = {130: b"jaxsat: interrupted", 143: b"jaxsat: terminated", 129: b"jaxsat: terminated"}
    assert done.stderr in (b"", told[status] + b"; nothing was written\n")
    assert done.stderr or len(numbers) > 1


@pytest.mark.slow
@pytest.mark.parametrize("module", ["numpy.lib", "jax._src.config", "pydantic", "equinox"])
def test_signals_while_jax_is_imported(module):
    """Inside jaxlib an exception of a signal would become a traceback and an ImportError."""
    code = SIGNALS_AT_IMPORT.format(numbers=[int(signal.SIGTERM)])
    code = code.replace('"cyclopts"', repr(module)).replace('"show"', '"check"')
    done = subprocess.run(
        [sys.executable, "-c", code],
        capture_output=True, env={**os.environ, "PYTHONPATH": str(ROOT)}, timeout=60, check=False,
    )  # fmt: skip
    lines = [line for line in done.stderr.decode().splitlines() if "(" not in line]
    assert lines == ["jaxsat: terminated; nothing was written"]
    assert done.returncode == 143


TITLE = "$k__3$ \\frac \x1b[31m\0 <script>\r\n\u202e 中 `|`"


def test_a_title_of_every_evil_comes_out_harmless(command_line, tmp_path):
    """On the terminal, in netCDF attributes, figures and records of a whole run."""
    import xml.etree.ElementTree as xml

    from jaxsat.core.text import clean
    from jaxsat.store.dataset import open_trajectory

    _, text, _ = command_line("scenarios", "show", "switching")
    lines = [f"title = {toml(TITLE)}" if "title" in one else one for one in text.splitlines()]
    (tmp_path / "evil.toml").write_text("\n".join(lines), encoding="utf-8")
    short = ("--set", "simulation.duration_s=1")
    status, out, err = command_line("scenarios", "check", "evil.toml", *short)
    if status == 2:  # the scenario may refuse it, then there is nothing to come out
        assert clean(err.replace("\n", "")) == err.replace("\n", "")
        return
    status, out, err = command_line("simulate", "evil.toml", *short, "--out", "run")
    assert (status, err) == (0, "")
    assert clean(TITLE) in out
    assert clean(out.replace("\n", "")) == out.replace("\n", "")
    assert open_trajectory(tmp_path / "run").attrs["title"] == clean(TITLE)
    for file in (tmp_path / "run").glob("*.svg"):
        xml.parse(file)


def toml(text):
    return '"' + "".join(f"\\U{ord(one):08x}" for one in text) + '"'


def test_a_damaged_matplotlibrc_loses_no_figure(tmp_path):
    """That of the variable or of the user; one in the current folder leaves figures out."""
    settings = tmp_path / "settings" / "matplotlibrc"
    settings.parent.mkdir()
    settings.write_bytes(b"\xff\xfe\x00")
    code = (
        "import sys; sys.argv = ['jaxsat', 'scenarios', 'schema']\n"
        "from jaxsat.cli.entry import main\n"
        "try: main()\n"
        "except SystemExit: pass\n"
        "import matplotlib; sys.stderr.write(matplotlib.matplotlib_fname())"
    )
    given = os.environ | {"MATPLOTLIBRC": str(settings), "MPLBACKEND": "nonsense"}
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, env=given)
    assert done.stderr.decode().endswith(os.devnull), done.stderr.decode()


def test_a_platform_that_jax_does_not_find_is_no_bug(monkeypatch):
    with pytest.raises(RuntimeError) as caught:
        jax.devices("nonsense")
    assert failure_of(caught.value) is None
    monkeypatch.setenv("JAX_PLATFORMS", "nonsense")
    assert "JAX_PLATFORMS: must be what JAX finds" in (failure_of(caught.value) or "")


def test_a_file_that_is_no_netcdf_is_a_mistake_of_the_user_until_the_process_ends(tmp_path):
    """An error that kept a file of h5py made the process crash at its exit."""
    (tmp_path / "run.nc").write_text("no netCDF\n" * 20)
    done = subprocess.run(
        [sys.executable, "-m", "jaxsat", "convert", "run.nc", "--to", "csv"],
        capture_output=True,
        text=True,
        cwd=tmp_path,
        env=os.environ | {"PYTHONPATH": str(ROOT)},
    )
    assert done.returncode == 2
    assert "run.nc cannot be read as netCDF 4: Unable to" in done.stderr
