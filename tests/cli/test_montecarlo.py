"""`jaxsat montecarlo`."""

import functools
import json
import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pandas as pd
import pytest

from jaxsat.cli.montecarlo import interruption_text
from jaxsat.store.dataset import open_trajectory
from jaxsat.store.tables import case_table, open_study
from store.stores import made, values

SHORT = [
    "switching",
    *("--set", "simulation.duration_s=3"),
    *("--set", "dispersion.omega_rad_s={distribution='uniform', low=-0.1, high=0.1}"),
    *("--set", "dispersion.inertia={distribution='uniform', low=-0.1, high=0.1}"),
    *("--batch-size", "4", "--workers", "1"),
]


@pytest.fixture
def jaxsat(command_line):
    return functools.partial(command_line, "montecarlo")


def test_an_interrupted_study_says_which_chunks_are_kept(tmp_path):
    path = tmp_path / "s"
    assert interruption_text(path) == "nothing was written"
    with made(path) as store:
        assert interruption_text(path) == "no chunk is finished yet; the same command starts again"
        store.write(1, values(store.numbers(1)))
        finished = f"the finished chunks are in {path}; the same command resumes"
        assert interruption_text(path) == finished


@pytest.mark.slow
def test_a_study_is_written_gone_on_with_and_replayed(jaxsat, tmp_path):
    status, out, _ = jaxsat(*SHORT, "-n", "6", "--seed", "3", "--out", "s", "--figures", "f")
    assert status == 0
    assert "Outcomes: 0 settled, 6 unsettled." in out
    dataset = open_study(tmp_path / "s")
    assert np.all(dataset["status"] == 1)
    assert np.ptp(dataset["drawn_omega"].values, axis=0).min() > 0
    assert dataset["drawn_omega"].attrs["units"] == dataset["omega"].attrs["units"] == "rad s-1"
    names = {path.name for path in (tmp_path / "f").glob("*.png")}
    fans = ("pointing-fan", "attitude-fan", "rates-fan")
    assert names == {f"{n}.png" for n in (*fans, "settling", "convergence")}

    (tmp_path / "t.csv").write_text("mine")
    tokens = [*SHORT, "-n", "9", "--seed", "3", "--out", "s", "--csv", "t.csv"]
    status, _, err = jaxsat(*tokens)
    assert status == 2
    assert "t.csv already exists; give --overwrite to replace it, or another file" in err
    status, out, _ = jaxsat(*tokens, "--overwrite")
    assert status == 0
    assert out.endswith("written to s, t.csv\n")
    larger = open_study(tmp_path / "s")
    table = pd.read_csv(tmp_path / "t.csv", index_col="case")
    pd.testing.assert_frame_equal(table, case_table(larger), check_exact=True)
    assert set(table["outcome"]) == {"unsettled"}
    np.testing.assert_array_equal(table["drawn_omega_y_rad_s"], larger["drawn_omega"][:, 1])
    np.testing.assert_array_equal(larger["omega"][:6], dataset["omega"])

    status, out, _ = jaxsat(*SHORT, "--seed", "3", "--case", "5", "--out", "case")
    assert status == 0
    assert "inertia" in out
    run = open_trajectory(tmp_path / "case")
    np.testing.assert_array_equal(run["omega"][-1], larger["omega"][5])
    assert run.attrs["case"] == 5
    assert run["mode"].attrs["flag_meanings"] == "three-axis_law rate_law"
    np.testing.assert_array_equal(run["omega"][0], larger["drawn_omega"][5])

    status, _, err = jaxsat(*SHORT, "-n", "9", "--seed", "4", "--out", "s")
    assert status == 2
    assert "another study (design" in err or "seed: 3 there, 4 here" in err


@pytest.mark.slow
@pytest.mark.parametrize(
    ("tokens", "message"),
    [
        (["switching"], "[dispersion] must be given, got nothing"),
        ([*SHORT, "--until-ci", "half"], "--until-ci: must be a half width"),
        (
            [*SHORT, "--set", "dispersion.design=latin-hypercube", "--until-ci", "1%"],
            "--until-ci: must be given with a design other than",
        ),
        ([*SHORT, "-n", "0"], "-n: must be a whole number from 1"),
        ([*SHORT, "--seed", "-1"], "--seed: must be a whole number from 0"),
    ],
)
def test_mistakes_exit_with_two(jaxsat, tokens, message):
    status, _, err = jaxsat(*tokens)
    assert status == 2
    assert message in err


def environment(**more):
    root = Path(__file__).parents[2]
    return {**os.environ, "PYTHONPATH": str(root), **more}


MAIN = "from jaxsat.cli import main; main()"


def command(*tokens, program=MAIN):
    return [sys.executable, "-c", program, "montecarlo", *tokens]


def of_store(path):
    dataset = open_study(path)
    return {name: np.asarray(dataset[name]) for name in dataset}


