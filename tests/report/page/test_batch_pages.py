"""The pages of a tuning, a comparison and a reproduction, from files like theirs."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from helpers.pages import SCENARIO, run_dataset
from jaxsat.report.page import batches, report_page
from jaxsat.report.reproduction import Claim, ClaimVerdict
from jaxsat.store.files import OutputError
from jaxsat.store.netcdf import dataset_bytes

pytestmark = pytest.mark.filterwarnings("ignore::jaxsat.store.marker.UnverifiedWarning")
"""The files of these tests are of no folder with a marker."""


def first_sentence(page):
    return re.search(r'<p class="first">(.*?)</p>', page).group(1)


def interval(value):
    return {"value": value, "low": value / 2, "high": None}


def evaluation(loss):
    return {
        "cases": 8,
        "settled": interval(0.5),
        "settling_time": {"50.0": interval(4.0)},
        "cost": interval(2.0),
        "failed": interval(0.0),
        "effort": {},
        "alarming": None,
        "loss": loss,
    }


def receipt_record(problems):
    check = {name: [0.5] for name in ("automatic", "difference", "step", "error")}
    check |= {"cases": 2, "left_out": 0}
    places = dict.fromkeys(("start", "end", "exact_start", "exact_end"), check)
    sizes = ("smoothing_bias", "largest_smoothing_bias", "step_sensitivity")
    counts = ("gradient_samples", "failed", "masked", "bounded")
    return {
        "problems": list(problems),
        "labels": ["k1"],
        "widths": {},
        **places,
        **dict.fromkeys((*sizes, "largest_step_sensitivity"), 0.5),
        **dict.fromkeys(counts, 0),
        "derivative_free": False,
        "first_masked": "",
    }


@pytest.fixture
def tuning(tmp_path):
    """A folder of a tuning, with its losses before and after and what is wrong with gradients."""

    def write(before=3.0, after=2.0, problems=()):
        folder = tmp_path / "tuned"
        folder.mkdir()
        names = ("before", "trained_before", "trained_after")
        verdict = {name: evaluation(before) for name in names} | {"after": evaluation(after)}
        verdict |= {"gains": {"k1": {"before": 0.5, "after": 0.75}}, "at_bounds": {"k1": 0.75}}
        verdict |= {"better": interval(1.0), "overfitting": 0.1, "singular": None}
        (folder / "verdict.json").write_text(json.dumps(verdict))
        (folder / "receipt.json").write_text(json.dumps(receipt_record(problems)))
        (folder / "tuned.toml").write_text('title = "tuned"\n')
        history = xr.Dataset(
            {
                "loss": (("step", "start"), np.ones((4, 2))),
                "gradient_norm": (("step", "start"), np.ones((4, 2))),
                "settled": (("step", "start"), np.ones((4, 2))),
                "gain": (("step", "start", "parameter"), np.ones((4, 2, 1))),
                "validation_settled": (("validation", "start"), np.ones((2, 2))),
                "best_loss": ("validation", [3.0, 2.0]),
                "best_gain": (("validation", "parameter"), [[0.5], [0.75]]),
            },
            {"step": range(4), "start": range(2), "parameter": ["k1"], "validation": [0, 3]},
            {
                "title": "A <b>run</b>",
                "scenario": SCENARIO,
                "parameter_units": ["N m s"],
                "parameter_scales": ["log"],
            },
        )
        (folder / "history.nc").write_bytes(dataset_bytes(history))
        return folder

    return write


def test_a_tuning_says_whether_the_gains_are_better(tuning):
    page = report_page([tuning()])
    told = "The tuned gains are better: the objective on held-out cases goes from 3 to 2."
    assert first_sentence(page) == told
    assert 'class="verdict good"' in page
    assert "Gains are at their bounds: k1 at 0.75." in page
    assert "the objective on held-out cases is 10.0% above" in page.lower()
    assert "<b>run</b>" not in page


def test_gains_of_a_gradient_that_cannot_be_trusted_are_not_good(tuning):
    page = report_page([tuning(problems=["at the start no case reached its end"])])
    assert 'class="verdict bad"' in page
    assert "not trustworthy: at the start no case reached its end." in page


def test_files_of_another_form_are_told(tuning):
    folder = tuning()
    (folder / "verdict.json").write_text("{}")
    with pytest.raises(OutputError, match="numbers of another form"):
        report_page([folder])
    (folder / "receipt.json").write_text("[")
    with pytest.raises(OutputError, match=r"receipt\.json is damaged"):
        report_page([folder])


def test_a_comparison_begins_with_the_law_to_take(tmp_path):
    rows = [
        {
            "level": "hard",
            "torque_limit": 5.0,
            "law": law,
            "cases": 10,
            "settled": interval(0.9),
            "t50": interval(70.0),
            "t90": interval(80.0),
            "effort_N_m_s": 3.0,
            "peak_rate_rad_s": 0.2,
            "paper_start_settled_s": None,
        }
        for law in ("three-slew", "rate")
    ]
    verdict = {"level": "hard", "torque_limit": 5.0, "law": "three-slew", "reason": "it is quick"}
    record = {"command": "jaxsat compare", "seed": 1, "rows": rows, "verdicts": [verdict]}
    (tmp_path / "comparison.json").write_text(json.dumps(record))
    page = report_page([tmp_path])
    assert first_sentence(page) == "hard, 5 N m: the recommended law is three-slew. It is quick."
    assert page.count("<td>hard</td>") == 2


def test_a_reproduction_judges_the_claims_from_its_files(tmp_path, monkeypatch):
    (tmp_path / "verdicts.md").touch()
    (tmp_path / "one.nc").write_bytes(dataset_bytes(run_dataset()))
    judged = []

    def judge(datasets):
        judged.append(float(datasets["one"]["omega"][0, 1]))
        return [
            Claim("Fig. 3", "it settles", "it does", ClaimVerdict.HOLDS),
            Claim("Fig. 4", "it <i>stays</i>", "no", ClaimVerdict.FAILS),
        ]

    monkeypatch.setattr(batches, "RUNS", {"one": SimpleNamespace(purpose="to see")})
    monkeypatch.setattr(batches, "judge", judge)
    page = report_page([tmp_path])
    told = "2 claims of the paper&#39;s section 5. Holds: 1; does not hold: 1."
    assert first_sentence(page) == told
    assert judged == [1.0]
    assert "<i>stays" not in page


@pytest.mark.slow
def test_several_results_go_into_one_page(tuning, run_file):
    page = report_page([tuning(), run_file(run_dataset())])
    assert page.count('<section class="result"') == 2
    assert page.count("<li><a href") == 2


def design_record():
    """What `jaxsat design` records of a law of which too few cases settle."""
    row = {"law": "three-slew", "cases": 10, "settled": interval(0.9), "t50": interval(70.0)}
    row |= {"t90": interval(80.0), "effort_N_m_s": 3.0, "peak_rate_rad_s": 0.2}
    step = {"rows": [row], "taken": "three-slew", "reason": "it is quick"}
    verification = {"cases": 40, "settled": interval(0.9), "failing_cases": list(range(30))}
    verification |= {"settling_time_s": {"50": interval(70.0), "99": {"value": None}}}
    verification |= {"effort_N_m_s": {}, "outcomes": {"settled": 10, "unsettled": 30}}
    verification |= {
        "limit": {"change": "more torque", "settled": 20, "flown": 30, "cause": None},
        "separations": [{"name": "omega", "share": 0.5, "failing": [1] * 3, "settled": [0] * 3}],
        "remedies": [{"change": "twice the <torque>", "settled": 12, "flown": 30}],
    }
    return {
        "outcome": "not reached",
        "headline": "Not reached: three-slew settles 90 %; 99 % were required.",
        "seeds": {"screening": 4, "verification": 7},
        "title": "A run",
        "controllability": {"lines": ["Controllable."], "misses_attitude": None},
        "assumed": ["[orbit]: inertial pointing"],
        "left_out": [],
        "cautions": [],
        "screening": step,
        "validation": None,
        "tuning": {"left_out": "no gains"},
        "chosen": "three-slew",
        "gains": {"k": 0.25, "corners": [1.0, 2.0]},
        "verification": verification,
    }


def test_a_design_begins_with_its_verdict_and_lists_what_fails_and_what_helps(tmp_path):
    (tmp_path / "design.json").write_text(json.dumps(design_record()))
    (tmp_path / "designed.toml").write_text(SCENARIO)
    page = report_page([tmp_path])
    assert first_sentence(page) == "Not reached: three-slew settles 90 %; 99 % were required."
    assert 'class="verdict bad"' in page
    assert ">70 (over 35)</td>" in page
    assert "<code>jaxsat montecarlo designed.toml --seed 7 --case 0</code>" in page
    assert "18, 19 and 10 more, all of them in design.json." in page
    assert "With more torque 20 of 30 settle." in page
    assert "twice the &lt;torque&gt;" in page
    assert "three-slew with k = 0.25, corners = (1, 2)." in page
    (tmp_path / "design.json").write_text('{"outcome": "reached"}')
    with pytest.raises(OutputError, match="numbers of another form"):
        report_page([tmp_path])
