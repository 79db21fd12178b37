"""`jaxsat compare`."""

import functools
import json
import sys

import numpy as np
import pytest

from jaxsat.core import process
from jaxsat.synthesis.comparison.acceptance import ComparisonSetting
from jaxsat.synthesis.comparison.run import compare
from jaxsat.synthesis.execution import Listener

QUICK = [
    *("--law", "switching", "--law", "rate", "--level", "nominal", "--torque-limit", "20"),
    *("--seed", "3", "-n", "3"),
]


@pytest.fixture
def jaxsat(command_line):
    return functools.partial(command_line, "compare")


@pytest.mark.slow
def test_table_record_and_figure_and_going_on(jaxsat, tmp_path, monkeypatch):
    """Bounds without the planner's starts, which those of `jaxsat bound` have."""
    pytest.importorskip("casadi")
    monkeypatch.setattr("jaxsat.synthesis.optima.run.plans_of", lambda *given: [])
    command = [*QUICK, "--bounds", "2", "--out", "c"]
    status, out, err = jaxsat(*command)
    assert status == 0, err
    assert "nominal, 20 N m: no law is recommended. No law settled a single case." in out
    record = json.loads((tmp_path / "c" / "comparison.json").read_text())
    assert [row["law"] for row in record["rows"]] == ["switching", "rate"]
    assert all(row["cases"] == 3 for row in record["rows"])
    assert {path.name for path in (tmp_path / "c").iterdir()} == {
        ".jaxsat",
        "bounds",
        "comparison.json",
        "comparison.png",
        "comparison.svg",
        "studies",
    }
    assert any(line.split()[:3] == ["20", "nominal", "switching"] for line in out.splitlines())
    _bounds_stand_beside_the_table(record, out)

    before = {
        path: path.stat().st_mtime_ns
        for folder in ("studies", "bounds")
        for path in (tmp_path / "c" / folder).rglob("*")
    }
    assert tmp_path / "c" / "bounds" / "20-settled.json" in before
    status, again, _ = jaxsat(*command)
    assert status == 0
    assert again == out
    kept = [path for path in before if path.is_file() and "lock" not in path.name]
    assert all(path.stat().st_mtime_ns == before[path] for path in kept)

    status, _, err = jaxsat(*QUICK[:-4], "--seed", "4", "-n", "3", "--out", "c")
    assert status == 2
    assert "another study" in err


def _bounds_stand_beside_the_table(record, out):
    """No thrust turns the body for nothing: the least effort is above the momentum taken out, and
    the least time above what full thrust about both axes needs for that."""
    (least,) = record["bounds_from_papers_start"]
    assert (least["torque_limit"], least["starts"], least["seed"]) == (20, 2, 3)
    momentum = np.linalg.norm([449.5 * 0.1, 264.6 * 0.11]) - 264.6 * 0.0011  # the orbit's stays
    assert momentum < least["effort"] < 10 * momentum
    assert max(momentum / (20 * np.sqrt(2)), 10.0) < least["time"] < 40.0  # 14.3 with more starts
    assert f"{least['time']:.4g}" in out
    assert f"{least['effort']:.4g}" in out
    assert "Best of 2 starts and the planner's, not certified" in out


OWN_LAW = """
import jax.numpy as jnp
from jaxsat.control import AbstractFeedbackLaw, AbstractSampledController
from jaxsat.core.declaration import LawDeclaration, number

class Sampled(AbstractSampledController):
    declaration = LawDeclaration(
        summary="damps two rates", keys=(number("period_s", "Period", "s", above=0, default=0.5),))
    period: jnp.ndarray

    @classmethod
    def from_table(cls, values, context):
        return cls(jnp.asarray(values["period_s"]))

    def init(self, state):
        return None

    def step(self, t, state, memory):
        return -50 * state.omega[:2], None

    def rate_error(self, state, memory):
        return state.omega[:2]

class Own(AbstractFeedbackLaw):
    declaration = LawDeclaration(summary="damps two rates")

    @classmethod
    def from_table(cls, values, context):
        return cls()

    def torque(self, t, state):
        return -50 * state.omega[:2]
"""


