"""`rare`: probabilities, files and messages, on scenarios of which the answers are known."""

import csv
import io
import json

import jsonschema
import numpy as np
import pytest
from scipy import stats

from jaxsat.cli.app import run
from jaxsat.store.dataset import open_trajectory
from tests.helpers.decaying_rate import DECAY, decaying_rate

SIGMA = 0.005

SETTLING = decaying_rate(
    0,
    SIGMA,
    """
[[requirement]]
id = "STOP"
text = "The rate is below 1.2 mrad/s within 6 s."
formula = "eventually[0 s, 6 s] rate < 1.2e-3 rad/s"
""",
)

VIOLATED = stats.rayleigh.sf(1.2e-3 * np.exp(DECAY * 6) / SIGMA)
"""9e-6, the probability that |η| is too large."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("rare")
    (place / "s.toml").write_text(SETTLING)
    arguments = ["--cases", "300", "--quiet", "--out", str(place / "out")]
    assert run(["rare", str(place / "s.toml"), *arguments]) == 0
    return place / "out"


def record_of(folder):
    return json.loads((folder / "rare-event.json").read_text())


def violations_of(folder):
    return list(csv.DictReader(io.StringIO((folder / "violations.csv").read_text())))


@pytest.mark.slow
def test_a_settling_time_with_a_closed_form_is_exceeded_as_often_as_it_says(folder):
    record = record_of(folder)
    jsonschema.validate(record, json.loads((folder / "rare-event.schema.json").read_text()))
    assert record["doubts"] == []
    probability = record["probability"]
    assert probability["low"] < VIOLATED < probability["high"] < 10 * probability["low"]
    assert probability["value"] == pytest.approx(np.mean(record["estimates"]))
    quantities = {one["quantity"]: one["distance"] for one in record["differences"]}
    assert set(quantities) == {"rate_error[1]", "rate_error[2]"}
    assert min(quantities.values()) > 0.3  # violating cases lie all around the others
    levels = [one["probability"] for one in record["levels"]]
    assert levels == sorted(levels, reverse=True)
    assert levels[-1] == pytest.approx(probability["value"])


@pytest.mark.slow
def test_the_violating_cases_violate_and_are_flown_again_alone(folder, tmp_path):
    rows = violations_of(folder)
    drawn = np.array([[float(one[f"drawn_rate_error_{i}"]) for i in (1, 2)] for one in rows])
    margins = np.array([float(one["margin_SI"]) for one in rows])
    np.testing.assert_allclose(margins, 1.2e-3 - np.hypot(*drawn.T) * np.exp(-3), atol=3e-7)
    assert margins.max() < 0
    assert len(rows) == record_of(folder)["violating"]
    shares = [float(one["share_of_the_probability"]) for one in rows]
    assert sum(shares) == pytest.approx(1)
    case = rows[0]["case"]
    assert int(case) == record_of(folder)["worst"]
    again = record_of(folder)["again"].split()
    assert run([*again[1:], "--quiet"]) == 0
    dataset = open_trajectory(folder / f"case-{case}")
    assert dataset["omega"].values[0, :2] == pytest.approx(drawn[0], abs=1e-15)


@pytest.mark.slow
def test_the_same_command_resumes_and_others_are_refused(folder, capsys):
    before = record_of(folder)
    (folder / "flights" / "00070.npz").unlink()
    scenario, there = str(folder.parent / "s.toml"), ["--out", str(folder)]
    assert run(["rare", scenario, "--cases", "300", "--quiet", *there]) == 0
    after = record_of(folder)
    assert after["estimates"] == before["estimates"]
    capsys.readouterr()
    assert run(["rare", scenario, *there]) == 2
    assert "another rare event (settings.cases: 300 there, 1000 here)" in capsys.readouterr().err
    assert run(["rare", scenario, "--case", "10000000", *there]) == 2
    assert "--case: must be below" in capsys.readouterr().err
    other = ["--set", "control.k2=0.6", "--case", "1"]
    assert run(["rare", scenario, *other, *there]) == 2
    assert "another scenario (scenario.control.k2: 0.5 there, 0.6 here)" in capsys.readouterr().err


@pytest.mark.slow
def test_what_the_page_and_the_terminal_say(folder, tmp_path, capsys):
    page = tmp_path / "page.html"
    assert run(["report", str(folder), "--out", str(page), "--quiet"]) == 0
    text = page.read_text()
    assert "STOP is violated with probability" in text
    assert "Nothing speaks against it" in text
    assert "Where cases violate: rate_error[2]" in text
    capsys.readouterr()


@pytest.mark.slow
@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("[dispersion.rate_error_rad_s]", "[x]", "[dispersion] must be given"),
        ('id = "STOP"', 'id = "STOP"', "--requirement: must be one that studies judge: STOP"),
        ("rate < 1.2e-3 rad/s", "torque < 1 N m", "there is none, got nothing"),
    ],
)
def test_what_cannot_be_estimated_is_refused(old, new, message, tmp_path, capsys):
    text = SETTLING.replace(old, new)
    if new == "[x]":
        text = SETTLING[: SETTLING.index(old)] + SETTLING[SETTLING.index("[[requirement]]") :]
    (tmp_path / "s.toml").write_text(text)
    named = ["--requirement", "NONE"] if old == new else []
    arguments = [str(tmp_path / "s.toml"), *named, "--out", str(tmp_path / "out")]
    assert run(["rare", *arguments]) == 2
    assert message in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_a_folder_without_an_estimate_has_no_case(tmp_path, capsys):
    (tmp_path / "s.toml").write_text(SETTLING)
    arguments = [str(tmp_path / "s.toml"), "--case", "1", "--out", str(tmp_path)]
    assert run(["rare", *arguments]) == 2
    assert "holds no estimate of a rare event" in capsys.readouterr().err
