"""Laws whose code ends Python: told as their fault, never a success."""

import os
import subprocess
import sys

import pytest

LAW = """
import sys
import jax.numpy as jnp
from jaxsat import AbstractSampledController, LawDeclaration
from jaxsat.core.declaration import number


class Law(AbstractSampledController):
    declaration = LawDeclaration(
        summary="nothing",
        keys=(number("period_s", "Period", "s", above=0, default=0.5),),
        torques=3,
    )
    period: object

    @classmethod
    def from_table(cls, values, context):
        {from_table}
        return cls(jnp.asarray(values["period_s"]))

    def init(self, state):
        return jnp.zeros(())

    def step(self, t, state, memory):
        {step}
        return jnp.zeros(3), memory

{module}
"""

SCENARIO = """
title = "Ends"
[spacecraft]
inertia_kg_m2 = [4.0, 5.0, 6.0]
thruster_torque_axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
[orbit]
rate_rad_s = 0.0011
[initial]
quaternion = [0.8, 0.6, 0.0, 0.0]
omega_rad_s = [0.0, 0.01, -0.02]
[control]
law = "{module}:Law"
[simulation]
duration_s = 1
save_every_s = 0.5
"""


@pytest.mark.parametrize("where", ["module", "from_table", "step"])
@pytest.mark.parametrize("code", ["0", "'enough'"])
def test_it_is_told_of_the_law(command_line, tmp_path, where, code):
    places = dict.fromkeys(("module", "from_table", "step"), "pass")
    places[where] = f"sys.exit({code})"
    module = f"ends_in_{where}_{len(code)}"
    (tmp_path / f"{module}.py").write_text(LAW.format(**places))
    (tmp_path / "mine.toml").write_text(SCENARIO.format(module=module))
    for command in (["scenarios", "check", "mine.toml"], ["simulate", "mine.toml"]):
        sys.modules.pop(module, None)
        status, out, err = command_line(*command)
        assert status == 2, (out, err)
        assert "control.law" in err
        assert "SystemExit" in err
        assert f"{module}.py:" in err
    assert not (tmp_path / "jaxsat-mine").exists()


@pytest.mark.parametrize(
    ("statement", "told"),
    [
        ("import os; os._exit(0)", "os._exit(0)"),
        ("raise BaseException('odd')", "BaseException: odd"),
    ],
)
def test_no_end_of_a_module_is_a_success(tmp_path, statement, told):
    """Also one that no exception goes with, in a process of its own, which it would end."""
    (tmp_path / "ends.py").write_text(f"pass\n{statement}")
    (tmp_path / "mine.toml").write_text(SCENARIO.format(module="ends"))
    command = (sys.executable, "-m", "jaxsat", "scenarios", "check", "mine.toml")
    done = subprocess.run(command, capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 2, (done.stdout, done.stderr)
    assert "mine.toml:12: key control.law: must name a module that can be" in done.stderr
    assert f"{told} ({tmp_path / 'ends.py'}:2)" in done.stderr


def test_processes_that_are_forked_end_as_ever(command_line, monkeypatch):
    def fork(_):
        child = os.fork()
        if child == 0:
            os._exit(7)
        statuses.append(os.waitstatus_to_exitcode(os.waitpid(child, 0)[1]))

    statuses, end = [], os._exit
    monkeypatch.setattr("jaxsat.cli.scenarios.print_text", fork)
    assert command_line("scenarios", "schema")[0] == 0
    assert statuses == [7]
    assert os._exit is end