@pytest.mark.slow
def test_the_workers_of_a_scheduler_are_asked(jaxsat):
    distributed = pytest.importorskip("distributed")
    with distributed.LocalCluster(
        n_workers=1, threads_per_worker=1, processes=False, dashboard_address="127.0.0.1:0"
    ) as cluster:
        place = cluster.scheduler_address
        tokens = [*SHORT[:-2], "-n", "4", "--chunk", "2"]
        status, out, err = jaxsat(*tokens, "--out", "s", "--scheduler", place)
        assert (status, err) == (0, ""), err
        assert "0 settled, 4 unsettled" in out
        status, _, err = jaxsat(*SHORT, "--out", "t", "--scheduler", place)
        assert status == 2
        assert "--scheduler: must be given without --workers" in err
    status, _, err = jaxsat(*tokens, "--out", "t", "--scheduler", "tcp://127.0.0.1:9")
    assert status == 1
    assert "no scheduler answers at tcp://127.0.0.1:9" in err


DEVICES_IN_USE = """
import time
import jax.numpy as jnp
from jaxsat.cli import main
from jaxsat.studies.executors import Devices

def where(chunk):
    time.sleep(0.2)
    return jnp.ones(1).device.id

assert sorted({device for _, device in Devices(2).run(where, range(4))}) == [0, 1]
main()
"""


@pytest.mark.slow
def test_processes_and_devices_give_the_same_bits(jaxsat, tmp_path):
    """Two processes; two pretended devices; and too many devices, which are refused.

    Through XLA: machine code of our own knows no devices.
    """
    tokens = [*SHORT[:-2], "-n", "16", "--chunk", "2", "--engine", "scan", "--quiet"]
    tokens += ["--set", "simulation.solver.name=heun"]  # of few stages, and a law of few operations
    light = "control={law='quaternion-feedback', natural_frequency_rad_s=0.1, period_s=0.1}"
    tokens += ["--set", light, "--set", "spacecraft.failed_thrusters=[]"]
    assert jaxsat(*tokens, "--out", "plain")[0] == 0
    plain = of_store(tmp_path / "plain")
    runs = [("processes", ["--processes", "2"], {}, MAIN)]
    devices = "--xla_force_host_platform_device_count=2"
    flags = {"XLA_FLAGS": f"{os.environ.get('XLA_FLAGS', '')} {devices}"}
    runs.append(("devices", ["--devices", "2"], flags, DEVICES_IN_USE))
    for name, more, variables, program in runs:
        whole = command(*tokens, "--out", name, *more, program=program)
        subprocess.run(whole, env=environment(**variables), check=True)
        found = of_store(tmp_path / name)
        assert found.keys() == plain.keys()
        for column in plain:
            np.testing.assert_array_equal(found[column], plain[column], err_msg=column)
    status, _, err = jaxsat(*tokens, "--devices", "99")
    assert status == 2
    assert "--devices: must be from 1 to" in err


WITHOUT_LLVMLITE = "import sys; sys.modules['llvmlite'] = None; "


@pytest.mark.slow
def test_without_llvmlite_another_engine_is_taken_and_told(tmp_path):
    """In one line and in the store; with --engine native it is a mistake."""
    whole = [*SHORT, "-n", "4", "--out", "s"]
    program, *tokens = command(*whole)[2:]
    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_LLVMLITE + program, *tokens],
        env=environment(),
        capture_output=True,
        text=True,
        check=True,
    )
    told = "the compiled engine must have llvmlite, which is not installed"
    assert f"not the native engine: {told}" in done.stderr.splitlines()
    assert "Outcomes: 0 settled, 4 unsettled." in done.stdout
    attributes = open_study(tmp_path / "s").attrs
    assert json.loads(attributes["identity"])["engine"]["name"] == "scan"
    (run,) = json.loads(attributes["runs"])
    assert run["remark"] == f"not the native engine: {told}"

    done = subprocess.run(
        [sys.executable, "-c", WITHOUT_LLVMLITE + program, *tokens, "--engine", "native"],
        env=environment(),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert f"jaxsat: The native engine cannot run this: {told}" in done.stderr.splitlines()


@pytest.mark.slow
def test_llvmlite_that_cannot_be_loaded_is_told(tmp_path):
    """As where its library is missing: a message, no traceback."""
    (tmp_path / "llvmlite").mkdir()
    (tmp_path / "llvmlite" / "__init__.py").write_text("raise OSError('no shared object')\n")
    path = os.pathsep.join([str(tmp_path), environment()["PYTHONPATH"]])
    done = subprocess.run(
        command(*SHORT, "-n", "4", "--engine", "native"),
        env=environment(PYTHONPATH=path),
        capture_output=True,
        text=True,
        check=False,
    )
    assert done.returncode == 2
    assert "llvmlite, which cannot be imported: no shared object" in done.stderr
    assert "Traceback" not in done.stderr
