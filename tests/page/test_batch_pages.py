"""The pages of a tuning, a comparison and a reproduction, from files like theirs."""

import json
import re
from types import SimpleNamespace

import numpy as np
import pytest
import xarray as xr

from helpers.pages import SCENARIO, run_dataset
from jaxsat.page import batches, report_page
from jaxsat.reproduction import Claim, ClaimVerdict
from jaxsat.results import OutputError, dataset_bytes


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
        "loss": loss,
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
        (folder / "verdict.json").write_text(json.dumps(verdict))
        (folder / "receipt.json").write_text(json.dumps({"problems": list(problems)}))
        (folder / "tuned.toml").write_text('title = "tuned"\n')
        history = xr.Dataset(
            {
                "loss": (("step", "start"), np.ones((4, 2))),
                "best_loss": ("validation", [3.0, 2.0]),
                "best_gain": (("validation", "parameter"), [[0.5], [0.75]]),
            },
            {"step": range(4), "start": range(2), "parameter": ["k1"], "validation": [0, 3]},
            {"title": "A <b>run</b>", "scenario": SCENARIO, "parameter_units": ["N m s"]},
        )
        (folder / "history.nc").write_bytes(dataset_bytes(history))
        return folder

    return write


def test_a_tuning_says_whether_the_gains_are_better(tuning):
    page = report_page([tuning()])
    told = "The tuned gains are better: the objective on held-out cases goes from 3 to 2."
    assert first_sentence(page) == told
    assert 'class="verdict good"' in page
    assert "k1 is at its bound, 0.75." in page
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
    assert first_sentence(page) == "hard, 5 N m: take three-slew; it is quick."
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
    told = "Of 2 claims of the paper&#39;s section 5: 1 holds, 1 does not hold."
    assert first_sentence(page) == told
    assert judged == [1.0]
    assert "<i>stays" not in page


def test_several_results_go_into_one_page(tuning, run_file):
    page = report_page([tuning(), run_file(run_dataset())])
    assert page.count('<section class="result"') == 2
    assert page.count("<li><a href") == 2