@pytest.fixture
def own_law(tmp_path, monkeypatch):
    """A law in the current folder, which is gone from Python afterwards."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(process, "_ADDED", [])
    (tmp_path / "my_compared_law.py").write_text(OWN_LAW)
    yield
    sys.modules.pop("my_compared_law", None)


@pytest.mark.slow
def test_one_call_gives_what_the_command_writes(jaxsat, tmp_path):
    told = []
    options = {"level": "nominal", "torque_limit": 20, "count": 3, "seed": 3}
    listener = Listener(progress=lambda what, progress: told.append((what, progress)))
    found = compare("rate", **options, listener=listener)
    (row,), (verdict,) = found[:2]
    assert (row.setting, row.cases, verdict.law) == (
        ComparisonSetting("nominal", 20.0, "rate"),
        3,
        None,
    )
    assert told[0] == ("rate, 20 N m, nominal, random start", None)
    assert told[-1][1].done == 1  # the one case from the paper's start

    command = ["--law", "rate", "--level", "nominal", "--torque-limit", "20", "-n", "3"]
    assert jaxsat(*command, "--seed", "3", "--out", "c")[0] == 0
    written = json.loads((tmp_path / "c" / "comparison.json").read_text())
    assert written["rows"] == [row.as_data()]
    assert written["verdicts"] == [verdict._asdict()]
    again = compare("rate", **options, out=tmp_path / "c")
    np.testing.assert_array_equal(again.rows[0].settling_times, row.settling_times)


@pytest.mark.slow
def test_a_law_of_ones_own_flies_beside_the_others(jaxsat, own_law, tmp_path):
    laws = ["--law", "my_compared_law:Sampled", "--law", "rate", "--level", "nominal"]
    status, _, err = jaxsat(*laws, "--torque-limit", "20", "--seed", "3", "-n", "2", "--out", "c")
    assert status == 0, err
    record = json.loads((tmp_path / "c" / "comparison.json").read_text())
    assert [row["law"] for row in record["rows"]] == ["rate", "my_compared_law:Sampled"]


@pytest.mark.slow
def test_a_law_that_settles_is_taken(jaxsat):
    laws = ["--law", "three-slew", "--law", "rate", "--level", "nominal"]
    status, out, _ = jaxsat(*laws, "--torque-limit", "20", "--seed", "3", "-n", "6", "--out", "c")
    assert status == 0
    text = " ".join(out.split())
    assert "nominal, 20 N m: the recommended law is three-slew. It settles 100.0%" in text
    assert "significantly fewer cases settle with rate (0.0%)" in text


@pytest.mark.parametrize(
    ("tokens", "message"),
    [
        (
            ["--torque-limit", "0"],
            "--torque-limit: must be a number of N m from 0.01 to 1000, or all",
        ),
        (
            ["--torque-limit", "much"],
            "--torque-limit: must be a number of N m from 0.01 to 1000, or all",
        ),
        (["-n", "0"], "-n: must be a whole number from 1"),
        (["--level", "soft"], "--level"),
        (["failures-12u", "--law", "rate", "--level", "mc"], "must be given without a scenario"),
        (["--set", "simulation.duration_s=9"], "--set: must be given with a scenario"),
        (["--law", "coast"], "must be one of three-slew, oscillatory"),
        (["--law", "no_such_law:X"], "there is no module no_such_law"),
        (
            ["--law", "my_compared_law:Own", "--level", "mc"],
            "must be a sampled law for two torques",
        ),
    ],
)
def test_mistakes_exit_with_two(jaxsat, own_law, tokens, message):
    status, _, err = jaxsat("--seed", "3", *tokens)
    assert status == 2
    assert message in err


def test_a_folder_of_something_else_is_left_alone(jaxsat, tmp_path):
    (tmp_path / "mine").mkdir()
    (tmp_path / "mine" / "letter.txt").write_text("dear")
    status, _, err = jaxsat(*QUICK, "--out", "mine")
    assert status == 2
    assert "did not write" in err


def test_a_folder_that_only_looks_like_a_comparison_is_left_alone(jaxsat, tmp_path):
    mine = tmp_path / "mine"
    (mine / "studies").mkdir(parents=True)
    (mine / "comparison.png").write_text("my picture")
    status, _, err = jaxsat(*QUICK, "--out", "mine")
    assert status == 2
    assert "did not write (comparison.png, studies)" in err
    assert (mine / "comparison.png").read_text() == "my picture"
