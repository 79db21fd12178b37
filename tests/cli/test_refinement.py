"""Runs of sampled laws whose steps are halved until their error is as small as is asked for."""

import json
from pathlib import Path
from unittest.mock import Mock

import numpy as np
import pytest

from jaxsat.scenario import Scenario
from jaxsat.scenario.build import study
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import refined_study
from jaxsat.scenario.dump import dump
from jaxsat.scenario.resolution import with_finer_steps
from jaxsat.store.dataset import open_trajectory
from jaxsat.store.tables import open_study
from jaxsat.studies.ensemble import Study

SHORT = ("simulation.duration_s=4", "simulation.save_every_s=1")
LIGHT = (
    "control={law='quaternion-feedback', natural_frequency_rad_s=0.1, period_s=0.1}",
    "spacecraft.failed_thrusters=[]",
)
"""A law that is quick to trace."""


def of(*changes, name="two-torque-free"):
    return load(name, [*SHORT, *changes], purpose="text")


def test_steps_are_halved_where_their_error_is_too_large():
    scenario = of()
    assert with_finer_steps(scenario, (1e-5, 1e-3)) is None
    assert with_finer_steps(scenario, (None, None)) is None
    finer = with_finer_steps(scenario, (1e-3, 1e-3))
    assert finer.simulation.solver.substeps == 8
    assert with_finer_steps(finer, (1e-5, 0.1)).simulation.solver.substeps == 16
    most = of("simulation.solver.substeps=1024")
    assert with_finer_steps(most, (1e-3, 1e-3)) is None
    assert with_finer_steps(of(name="rate-limited"), (1e-3, 1e-3)) is None  # adaptive


def test_a_library_flies_with_the_steps_of_its_own_law(monkeypatch):
    """So its cases can be held against those of a study without it."""
    flown = []

    def built(scenario, count, controller):
        flown.append((scenario.simulation.solver.substeps, controller))
        return Mock(spec=Study)

    errors = iter([(1e-3, 1e-3), (1e-3, 1e-3), (1e-5, 1e-5)])
    monkeypatch.setattr(study, "build_study", built)
    monkeypatch.setattr(study, "pilot_errors", lambda _: next(errors))
    chosen, _ = refined_study(of(), 2, [].append, controller="library")
    assert flown == [(None, None), (8, None), (16, None), (16, "library")]
    assert chosen.simulation.solver.substeps == 16


@pytest.mark.slow
def test_a_run_is_flown_again_and_tells_its_steps(command_line):
    changes = (*SHORT, *LIGHT, "simulation.solver.name=bosh3")
    tight = [part for one in changes for part in ("--set", one)]
    status, _, err = command_line("simulate", "two-torque-free", *tight, "--out", "usual")
    assert status == 0, err
    assert "flown again" not in err
    before = float(open_trajectory("usual")["rate_error_estimate"])
    tight += ["--set", f"simulation.solver.rate_error_rad_s={before / 100!r}"]
    status, _, err = command_line("simulate", "two-torque-free", *tight, "--out", "fine")
    assert status == 0, err
    assert "simulated with simulation.solver.substeps = " in err
    assert "warning: the steps are too long" not in err
    found = open_trajectory("fine")
    assert 1e-15 < float(found["rate_error_estimate"]) <= before / 100
    assert "substeps = " in found.attrs["scenario"]
    named = ["--set", "simulation.solver.substeps=4"]
    status, _, err = command_line("simulate", "two-torque-free", *tight, *named, "--out", "named")
    assert status == 0, err
    assert "flown again" not in err
    assert "warning: the steps are too long" in err


@pytest.mark.slow
def test_a_study_has_the_steps_that_its_first_and_its_fastest_case_need(command_line):
    """Decided before it flies, the same for more cases and for one case alone."""
    spread = "dispersion.omega_rad_s={distribution='uniform', low=-0.05, high=0.05}"
    data = of(*LIGHT, spread).model_dump(exclude_none=True)
    data["simulation"]["solver"] = {"name": "bosh3"}
    usual = Scenario.model_validate(data)
    _, flown = refined_study(usual, 6, pytest.fail, batch_size=6)
    before = flown.evaluate(np.arange(6)).integration_error.rate
    data["simulation"]["solver"]["rate_error_rad_s"] = float(before.max()) / 4
    Path("tight.toml").write_text(dump(Scenario.model_validate(data)))
    command = ("montecarlo", "tight.toml", "--batch-size", "6")
    for count in ("6", "12"):
        status, _, err = command_line(*command, "-n", count, "--out", "s.zarr")
        assert status == 0, err
        assert "simulated with simulation.solver.substeps = " in err
        assert "warning: the steps are too long" not in err
    found = open_study("s.zarr")
    assert found.sizes["case"] == 12
    assert 1e-15 < float(found["rate_error_estimate"].max()) <= before.max() / 4
    assert json.loads(found.attrs["identity"])["scenario"]["simulation"]["solver"]["substeps"] > 4
    status, _, err = command_line(*command, "-n", "12", "--case", "7", "--out", "seven")
    assert status == 0, err
    case = open_trajectory("seven")
    assert float(case["rate_error_estimate"]) == float(found["rate_error_estimate"][7])
