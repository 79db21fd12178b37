"""Formulas of requirements, and what is told of a mistake in one."""

import math

import pytest

from jaxsat.core.declaration.requirements import (
    Inequality,
    Instant,
    Junction,
    Negation,
    Temporal,
    comparisons,
)
from jaxsat.core.errors import ArgumentError
from jaxsat.scenario import read
from jaxsat.scenario.dump import dump
from jaxsat.scenario.formulas import parse
from scenario.mistakes import SWITCHING, THREE_AXIS, problems_of


def test_a_formula_is_a_tree():
    text = "always[5 min, end - 10 s] tilt<1.5deg and not within 2 s of failure rate >= 3 rpm"
    tilt = Inequality("tilt", True, math.radians(1.5), "deg", math.pi / 180, 27)
    rate = Inequality("rate", False, 3 * math.pi / 30, "rpm", math.pi / 30, 69)
    window = Instant("start", 300.0), Instant("end", -10.0)
    after = Temporal("eventually", rate, Instant("failure"), Instant("failure", 2.0))
    assert parse(text) == Junction((Temporal("always", tilt, *window), Negation(after)), True)


def test_limits_of_rates_may_be_in_the_units_of_pointing_stability():
    """1 arcsec/s is 360 degrees / 1,296,000 a second, and 60 of them are 1 arcmin/s."""
    parsed = parse("always (rate < 30 arcsec/s and relative_rate < 0.5 arcmin/s)")
    for one in comparisons(parsed):
        assert one.limit == pytest.approx(30 * 2 * math.pi / 1_296_000, rel=1e-14)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("always pointing_eror < 2 deg", "column 8, did you mean pointing_error?"),
        ("alway tilt < 2 deg", "column 1, did you mean always?"),
        ("always tilt < 2 degs", "column 17, did you mean deg?"),
        ("always tilt < 2", "must have tilt in rad or deg"),
        ("always wheel_momentum < 2 N", "in N m s or mN m s, but got N at column 27"),
        ("always[300, end] tilt < 2 deg", "in s or min or h"),
        ("always[0 s, ende] tilt < 1 rad", "column 13, did you mean end?"),
        ("always[9 s, 5 s] tilt < 1 rad", "got 9 s before 5 s at column 8"),
        ("always tilt 2 deg", "must have <, <=, > or >= after tilt, but got 2 at column 13"),
        ("always (tilt < 2 deg", "must have ) after a formula in brackets, but got nothing"),
        ("always tilt < 2 deg foo", "must end, or continue with and, or, until, but got foo"),
        ("always tilt < 1 rad $", "got $ at column 21"),
        ("always sun_angle > 3 deg", "must have ( after sun_angle, as in sun_angle(0, 0, 1)"),
        ("always sun_angle(0, 0, 0) > 3 deg", "not zero, but got zeros at column 17"),
        ("tilt < 2 deg", "must say when with always, eventually, until or within"),
        ("always eventually tilt < 2 deg", "inside each other, but got always around another"),
        ("(" * 1000, "must not have more than 20 operators inside each other"),
        ("", "must name a signal"),
    ],
)
def test_mistakes_are_told_with_their_column(text, message):
    with pytest.raises(ArgumentError) as caught:
        parse(text)
    assert message in str(caught.value)


REQUIREMENT = """
[[requirement]]
id = "R1"
formula = "always[{begin}, {end}] {signal} < 1 {unit}"
"""


def test_a_scenario_keeps_its_requirements(tmp_path):
    path = tmp_path / "mine.toml"
    good = {"begin": "0 s", "end": "end", "signal": "tilt", "unit": "rad"}
    path.write_text(SWITCHING + REQUIREMENT.format(**good))
    scenario = read(path)
    path.write_text(dump(scenario))
    assert read(path) == scenario
    assert scenario.requirement[0].formula == "always[0 s, end] tilt < 1 rad"
    assert "[[requirement]]" not in dump(scenario.model_copy(update={"requirement": ()}))


@pytest.mark.parametrize(
    ("keys", "message"),
    [
        ({"signal": "tlit"}, "got tlit at column 18, did you mean tilt?"),
        ({"signal": "wheel_momentum", "unit": "N m s"}, "without [[wheel]], got wheel_momentum"),
        ({"begin": "failure"}, "must have a [[failure]] to count from, got always with failure"),
        ({"begin": "2 h"}, "must have windows that begin by simulation.duration_s = 500.0"),
        ({"end": "501 s"}, "must have windows that end by simulation.duration_s = 500.0"),
        ({"begin": "499 s", "end": "end - 2 s"}, "got 499 s to 498 s"),
        ({"begin": "end - 600 s"}, "must have windows within the run, got end - 600 s"),
    ],
)
def test_requirements_fit_their_scenario(tmp_path, keys, message):
    good = {"begin": "0 s", "end": "end", "signal": "tilt", "unit": "rad"}
    (problem,) = problems_of(THREE_AXIS + REQUIREMENT.format(**good | keys), tmp_path)
    assert problem.key == "requirement.formula"
    assert message in problem.message


def test_windows_do_not_begin_before_a_failure(tmp_path):
    window = {"begin": "failure - 5 s", "end": "end", "signal": "tilt", "unit": "rad"}
    failure = '[[failure]]\nof = "thruster 1"\nat_s = 10\nkind = "dead"\n'
    text = THREE_AXIS + failure + REQUIREMENT.format(**window)
    (message,) = (
        one.message for one in problems_of(text, tmp_path) if one.key == "requirement.formula"
    )
    assert message == "must have windows at the failure or after it, got failure - 5 s"


def test_requirements_have_ids_of_their_own(tmp_path):
    good = {"begin": "0 s", "end": "end", "signal": "tilt", "unit": "rad"}
    (problem,) = problems_of(THREE_AXIS + 2 * REQUIREMENT.format(**good), tmp_path)
    assert 'must differ from that of requirement 1, got "R1"' in problem.message
