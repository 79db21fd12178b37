"""Runs of sampled laws whose steps are halved until their error is as small as is asked for."""

import pytest

from jaxsat.cli.integration_error import with_finer_steps
from jaxsat.scenario.build.load import load
from jaxsat.store import open_trajectory

SHORT = ("simulation.duration_s=4", "simulation.save_every_s=1")


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


@pytest.mark.slow
def test_a_run_is_flown_again_and_tells_its_steps(command_line):
    tight = [part for one in (*SHORT, "simulation.solver.name=bosh3") for part in ("--set", one)]
    status, _, err = command_line("simulate", "two-torque-free", *tight, "--out", "usual")
    assert status == 0, err
    assert "flown again" not in err
    before = float(open_trajectory("usual")["rate_error_estimate"])
    tight += ["--set", f"simulation.solver.rate_error_rad_s={before / 100!r}"]
    status, _, err = command_line("simulate", "two-torque-free", *tight, "--out", "fine")
    assert status == 0, err
    assert "flown again with simulation.solver.substeps = " in err
    assert "warning: the steps leave an error" not in err
    found = open_trajectory("fine")
    assert 1e-15 < float(found["rate_error_estimate"]) <= before / 100
    assert "substeps = " in found.attrs["scenario"]
    named = ["--set", "simulation.solver.substeps=4"]
    status, _, err = command_line("simulate", "two-torque-free", *tight, *named, "--out", "named")
    assert status == 0, err
    assert "flown again" not in err
    assert "warning: the steps leave an error" in err
