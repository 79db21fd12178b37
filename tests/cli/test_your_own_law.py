"""The page docs/your-own-law.md, done as it says."""

import re
import sys
from pathlib import Path

import pytest

from jaxsat.core import process

PAGE = Path(__file__).parents[2] / "docs" / "your-own-law.md"


@pytest.fixture(autouse=True)
def _files(tmp_path, monkeypatch):
    """The two files of the page in the current folder."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(process, "_ADDED", [])
    text = PAGE.read_text(encoding="utf-8")
    for name, kind in (("quaternion_pd.py", "python"), ("mine.toml", "toml")):
        (tmp_path / name).write_text(blocks(text, kind)[0], encoding="utf-8")
    yield
    sys.modules.pop("quaternion_pd", None)


def blocks(text, kind):
    return re.findall(rf"^```{kind}\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)


def commands():
    return re.findall(r"^    jaxsat (.*)$", PAGE.read_text(encoding="utf-8"), re.MULTILINE)


def test_the_law_takes_at_most_forty_lines_and_is_all_right(command_line):
    code = blocks(PAGE.read_text(encoding="utf-8"), "python")[0]
    assert len([line for line in code.splitlines() if line.strip()]) <= 40
    status, out, err = command_line(*commands()[0].split())
    assert (status, out.splitlines()[0]) == (0, "mine.toml: valid (Quaternion feedback)"), err


@pytest.mark.slow
def test_its_commands_simulate_disperse_and_tune(command_line, tmp_path):
    for command in commands()[1:5]:
        tokens = command.replace("-n 1000", "-n 8").split()
        if tokens[0] == "tune":
            tokens += ["--set", "tuning.steps=2", "--set", "tuning.held_out_cases=4"]
        status, out, err = command_line(*tokens)
        assert status == 0, err
        assert "not the native engine" not in err
        if tokens[0] == "montecarlo":
            assert "8 settled, 0 unsettled" in out
    assert 'law = "quaternion_pd:QuaternionPD"' in (tmp_path / "tuned" / "tuned.toml").read_text()
    case = ("montecarlo", "mine.toml", "-n", "8", "--seed", "3", "--case", "2", "--out", "case")
    status, out, err = command_line(*case)
    assert status == 0, err


@pytest.mark.slow
def test_the_law_leaves_half_a_turn(command_line):
    turned = ("initial.quaternion=[0,1,0,0]", "initial.omega_rad_s=[0,-0.0011,0]")
    start = [part for one in turned for part in ("--set", one)]
    status, out, err = command_line("simulate", "mine.toml", *start, "--out", "half")
    assert status == 0, err
    assert "\nSettled at " in out


def test_the_law_with_an_integral_is_all_right_too(command_line, tmp_path):
    text = PAGE.read_text(encoding="utf-8")
    first, second = blocks(text, "python")
    imports = first.replace("AbstractFeedbackLaw,", "AbstractController, AbstractFeedbackLaw,", 1)
    imports = imports.replace("import number", "import choice, number")
    code = f"import equinox as eqx\n{imports}\n\n{second}"
    (tmp_path / "quaternion_pd.py").write_text(code, encoding="utf-8")
    law = ("--set", "control.law=quaternion_pd:QuaternionPID", "--set", "control.rate=inertial")
    status, out, err = command_line("scenarios", "check", "mine.toml", *law)
    assert status == 0, err
    assert ": valid (" in out


@pytest.mark.slow
def test_a_gradient_that_is_nan_is_told_with_its_cases_gain_and_line(command_line, tmp_path):
    place = tmp_path / "quaternion_pd.py"
    code = place.read_text(encoding="utf-8")
    line = "        q = q * jnp.minimum(1.0, jnp.inf / jnp.sum(q**2))  # no limit: values as before"
    head, returned = code.rsplit("        return ", 1)
    place.write_text(f"{head}{line}\n        return {returned}", encoding="utf-8")
    number = head.count("\n") + 1
    few = ("tuning.screened=2", "tuning.screening_cases=2", "tuning.cases=2")
    solver = ("name=euler", "steps=fixed", "step_s=0.5")  # of one stage
    quick = ("simulation.duration_s=10", *(f"simulation.solver.{one}" for one in solver))
    short = [part for one in (*few, *quick) for part in ("--set", one)]
    status, out, err = command_line("tune", "mine.toml", "--out", "tuned", *short)
    assert (status, out) == (1, "")
    told = err.splitlines()[-1]
    assert "no case of step 1 has a usable gradient at any of its 2 points" in told
    assert "2 of 2 cases have no usable gradient (0, 1)" in told
    assert "by kp, kd; the derivative of case 0 by kp becomes NaN at 0 s by the operation" in told
    assert f"{place}, line {number} (QuaternionPD.torque)" in told
    assert not (tmp_path / "tuned" / "summary.md").exists()
