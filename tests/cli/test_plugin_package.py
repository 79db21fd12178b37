"""A package's law and disturbance in every command and engine."""

import shutil

import numpy as np
import pytest

from jaxsat.scenario import plugins
from jaxsat.store.ledger import study_columns
from scenario.packages import PACKAGE, forget_package, install_package

AIR = 'disturbance.torques.air={kind="aerodynamic", force_N=1e-4, arm_m=[0.0, 0.1, 0.2]}'


@pytest.fixture(autouse=True)
def _installed(tmp_path, monkeypatch):
    plugins.installed.cache_clear()
    install_package(tmp_path / "site", monkeypatch)
    shutil.copy(PACKAGE / "reduced-effort.toml", tmp_path / "mine.toml")
    yield
    plugins.installed.cache_clear()
    forget_package()


@pytest.fixture
def run(command_line):
    """Run a command on the scenario with the disturbance, which must end well."""

    def run(command, *tokens):
        options = ("--set", AIR, "--set", "simulation.duration_s=4")
        status, out, err = command_line(command, "mine.toml", *options, *tokens)
        assert status == 0, err
        return out, err

    return run


@pytest.mark.slow
def test_simulate_and_the_look_at_controllability(run, tmp_path):
    run("simulate", "--out", "run")
    assert 'kind = "aerodynamic"' in (tmp_path / "run" / "scenario.toml").read_text()
    assert "Disturbances not included: air." in run("controllability")[0]


@pytest.mark.slow
def test_studies_by_every_engine_and_in_processes_are_equal(run):
    found = {}
    for name, options in {
        "native": ("--engine", "native"),
        "scan": ("--engine", "scan"),
        "diffrax": ("--engine", "diffrax"),
        "processes": ("--engine", "scan", "--processes", "2"),
    }.items():
        _, err = run("montecarlo", "-n", "4", "--seed", "3", "--out", f"{name}.zarr", *options)
        assert "not the native engine" not in err
        found[name] = np.asarray(study_columns(f"{name}.zarr")["cost"])
    np.testing.assert_array_equal(found["processes"], found["scan"])
    for name in ("native", "diffrax"):
        np.testing.assert_allclose(found[name], found["scan"], rtol=1e-6)
    run("montecarlo", "-n", "4", "--seed", "3", "--case", "2", "--out", "case")


@pytest.mark.slow
def test_gains_of_the_package_are_tuned(run, tmp_path):
    run("tune", "--out", "tuned", "--workers", "1")
    text = (tmp_path / "tuned" / "tuned.toml").read_text(encoding="utf-8")
    assert 'law = "reduced-effort"' in text
    assert 'kind = "aerodynamic"' in text


@pytest.mark.slow
def test_its_law_flies_beside_the_others(command_line, tmp_path):
    laws = ("--law", "mine.toml", "--law", "rate", "--level", "nominal", "--torque-limit", "20")
    status, out, err = command_line("compare", *laws, "--seed", "3", "-n", "2", "--out", "c")
    assert status == 0, err
    assert "mine.toml" in out
