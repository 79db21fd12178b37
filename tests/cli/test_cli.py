"""The command line: what it says, what it writes, how it exits."""

import json
import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

from jaxsat import __version__
from jaxsat.scenario import library
from jaxsat.scenario.build.load import load
from jaxsat.store.dataset import open_trajectory

ROOT = Path(__file__).parents[2]
SHORT = ["--set", "simulation.duration_s=5"]
FILES = ["rates", "attitude", "torque"]


@pytest.fixture
def jaxsat(command_line):
    return command_line


def environment(**extra):
    return {**os.environ, "PYTHONPATH": str(ROOT), **extra}


def command(*tokens):
    return [sys.executable, "-m", "jaxsat", *tokens]


def in_a_process(*tokens, **extra):
    return subprocess.run(
        command(*tokens), capture_output=True, env=environment(**extra), timeout=120, check=False
    )


@pytest.mark.slow
def test_simulate_writes_the_whole_folder(jaxsat, tmp_path):
    status, out, err = jaxsat("simulate", "paper-three-axis", *SHORT, "--set", "simulation.seed=7")
    assert (status, err) == (0, "")
    folder = tmp_path / "jaxsat-paper-three-axis"
    names = {entry.name for entry in folder.iterdir()}
    assert {"trajectory.nc", "scenario.toml", "run.json"} < names
    assert {f"{name}.{kind}" for name in FILES for kind in ("png", "svg")} < names
    assert (folder / "rates.png").read_bytes().startswith(b"\x89PNG")
    assert b"<svg" in (folder / "rates.svg").read_bytes()
    assert [entry.name for entry in tmp_path.iterdir()] == ["jaxsat-paper-three-axis"]

    expected = load("paper-three-axis", ["simulation.duration_s=5", "simulation.seed=7"])
    assert load(folder / "scenario.toml") == expected
    dataset = open_trajectory(folder)
    np.testing.assert_allclose(np.diff(dataset["time"]), 0.5)
    assert float(dataset["time"][0]) == 0
    assert dataset["omega"].dtype == np.float64
    row = [-0.851881952, 0.854286967]  # an independent solution at 1 s
    np.testing.assert_allclose(dataset["w"].sel(time=1), row, atol=1e-9)
    record = json.loads((folder / "run.json").read_text(encoding="utf-8"))
    assert record["seed"] == 7
    assert set(record["versions"]) >= {"jaxsat", "jax", "diffrax", "python"}

    assert out.startswith("Three-axis stabilisation, as in the paper\nNot settled within 5 s.\n")
    assert "- At the end, 5 s: pointing error " in out
    assert "written to jaxsat-paper-three-axis: attitude.png" in out


@pytest.mark.slow
def test_summary_tells_when_it_settled(jaxsat):
    """Undisturbed, the rate law has |ω| < 1e-3 rad/s after a few seconds."""
    changes = ["--set", "simulation.duration_s=20"]
    calm = ["--set", "disturbance.amplitude_N_m=[0,0,0]"]
    _, out, _ = jaxsat("simulate", "paper-rate", *changes, *calm, "--out", "rate")
    (line,) = [line for line in out.splitlines() if line.startswith("Settled")]
    assert "- Settled means |ω| < 0.001 rad/s to the end; control law: rate." in out
    dataset = open_trajectory("rate")
    size = np.linalg.norm(dataset["omega"], axis=1)
    last = np.flatnonzero(size >= 1e-3)[-1]
    match = re.fullmatch(r"Settled at (\S+) s, and stays settled to 20 s\.", line)
    assert match
    assert 2 < dataset["time"][last] <= float(match[1]) <= dataset["time"][last + 1] < 8
    _, out, _ = jaxsat("simulate", "paper-three-axis", *changes, "--out", "three-axis")
    assert "Not settled within 20 s." in out
    told = "Settled means |w| < 0.05, |z| < 0.05 rad, relative rate |ω_r| < 0.001 rad/s to the end;"
    assert told in out


@pytest.mark.slow
def test_equal_runs_give_equal_figures(jaxsat, tmp_path):
    for name in ("one", "two"):
        assert jaxsat("simulate", "switching", *SHORT, "--out", name, "--quiet") == (0, "", "")
    for figure in FILES:
        one, two = (tmp_path / name / f"{figure}.svg" for name in ("one", "two"))
        assert one.read_bytes() == two.read_bytes()


@pytest.mark.slow
def test_refuses_to_overwrite_unless_told(jaxsat, tmp_path):
    arguments = ("simulate", "switching", *SHORT, "--out", "out")
    assert jaxsat(*arguments)[0] == 0
    before = (tmp_path / "out" / "run.json").stat().st_mtime_ns
    status, out, err = jaxsat(*arguments)
    assert (status, out) == (2, "")
    assert "already exists; give --overwrite" in err
    assert (tmp_path / "out" / "run.json").stat().st_mtime_ns == before
    assert jaxsat(*arguments, "--overwrite")[0] == 0
    assert (tmp_path / "out" / "run.json").stat().st_mtime_ns > before


