"""A flight and a study as results in Python: what they show, draw and write."""

import math

import numpy as np
import pytest

import jaxsat
from jaxsat.report import study_figures

SHORT = ["simulation.duration_s=20", "simulation.save_every_s=0.5"]


@pytest.fixture(scope="module")
def flight():
    return jaxsat.fly(jaxsat.load("paper-rate", SHORT))


def test_a_notebook_shows_the_verdict_and_every_figure(flight):
    text = flight._repr_markdown_()
    title, verdict = text.split("\n\n")[:2]
    assert title == f"#### {flight.scenario.title}"
    assert verdict.startswith("**")
    assert flight.document.verdict.text in repr(flight)
    assert set(flight.figures) >= {"attitude", "pointing", "rates", "torque"}
    for name in flight.figures:
        assert flight.plot(name)._repr_png_().startswith(b"\x89PNG")
    with pytest.raises(jaxsat.ArgumentError, match=r"`name` must be one of attitude, .*got speed"):
        flight.plot("speed")


def test_a_flight_that_does_not_settle_tells_so(flight):
    assert math.isinf(flight.settling_time)
    assert flight.cautions == []


@pytest.mark.slow
def test_a_flight_tells_when_it_settles():
    """By the saved attitudes and rates: the first time after the last beyond the tolerances."""
    whole = jaxsat.fly(jaxsat.load("two-torque-free"))
    run = whole.dataset
    sizes = (
        np.linalg.norm(run[name].values.reshape(len(run.time), -1), axis=1)
        for name in ("w", "z", "relative_rate")
    )
    within = np.all(
        [size < most for size, most in zip(sizes, (0.05, 0.05, 1e-3), strict=True)], axis=0
    )
    last = np.flatnonzero(~within)[-1]
    assert run.time[last] <= whole.settling_time <= run.time[last + 1]


def test_saved_times_too_far_apart_are_told():
    """By the program of `flight`, with other numbers."""
    spin = ["initial.omega_rad_s=[1,0,0]", "simulation.duration_s=240", "simulation.save_every_s=6"]
    (caution,) = jaxsat.fly(jaxsat.load("paper-rate", spin)).cautions
    assert "save_every_s" in caution


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    store = tmp_path_factory.mktemp("study") / "cases.zarr"
    scenario = jaxsat.load("benchmark-three-axis", ["simulation.duration_s=600"])
    jaxsat.run_study(jaxsat.build_study(scenario, 16), store)
    return jaxsat.StudyResults(store)


def test_a_study_shows_and_draws_itself(study):
    assert study.summary.cases == 16
    assert study._repr_markdown_().startswith("#### 16 cases under the law three-axis\n")
    assert "settling time (s)" in str(study)
    for name in study.figures:
        assert study.plot(name)._repr_png_().startswith(b"\x89PNG")
    table = study.to_pandas()
    assert table.shape[0] == 16
    assert table.equals(jaxsat.case_table(jaxsat.open_study(study.path)))


def test_cases_of_an_incomplete_study_are_those_that_are_done(study, monkeypatch):
    """Of 16 cases the first four and one later are not done: what is drawn leaves them out."""
    done = np.arange(16) >= 4
    done[9] = False
    dataset = study.dataset.load().copy(deep=True)
    dataset["status"].values[~done] = 0
    dataset["settling_time"].values[~done] = np.nan
    summary = study.summary._replace(cases=int(done.sum()))
    drawn = {}
    monkeypatch.setattr(study_figures, "convergence", lambda settled, _: drawn.update(it=settled))
    study_figures.stored_drawings(dataset, summary, "a study")["convergence"]()
    expected = np.isfinite(dataset["settling_time"].values[done])
    np.testing.assert_array_equal(drawn["it"], expected)
    assert expected.all()


def test_a_folder_without_a_study_is_refused(tmp_path):
    with pytest.raises(jaxsat.OutputError):
        jaxsat.StudyResults(tmp_path)
