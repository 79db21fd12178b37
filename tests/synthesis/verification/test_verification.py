"""`verify`: verdicts, files and status, on a scenario of which the answers are known."""

import csv
import io
import json

import jsonschema
import numpy as np
import pytest

from jaxsat.cli.app import run
from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.errors import ArgumentError
from jaxsat.report.printers import terminal_text
from jaxsat.report.verification_document import verification_document
from jaxsat.scenario.build.load import load
from jaxsat.store.dataset import open_trajectory
from jaxsat.studies.statistics import WhenAllDecided, WhenDecided
from jaxsat.synthesis.verification.conditions import conditions_of
from jaxsat.synthesis.verification.result import Criterion

SCENARIO = """
title = "Two wheels and a third"
[spacecraft]
inertia_kg_m2 = [1.0, 1.2, 0.8]
[[wheel]]
name = "x"
axis = [1, 0, 0]
torque_limit_N_m = 0.05
[[wheel]]
axis = [0, 1, 0]
torque_limit_N_m = 0.05
[[wheel]]
axis = [0, 0, 1]
torque_limit_N_m = 0.05
[orbit]
altitude_km = 500
[initial]
quaternion = [0.96, 0.28, 0, 0]
omega_rad_s = [0, 0, 0]
[control]
law = "quaternion-feedback"
natural_frequency_rad_s = 0.3
damping = 1.0
period_s = 0.2
[simulation]
duration_s = 40
save_every_s = 0.2
seed = 3
[dispersion.omega_rad_s]
distribution = "uniform"
low = -0.01
high = 0.01
[[requirement]]
id = "HALF"
text = "The spacecraft does not start with a positive rate about x."
formula = "always[0 s, 0 s] rate_x < 0 rad/s"
[[requirement]]
id = "ALL"
formula = "always rate < 1e6 rpm"
[[requirement]]
id = "TORQUE"
formula = "always torque < 1 N m"
"""