@pytest.mark.slow
def test_failed_run_is_written_and_exits_1(jaxsat, tmp_path):
    changes = ["--set", "simulation.solver.max_steps=50"]
    status, out, err = jaxsat("simulate", "paper-three-axis", *changes, "--out", "out")
    assert status == 1
    assert "used up its number of steps" in out
    assert "raise max_steps" in err
    dataset = open_trajectory(tmp_path / "out")
    assert dataset.attrs["outcome"] == "MAX_STEPS"
    assert np.isnan(dataset["omega"].values[-1]).all()


@pytest.mark.parametrize(
    ("tokens", "message"),
    [
        (["simulate"], "SCENARIO: must be given (A name from `jaxsat scenarios list`"),
        (["simulat"], ", got simulat, did you mean simulate?"),
        (["simulate", "paper-rat"], "did you mean paper-rate?"),
        (["simulate", "missing.toml"], "missing.toml: no such file"),
        (
            ["simulate", "paper-rate", "--sett", "x=1"],
            "--sett: must be an option of `jaxsat simulate`, did you mean --set?",
        ),
        (
            ["simulate", "paper-rate", "--set"],
            "--set: must be given with a value (KEY=VALUE that replaces",
        ),
        (["simulate", "paper-rate", "--set", "a=1", "b=2"], "must be given without b=2"),
        (["simulate", "paper-rate", "--set", "k1"], "--set k1: must have the form KEY=VALUE"),
        (["simulate", "paper-rate", "--set", "control.k1=-1"], "must be greater than 0 √(rad/s)"),
        (["simulate", "paper-rate", "--out", "file"], "file is a file"),
        (["simulate", "paper-rate", "--out", "file/out"], "file is a file"),
        (["scenarios", "show", "paper-rat"], "did you mean paper-rate?"),
        (["scenarios", "show"], "NAME: must be given (One of the names"),
        (["scenarios", "check"], "must be given at least one file"),
        (["scenarios", "check", "file"], "file:1: must be valid TOML"),
        (["scenarios", "lst"], "check), got lst, did you mean list?"),
        (["--nonsense"], "--nonsense: must follow a command (simulate, "),
        (
            ["simulate", "paper-rate", "--seed", "3"],
            "--seed: must be an option of `jaxsat simulate` "
            "(it is one of montecarlo, compare, bound, design)",
        ),
        (["simulate", "paper-rate", "switching"], "`jaxsat simulate`: must be given without switc"),
        (["compare"], "--seed: must be given (Seed of the cases), got nothing"),
        (["compare", "--sed", "3"], "--sed: must be an option of `jaxsat compare`, did you mean"),
        (["convert", "x"], "--to: must be given (one of aem, csv, mat, parquet, scenario), got n"),
        (
            ["montecarlo", "x", "-n"],
            "-n: must be given with a value (Number of cases), got nothing",
        ),
        (
            ["montecarlo", "x", "--engine", "fast"],
            "must be one of auto, native, scan, diffrax, got",
        ),
        (["montecarlo", "x", "--case", "1", "--case", "2"], "--case: must be given once"),
        (["montecarlo", "x", "--quiet=maybe"], "--quiet: must be given without a value, got maybe"),
    ],
)
def test_mistakes_exit_2_without_a_traceback(jaxsat, tmp_path, tokens, message):
    (tmp_path / "file").write_text("not a scenario")
    status, out, err = jaxsat(*tokens)
    assert (status, out) == (2, "")
    assert message in err
    assert "Traceback" not in err
    assert [entry.name for entry in tmp_path.iterdir()] == ["file"]


def test_problems_begin_with_file_and_line(jaxsat, tmp_path):
    path = tmp_path / "broken.toml"
    text = load_text("paper-rate").replace("k1 = 5", "k1 = -5").replace("k2 = ", "k3 = ")
    path.write_text(text, encoding="utf-8")
    status, _, err = jaxsat("scenarios", "check", "broken.toml", "paper-rate")
    assert status == 2
    line = 1 + text[: text.index("k1 = -5")].count("\n")
    lines = err.splitlines()
    assert lines[0].startswith(f"broken.toml:{line - 2}: key control.k2: must be given")
    assert lines[1].startswith(f"broken.toml:{line}: key control.k1: must be greater than 0")
    assert lines[2].startswith(f"broken.toml:{line + 1}: key control.k3: must be one of the keys")
    assert len(lines) == 3


def load_text(name):
    from jaxsat.scenario import library

    return library()[name].read_text(encoding="utf-8")


def test_warnings_are_told(jaxsat):
    status, out, err = jaxsat(
        "scenarios", "check", "paper-rate", "--set", "spacecraft.inertia_kg_m2=[600,100,100]"
    )
    assert status == 0
    assert err.startswith("warning: --set spacecraft.inertia_kg_m2=[600,100,100]: key ")
    assert out.startswith("paper-rate: valid (Angular-velocity stabilisation, as in the paper)\n")


