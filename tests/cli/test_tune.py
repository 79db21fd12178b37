"""`jaxsat tune`."""

import functools
import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from types import SimpleNamespace

import pytest

from jaxsat.control.diagnosis.diagnosis import average_run_length
from jaxsat.scenario.build.load import load
from jaxsat.studies.work import Work
from synthesis.tuning.scenarios import RATE

FIGURES = ("loss", "gains", "before-after")

TINY = (
    "simulation.duration_s=60", "tuning.steps=2", "tuning.starts=3", "tuning.screened=0",
    "tuning.cases=4", "tuning.validation_cases=4", "tuning.validate_every=1",
    "tuning.held_out_cases=4", "tuning.receipt_cases=2",
)  # fmt: skip
"""A run of three points, two steps and four cases of a minute each."""


@pytest.fixture(autouse=True)
def _scenario(tmp_path):
    (tmp_path / "rate.toml").write_text(RATE, encoding="utf-8")


@pytest.fixture
def jaxsat(command_line):
    return functools.partial(command_line, "tune")


@pytest.mark.slow
def test_a_run_leaves_everything_in_its_folder(jaxsat, tmp_path):
    short = ("rate.toml", "--set", "tuning.steps=2", "--batch-size", "4", "--workers", "1")
    status, out, err = jaxsat(*short, "--out", "run")
    assert status == 0, err
    assert out.startswith("Tuning: A slow tumble, stopped\n")
    assert "\nGains\n" in out
    folder = tmp_path / "run"
    names = {path.name for path in folder.iterdir()}
    figures = {f"{name}.{kind}" for name in FIGURES for kind in ("png", "svg")}
    files = {"tuned.toml", "history.nc", "receipt.json", "verdict.json", "summary.md"}
    assert names == files | figures | {"checkpoint.npz", ".jaxsat"}
    gains = json.loads((folder / "verdict.json").read_text())["gains"]
    tuned = load(folder / "tuned.toml").control
    assert tuned.k1 == pytest.approx(gains["k1"]["after"])
    assert tuned.k1 != 0.5

    status, out, _ = jaxsat(*short, "--out", "run")
    assert status == 0
    assert "already written to run" in out
    status, _, err = jaxsat("rate.toml", "--set", "tuning.steps=3", "--out", "run")
    assert status == 2
    assert "holds another run" in err


@pytest.mark.slow
def test_a_law_that_diagnoses_is_tuned_from_the_library_to_a_verdict(jaxsat):
    """Thresholds and gains together; the interval of false alarms is kept."""
    pytest.importorskip("cma")
    changes = [word for change in TINY for word in ("--set", change)]
    status, out, err = jaxsat("failures-telescope", *changes, "--out", "run", "--workers", "1")
    assert status == 0, err
    assert "The run takes no derivatives" in out
    gains = json.loads(Path("run/verdict.json").read_text())["gains"]
    tuned = load("run/tuned.toml")
    control, bounds = tuned.control, tuned.tuning.parameters
    assert gains.keys() == bounds.keys()
    for key, bound in bounds.items():
        assert getattr(control, key) == pytest.approx(gains[key]["after"])
        assert bound.low <= gains[key]["after"] <= bound.high
    length = average_run_length(control.cusum_reference, control.cusum_threshold)
    tests = 3 * len(tuned.wheel)
    assert length * control.period_s / tests >= tuned.tuning.false_alarm_interval_s


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ("tuning.parameters.k3={low=0.1, high=1}", 'must be one of k1, k2 under the law "rate"'),
        ("tuning.parameters.k1={low=2, high=1}", "must be above low = 2"),
        ("tuning.parameters.k1={low=1, high=2}", "must be bounds around control.k1 = 0.5"),
        ("tuning.parameters.k1={low=-1, high=2}", "must be greater than 0"),
        ("tuning.parameters.k9={low=1, high=2}", 'under the law "rate", got "k9"'),
        ("tuning.optimiser=adma", "must be an optimiser of optax"),
        ("tuning.aggregate=median", 'must be one of "mean", "cvar", "quantile", "worst"'),
        ("tuning.smoothing.tilt_width=0.1", "must be one of omega3_width_rad_s"),
        ("tuning.horizon_s=[4, 9]", "up to simulation.duration_s = 8.0, got 9"),
        ("tuning.screened=2", "must be 0 or at least starts = 3"),
        ("dispersion.design=latin-hypercube", 'must be "independent" or "sobol" for tuning'),
        ("tuning.held_out_seed=5", "held_out_seed: must not be simulation.seed"),
    ],
)
def test_mistakes_exit_with_two(jaxsat, change, message):
    status, _, err = jaxsat("rate.toml", "--set", change)
    assert status == 2
    assert message in err


def test_a_scenario_without_the_table_is_refused(jaxsat):
    status, _, err = jaxsat("paper-rate")
    assert status == 2
    assert "[tuning] must be given, got nothing" in err


def test_a_full_disk_is_a_failure_and_no_mistake(jaxsat, monkeypatch):
    from jaxsat.store.files import OutputError
    from jaxsat.synthesis.tuning import run

    def full(*_, **__):
        raise OutputError("run cannot be made: No space left on device.", failure=True)

    monkeypatch.setattr(run, "build_plan", lambda *_, **__: SimpleNamespace(remark=None))
    monkeypatch.setattr(run, "tuning_work", lambda *_: Work(1, 1, 1, 1))
    monkeypatch.setattr(run, "tuning_folder", full)
    status, _, err = jaxsat("rate.toml", "--out", "run")
    assert status == 1
    assert "No space left on device" in err


@pytest.mark.slow
def test_an_interrupted_run_keeps_its_best_and_goes_on(jaxsat, tmp_path):
    short = ("rate.toml", "--set", "tuning.steps=60", "--batch-size", "4", "--workers", "1")
    root = Path(__file__).parents[2]
    command = [sys.executable, "-m", "jaxsat", "tune", *short, "--out", "run"]
    environment = {**os.environ, "PYTHONPATH": str(root)}
    tuned = tmp_path / "run" / "tuned.toml"
    for number, status in ((signal.SIGTERM, 143), (signal.SIGINT, 130)):
        before = tuned.stat().st_mtime_ns if tuned.exists() else None
        run = subprocess.Popen(command, stderr=subprocess.PIPE, env=environment, text=True)
        while not tuned.exists() or tuned.stat().st_mtime_ns == before:
            time.sleep(0.05)
            assert run.poll() is None, run.stderr.read()
        run.send_signal(number)
        message = run.communicate(timeout=120)[1]
        assert run.returncode == status
        assert "the same command resumes" in message
    status, _, err = jaxsat(*short, "--out", "run")
    assert status == 0, err
    status, _, err = jaxsat(*short, "--out", "whole")
    assert status == 0, err
    verdicts = [json.loads((tmp_path / n / "verdict.json").read_text()) for n in ("run", "whole")]
    assert verdicts[0] == verdicts[1]