AFTER_A_FAILURE = """
[[failure]]
of = "wheel x"
at_s = 1000
kind = "dead"
[[requirement]]
id = "AFTER"
formula = "within 10 s of failure rate < 1e6 rpm"
"""
"""A failure that never strikes, and a requirement of what follows one."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    place = tmp_path_factory.mktemp("verify")
    (place / "s.toml").write_text(SCENARIO + AFTER_A_FAILURE)
    arguments = ["--fraction", "0.95", "--cases", "1000", "--quiet", "--out"]
    assert run(["verify", str(place / "s.toml"), *arguments, str(place / "out")]) == 1
    return place / "out"


@pytest.mark.slow
def test_the_record_follows_its_schema_and_its_verdicts_are_the_right_ones(folder):
    record = json.loads((folder / "verification.json").read_text())
    schema = json.loads((folder / "verification.schema.json").read_text())
    jsonschema.validate(record, schema)
    verdicts = {(one["requirement"], one["condition"]): one for one in record["shown"]}
    conditions = ("nominal", "dispersed", "dispersed, and one wheel fails")
    assert [verdicts["ALL", one]["verdict"] for one in conditions] == ["met"] * 3
    assert [verdicts["HALF", one]["verdict"] for one in conditions[1:]] == ["violated"] * 2
    assert [verdicts["TORQUE", one]["verdict"] for one in conditions] == [
        "met",
        "not judged",
        "not judged",
    ]
    after = [verdicts["AFTER", one]["verdict"] for one in conditions]
    assert after == ["not tried", "not tried", "met"]
    half = verdicts["HALF", "dispersed"]
    assert half["fraction"]["low"] < 0.5 < half["fraction"]["high"]
    assert half["met"] < half["cases"] < 1000
    assert [one["verdict"] for one in record["requirements"]] == [
        "violated",
        "met",
        "not judged",
        "met",
    ]


@pytest.mark.slow
def test_what_nothing_tries_is_not_verified(tmp_path):
    """Nothing fails, so that no window of the requirement begins."""
    others = SCENARIO.index("[[requirement]]")
    (tmp_path / "s.toml").write_text(SCENARIO[:others] + AFTER_A_FAILURE)
    arguments = ["--no-failures", "--cases", "300", "--quiet", "--out", str(tmp_path / "out")]
    assert run(["verify", str(tmp_path / "s.toml"), *arguments]) == 1
    record = json.loads((tmp_path / "out" / "verification.json").read_text())
    assert {one["verdict"] for one in record["shown"]} == {"not tried"}
    text = terminal_text(verification_document(record))
    assert "0 of 1 requirements are verified." in text
    assert "Not tried: AFTER." in text


@pytest.mark.slow
def test_the_worst_case_is_flown_again_by_its_command(folder, tmp_path):
    rows = list(csv.DictReader(io.StringIO((folder / "matrix.csv").read_text())))
    worst = next(one for one in rows if one["condition"].endswith("fails"))
    words = worst["command"].split()
    assert words[0] == "jaxsat"
    assert run([*words[1:], "--out", str(tmp_path / "again"), "--quiet"]) == 0
    dataset = open_trajectory(tmp_path / "again")
    assert -dataset["omega"].values[0, 0] == pytest.approx(float(worst["least_margin"]), abs=1e-15)


@pytest.mark.slow
def test_every_device_fails_in_every_kind_of_which_the_amount_is_a_fraction(folder):
    rows = list(csv.DictReader(io.StringIO((folder / "failures.csv").read_text())))
    assert {one["device"] for one in rows} == {"wheel x", "wheel 2", "wheel 3"}
    assert {one["failure"] for one in rows} == {
        "wheel dead",
        "wheel degraded",
        "wheel stopped",
        "wheel runaway",
    }
    record = json.loads((folder / "verification.json").read_text())
    cases = next(one["cases"] for one in record["shown"] if "fails" in one["condition"])
    assert sum(int(one["cases"]) for one in rows) == cases


@pytest.mark.slow
def test_the_same_command_resumes_and_another_demand_is_refused(folder, capsys):
    before = json.loads((folder / "verification.json").read_text())
    scenario = str(folder.parent / "s.toml")
    same = ["--fraction", "0.95", "--cases", "1000", "--quiet", "--out", str(folder)]
    assert run(["verify", scenario, *same]) == 1
    after = json.loads((folder / "verification.json").read_text())
    assert after["shown"] == before["shown"]
    fewer = [*same[:3], "40", *same[4:]]
    assert run(["verify", scenario, *fewer]) == 1
    record = json.loads((folder / "verification.json").read_text())
    assert {one["cases"] for one in record["shown"] if one["verdict"] == "undecided"} == {40}
    assert run(["verify", scenario, *same]) == 1
    assert json.loads((folder / "verification.json").read_text())["shown"] == before["shown"]
    capsys.readouterr()
    assert run(["verify", scenario, "--out", str(folder)]) == 2
    assert "another verification" in capsys.readouterr().err


@pytest.mark.slow
def test_what_the_page_and_the_terminal_say(folder, tmp_path, capsys):
    page = tmp_path / "page.html"
    assert run(["report", str(folder), "--out", str(page), "--quiet"]) == 0
    text = page.read_text()
    assert "2 of 4 requirements are verified" in text
    assert "Violated: HALF" in text
    capsys.readouterr()


@pytest.mark.parametrize("table", ["[requirement]", "dispersion"])
def test_a_scenario_without_what_is_needed_is_refused(table, tmp_path, capsys):
    dispersion, requirement = SCENARIO.index("[dispersion"), SCENARIO.index("[[requirement")
    without = {
        "[requirement]": SCENARIO[:requirement],
        "dispersion": SCENARIO[:dispersion] + SCENARIO[requirement:],
    }
    (tmp_path / "s.toml").write_text(without[table])
    assert run(["verify", str(tmp_path / "s.toml"), "--out", str(tmp_path / "out")]) == 2
    assert f"[{table}] must be given, got nothing" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


def test_failures_that_a_scenario_draws_itself_are_not_drawn_twice():
    names = [one.name for one in conditions_of(load("failures-12u"), True)[0]]
    assert names == ["dispersed"]
    mixed = conditions_of(load("hybrid-wheels"), True)[0]
    assert [one.name for one in mixed] == ["dispersed", "thruster-fails", "wheel-fails"]
    for one in mixed[1:]:
        kind = next(a for a in ACTUATORS if one.name.startswith(a.name))
        table = one.scenario.dispersion.distributions[f"failed_{kind.name}"]
        assert table.high == len(getattr(one.scenario, kind.name)) - 0.5
    names = [one.name for one in conditions_of(load("hybrid-wheels"), False)[0]]
    assert names == ["dispersed"]


def test_failures_are_drawn_where_the_scenario_is_a_case_of_its_own():
    case = load("hybrid-wheels", ["dispersion.case=3", "dispersion.point=[0.5]"], purpose="text")
    _, fails, _ = conditions_of(case, True)[0]
    assert (fails.scenario.dispersion.case, fails.scenario.dispersion.point) == (None, None)


def test_pairs_are_of_every_two_kinds_of_actuators():
    conditions = conditions_of(load("hybrid-wheels"), False, pairs=True)[0][1:]
    assert {one.name: one.text for one in conditions} == {
        "thruster-thruster-fail": "dispersed, and two thrusters fail",
        "thruster-wheel-fail": "dispersed, and a thruster and a wheel fail",
        "wheel-wheel-fail": "dispersed, and two wheels fail",
    }
    mixed = conditions[1].scenario
    assert [one.of.partition(" ")[0] for one in mixed.failure] == ["thruster", "wheel"]
    kinds = mixed.dispersion.distributions["failure_kind"]
    thruster, wheel = (
        {value for value, weight in zip(*lists, strict=True) if weight}
        for lists in zip(kinds.values, kinds.weights, strict=True)
    )
    assert thruster == {0, 1, 2, 3, 4, 6}
    assert wheel == {0, 1, 2, 5}
    assert len({one.of for one in conditions[2].scenario.failure}) == 2


@pytest.mark.slow
def test_every_pair_of_devices_fails(tmp_path):
    (tmp_path / "s.toml").write_text(SCENARIO + AFTER_A_FAILURE)
    arguments = ["--no-failures", "--pairs", "--fraction", "0.9", "--cases", "1000", "--quiet"]
    assert (
        run(["verify", str(tmp_path / "s.toml"), *arguments, "--out", str(tmp_path / "out")]) == 1
    )
    record = json.loads((tmp_path / "out" / "verification.json").read_text())
    jsonschema.validate(
        record, json.loads((tmp_path / "out" / "verification.schema.json").read_text())
    )
    rows = record["failures"]
    assert {one["device"] for one in rows} == {
        "wheel x + wheel 2",
        "wheel x + wheel 3",
        "wheel 2 + wheel 3",
    }
    flown = next(one["cases"] for one in record["shown"] if "fail" in one["condition"])
    assert sum(one["cases"] for one in rows) == pytest.approx(2 / 3 * flown, rel=0.1)
    dead = next(one for one in rows if one["failure"] == "wheel dead + wheel dead")
    assert (dead["severity"], dead["recovered"]) == ("critical", 0)
    half = [one["requirement"] for one in rows]
    assert {*half} == {"HALF"}
    words = rows[0]["command"].split()
    assert run([*words[1:], "--out", str(tmp_path / "again"), "--quiet"]) == 0
    dataset = open_trajectory(tmp_path / "again")
    assert -dataset["omega"].values[0, 0] == pytest.approx(rows[0]["margin"], abs=1e-15)


def test_a_device_that_has_failed_before_the_start_does_not_fail_again(tmp_path):
    fourth = '[[wheel]]\nname = "skew"\naxis = [1, 1, 1]\ntorque_limit_N_m = 0.05\n'
    failed = SCENARIO.replace('name = "x"\n', 'name = "x"\nfailed = true\n')
    (tmp_path / "s.toml").write_text(failed.replace("[orbit]", fourth + "[orbit]"))
    _, one = conditions_of(load(tmp_path / "s.toml"), True)[0]
    numbers = one.scenario.dispersion.distributions["failed_wheel"]
    assert (numbers.values, numbers.weights) == ((1, 2, 3), (1, 1, 1))
    assert one.scenario.failure[0].of == "wheel 2"


@pytest.mark.parametrize("demand", [{"fraction": 1.0}, {"confidence": 0.5}, {"cases": 0}])
def test_demands_that_cannot_be_are_refused(demand):
    with pytest.raises(ArgumentError, match=next(iter(demand))):
        Criterion(**demand)


@pytest.mark.parametrize("confidence", [0.8, 0.95])
def test_a_claim_holds_with_the_demanded_confidence_however_many_cases_are_flown(confidence):
    """2,000 studies of two requirements that are met by just less than what is demanded."""
    demand = Criterion(0.98, confidence, 4000)
    rule = demand.rule(2)
    whole = WhenAllDecided(rule)
    generator, wrong = np.random.default_rng(7), 0
    for _ in range(1000):
        draws = generator.random((1000, 2)) < 0.98
        met = np.cumsum(draws, axis=0)[63::64]
        looks = range(64, 1001, 64)
        claims = [
            any(rule.above(int(m), n) for m in row) for row, n in zip(met, looks, strict=False)
        ]
        wrong += any(claims)
        assert whole.met(met[-1], 1000) == all(rule.met(int(m), 1000) for m in met[-1])
    assert wrong / 1000 < 1 - confidence
    assert wrong > 0


def test_the_interval_ends_where_a_fraction_is_decided():
    rule = WhenDecided(0.5, 3, 0.9)
    for met, count in ((0, 40), (17, 60), (300, 310), (512, 512)):
        value, low, high = rule.interval(met, count)
        assert low <= value == met / count <= high
        for end in (low, high):
            beyond = WhenDecided(end - 1e-9 if end == low else end + 1e-9, 3, 0.9)
            within = WhenDecided(end + 1e-9 if end == low else end - 1e-9, 3, 0.9)
            if 1e-9 < end < 1 - 1e-9:
                assert beyond.met(met, count)
                assert not within.met(met, count)