def test_bash_completes_commands_and_options(jaxsat):
    status, out, _ = jaxsat("completion", "bash")
    assert status == 0
    tries = "for words in 'mon' 'montecarlo --ch'; do COMP_WORDS=(jaxsat $words); "
    tries += "COMP_CWORD=$((${#COMP_WORDS[@]} - 1)); _jaxsat; echo ${COMPREPLY[@]}; done"
    done = subprocess.run(["bash", "-c", f"{out}\n{tries}"], capture_output=True, text=True)
    assert done.stdout.split() == ["montecarlo", "--chunk"]


def test_scenarios_list_show_and_schema(jaxsat, tmp_path):
    status, out, _ = jaxsat("scenarios", "list")
    assert status == 0
    assert [line.split()[0] for line in out.splitlines()] == list(library())
    status, out, _ = jaxsat("scenarios", "show", "switching")
    assert out == load_text("switching")
    (tmp_path / "mine.toml").write_text(out, encoding="utf-8")
    assert jaxsat("scenarios", "check", "mine.toml")[0] == 0
    status, out, _ = jaxsat("scenarios", "schema")
    spacecraft = json.loads(out)["$defs"]["SpacecraftTable"]["properties"]
    assert spacecraft["inertia_kg_m2"]["unit"] == "kg m²"


@pytest.mark.parametrize("tokens", [["--help"], ["simulate", "--help"], ["scenarios", "--help"]])
def test_help_is_quick_and_imports_nothing_heavy(tokens):
    code = (
        "import sys\nfrom jaxsat.cli import main\n"
        f"try: main({tokens})\nexcept SystemExit as end: assert end.code == 0, end.code\n"
        "heavy = {'jax', 'numpy', 'xarray', 'matplotlib', 'pydantic', 'diffrax'}\n"
        "assert not heavy & set(sys.modules), heavy & set(sys.modules)\n"
        "import time; print(time.process_time(), file=sys.stderr)\n"
    )
    times = []
    for _ in range(2):
        done = subprocess.run(
            [sys.executable, "-c", code], capture_output=True, env=environment(), check=False
        )
        assert done.returncode == 0, done.stderr
        times.append(float(done.stderr.split()[-1]))
    assert min(times) < 1  # of computing, whoever else uses the machine


def test_version(jaxsat):
    assert jaxsat("--version") == (0, f"{__version__}\n", "")


@pytest.mark.slow
def test_terminal_that_knows_only_ascii(tmp_path):
    (tmp_path / "broken.toml").write_text("title = 'ω√'\n[control]\nlaw = 'rate'\n", "utf-8")
    ascii_only = {"LC_ALL": "C", "PYTHONIOENCODING": "ascii", "PYTHONUTF8": "0",
                  "PYTHONCOERCECLOCALE": "0", "NO_COLOR": "1"}  # fmt: skip
    done = in_a_process("scenarios", "check", "broken.toml", **ascii_only)
    assert done.returncode == 2
    lines = done.stderr.decode("ascii").splitlines()
    assert "broken.toml:2: key control.k1: must be given in ?(rad/s), got nothing" in lines
    assert "Traceback" not in done.stderr.decode("ascii")
    done = in_a_process("scenarios", "schema", **ascii_only)
    assert done.returncode == 0
    json.loads(done.stdout.decode("ascii"))


@pytest.mark.slow
def test_plain_text_where_there_is_no_terminal():
    done = in_a_process("scenarios", "list", FORCE_COLOR="", COLUMNS="20")
    assert b"\x1b" not in done.stdout
    assert len(done.stdout.splitlines()) == len(library())


@pytest.mark.slow
def test_reader_that_goes_away():
    pipeline = f"{' '.join(command('scenarios', 'schema'))} | head -1"
    done = subprocess.run(
        ["bash", "-o", "pipefail", "-c", pipeline],
        capture_output=True, env=environment(), timeout=60, check=False,
    )  # fmt: skip
    assert (done.returncode, done.stdout) == (141, b"{\n")
    assert all(line.startswith(b"jaxsat: starting") for line in done.stderr.splitlines())


@pytest.mark.slow
@pytest.mark.parametrize(
    ("number", "status", "message"),
    [(signal.SIGINT, 130, "interrupted"), (signal.SIGTERM, 143, "terminated")],
)
def test_interruption_leaves_nothing(tmp_path, number, status, message):
    tokens = (
        "simulate",
        "switching",
        "--set",
        "simulation.duration_s=1000000",
        "--out",
        "deep/out",
    )
    tokens += ("--quiet",)
    with subprocess.Popen(
        command(*tokens), stderr=subprocess.PIPE, stdout=subprocess.PIPE, env=environment()
    ) as process:
        deadline = time.monotonic() + 60
        while not (tmp_path / "deep").exists() and time.monotonic() < deadline:
            time.sleep(0.05)
        time.sleep(4)  # into the compiled loop, which takes minutes
        process.send_signal(number)
        begin = time.monotonic()
        out, err = process.communicate(timeout=30)
    assert time.monotonic() - begin < 5
    assert process.returncode == status
    assert err.decode() == f"jaxsat: {message}; nothing was written\n"
    assert out == b""
    assert list(tmp_path.iterdir()) == []
