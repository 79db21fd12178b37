"""`worst`: the case found, its files and messages, on a scenario of which the answer is known."""

import json

import jsonschema
import numpy as np
import pytest

from jaxsat.cli.app import run
from jaxsat.report.requirements import judgements
from jaxsat.store.dataset import open_trajectory
from tests.helpers.decaying_rate import DECAY, decaying_rate

pytest.importorskip("cma")

MEAN, SIGMA = np.array([0.003, -0.001]), 0.002

SETTLING = decaying_rate(
    MEAN.tolist(),
    SIGMA,
    """
[[requirement]]
id = "STOP"
text = "The rate is below 0.02 deg/s within 6 s."
formula = "eventually[0 s, 6 s] rate < 0.02 deg/s"
""",
)

RADIUS = np.sqrt(-2 * np.log(1 - 0.9973))
LARGEST = np.linalg.norm(MEAN) + SIGMA * RADIUS
LEAST = 0.02 - np.rad2deg(LARGEST * np.exp(-DECAY * 6))
"""Least margin (deg/s) in the disc of two normal numbers that holds 99.73 % of them."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("worst")
    (place / "s.toml").write_text(SETTLING)
    arguments = ["--flights", "400", "--quiet", "--out", str(place / "out")]
    assert run(["worst", str(place / "s.toml"), *arguments]) == 0
    return place / "out"


def record_of(folder):
    return json.loads((folder / "worst-case.json").read_text())


@pytest.mark.slow
def test_the_case_found_is_the_worst_one_of_the_closed_form(folder):
    record = record_of(folder)
    jsonschema.validate(record, json.loads((folder / "worst-case.schema.json").read_text()))
    assert record["radius"] == pytest.approx(RADIUS)
    assert record["margin"] == pytest.approx(LEAST, abs=1e-5)
    assert record["margin"] < record["random"]
    assert record["beats_random"]
    assert record["time"] == pytest.approx(6)
    (drawn,) = record["quantities"]
    direction = MEAN / np.linalg.norm(MEAN)
    np.testing.assert_allclose(drawn["values"], LARGEST * direction, atol=3e-4)
    np.testing.assert_allclose(drawn["sigmas"], (drawn["values"] - MEAN) / SIGMA, atol=1e-9)
    assert record["distance"] == pytest.approx(np.linalg.norm(drawn["sigmas"]))
    assert record["distance"] <= record["radius"] * (1 + 1e-9)
    assert record["flights"] == 400 + 320
    assert record["gradients"] >= record["trusted"] > 0


def margin_flown(folder, tmp_path):
    """The margin that `jaxsat simulate` shows of the worst case."""
    arguments = [*record_of(folder)["again"].split()[1:], "--quiet"]
    assert run([*arguments, "--out", str(tmp_path / "run")]) == 0
    (judged,) = judgements(open_trajectory(tmp_path / "run"))
    return judged.margin


@pytest.mark.slow
def test_simulate_flies_the_case_with_its_margin(folder, tmp_path):
    record = record_of(folder)
    assert margin_flown(folder, tmp_path) == pytest.approx(record["margin"], abs=1e-9)
    assert record["margin"] == pytest.approx(record["searched"], abs=2e-6)
    dataset = open_trajectory(tmp_path / "run")
    drawn = record["quantities"][0]["values"]
    assert dataset["omega"].values[0, :2] == pytest.approx(drawn, abs=1e-15)


@pytest.mark.slow
def test_a_case_with_random_attitude_noise_and_failure_is_flown_with_its_margin(tmp_path):
    out = tmp_path / "out"
    settings = [
        "simulation.duration_s=60",
        "dispersion.failure_time_s.high=40",
        'requirement=[{id="SLOW", formula="always rate < 2 deg/s"}]',
    ]
    options = [part for one in settings for part in ("--set", one)]
    arguments = ["--flights", "100", "--quiet", "--out", str(out)]
    assert run(["worst", "failures-12u", *options, *arguments]) == 0
    margin = record_of(out)["margin"]
    assert margin_flown(out, tmp_path) == pytest.approx(margin, abs=1e-9)


@pytest.mark.slow
def test_the_same_command_resumes_and_others_are_refused(folder, capsys):
    before = record_of(folder)
    (folder / "flights" / "00005.npz").unlink()
    scenario, there = str(folder.parent / "s.toml"), ["--out", str(folder)]
    assert run(["worst", scenario, "--flights", "400", "--quiet", *there]) == 0
    after = record_of(folder)
    assert all(after[key] == before[key] for key in ("margin", "searched", "random", "quantities"))
    capsys.readouterr()
    assert run(["worst", scenario, *there]) == 2
    assert "another worst case (settings.flights: 400 there, 2000 here)" in capsys.readouterr().err


@pytest.mark.slow
def test_what_the_page_and_the_terminal_say(folder, tmp_path, capsys):
    page = tmp_path / "page.html"
    assert run(["report", str(folder), "--out", str(page), "--quiet"]) == 0
    text = page.read_text()
    assert "STOP is violated in the worst case found" in text
    assert "the search found less than random flights" in text
    capsys.readouterr()
    scenario = str(folder.parent / "s.toml")
    assert run(["worst", scenario, "--flights", "400", "--out", str(folder)]) == 0
    told = capsys.readouterr().out
    assert "rate_error (rad/s)" in told
    command = f"jaxsat simulate {folder / 'case.toml'}"
    assert "".join(command.split()) in "".join(told.split())  # lines may end anywhere in a path


@pytest.mark.slow
def test_a_requirement_that_no_case_can_violate_is_refused(tmp_path, capsys):
    settings = [
        "simulation.duration_s=60",
        "dispersion.failure_time_s={distribution='uniform', low=70, high=90}",
        'requirement=[{id="SLOW", formula="within 1 s of failure rate < 2 deg/s"}]',
    ]
    options = [part for one in settings for part in ("--set", one)]
    assert run(["worst", "failures-12u", *options, "--flights", "100", "--out", str(tmp_path)]) == 2
    assert "--requirement: must be judged in some case, got SLOW" in capsys.readouterr().err


@pytest.mark.slow
def test_a_requirement_that_studies_do_not_judge_is_refused(tmp_path, capsys):
    (tmp_path / "s.toml").write_text(SETTLING.replace("rate < 0.02 deg/s", "torque < 1 N m"))
    assert run(["worst", str(tmp_path / "s.toml"), "--out", str(tmp_path / "out")]) == 2
    assert "there is none, got nothing" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()
