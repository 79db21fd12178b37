"""The page of a study: its numbers, its size, and commands that compute its worst cases again."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from jaxsat.report.page import report_page
from jaxsat.report.page.plots import chart_of
from jaxsat.report.page.study import case_command, scenario_text
from jaxsat.report.study_plots import convergence, settled_by, settling_over, success_over
from jaxsat.scenario import library, read
from jaxsat.store.chunks import Column, Coordinate
from jaxsat.store.dataset import open_trajectory
from jaxsat.store.files import OutputError
from jaxsat.store.store import StudyStore
from jaxsat.store.tables import open_study
from jaxsat.studies.statistics import wilson

IDENTITY = {
    "scenario": {
        "spacecraft": {"inertia_kg_m2": [1.0, 2.0, 2.5], "torque_limit_N_m": None},
        "control": {"law": "no-such-law", "k3": 0.1},
    },
    "seed": 7,
    "size": None,
    "design": "Independent",
    "engine": {"name": "scan", "batch_size": 64},
    "program": {"operations": "f00d"},
}
COLUMNS = {
    "code": Column((), "int8", "1", "outcome"),
    "settling_time": Column((), "float64", "s", "settling time"),
    "effort": Column((), "float64", "N m s", "effort"),
    "cost": Column((), "float64", "1", "cost"),
    "drawn_omega": Column((3,), "float64", "rad s-1", "rates at the start", ("body_axis",)),
}
COORDINATES = {"body_axis": Coordinate(("x", "y", "z"))}


DISPERSION = """
[dispersion.omega_rad_s]
distribution = "uniform"
low = -0.05
high = 0.05
"""


def columns_of(numbers):
    """Cases that settle where the first rate at the start is small; one in a thousand fails."""
    omega = np.array([np.random.default_rng(number).uniform(-1, 1, 3) for number in numbers])
    failed = numbers % 1000 == 999
    settled = (np.abs(omega[:, 0]) < 0.8) & ~failed
    return {
        "code": failed.astype("int8"),
        "settling_time": np.where(
            settled & (numbers % 1000 != 999), 100 + 50 * omega[:, 1], np.inf
        ),
        "effort": 1 + omega[:, 2] ** 2,
        "cost": 1 + omega[:, 0] ** 2,
        "drawn_omega": omega,
    }


def write_store(path, count, chunk=1000, *, write=True):
    with StudyStore(path, IDENTITY, COLUMNS, count, chunk, coordinates=COORDINATES) as store:
        for one in store.pending() if write else ():
            store.write(one, columns_of(store.numbers(one)))
    return path


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    return write_store(tmp_path_factory.mktemp("study") / "mine.zarr", 2000)


@pytest.fixture(scope="module")
def study_page(study):
    return report_page([study])


def test_the_verdict_has_the_settled_fraction_and_how_the_others_ended(study, study_page):
    times = np.asarray(open_study(study)["settling_time"])
    found = wilson(int(np.isfinite(times).sum()), 2000)
    first = re.search(r'<p class="first">(.*?)</p>', study_page).group(1)
    interval = f"95 % interval {found.low:.2%} to {found.high:.2%}"
    assert first == f"{found.value:.2%} of 2,000 cases settle ({interval})."
    assert ", 2 state_limit." in study_page


def test_the_worst_cases_come_first_and_a_command_needs_a_scenario(study_page):
    table = study_page[study_page.index("Worst cases") :]
    numbers = re.findall(r'<tr>\n<td class="number" data-value="(\d+)"', table)[:2]
    assert set(numbers) == {"999", "1999"}
    assert "jaxsat montecarlo" not in study_page, "the law is not known here"


def test_the_command_of_a_case_has_all_that_its_bits_depend_on():
    assert case_command(IDENTITY, 12, 3000) == (
        "jaxsat montecarlo study.toml --seed 7 --count 3000 --engine scan --batch-size 64 --case 12"
    )
    latin = {**IDENTITY, "size": 500, "engine": {"name": "native"}}
    assert "--count 500 --engine native --case" in case_command(latin, 12, 300)


def test_an_empty_store_is_refused(tmp_path):
    write_store(tmp_path / "s", 10, 5, write=False)
    with pytest.raises(OutputError, match="no finished case"):
        report_page([tmp_path / "s"])


def drawn(plot):
    """What Bokeh paints of a plot: points and band."""
    data = chart_of(plot).figure.renderers[0].data_source.data
    return {name.rstrip("0"): np.asarray(column) for name, column in data.items()}


def test_curves_are_the_counts_they_claim_to_be():
    rng = np.random.default_rng(3)
    times = np.where(rng.uniform(size=5000) < 0.9, rng.gamma(3, 20, 5000), np.inf)
    data = drawn(settled_by(times))
    for x, y, low, high in zip(*(data[k][::37] for k in ("x", "y", "low", "high")), strict=True):
        assert wilson(int((times <= x).sum()), 5000) == pytest.approx((y, low, high))
    data = drawn(convergence(np.isfinite(times)))
    assert data["y"][-1] == pytest.approx(np.isfinite(times).mean())
    assert len(data["x"]) <= 400


def test_success_over_a_quantity_finds_where_it_fails():
    values = np.random.default_rng(4).uniform(-1, 1, 20_000)
    settled = values < 0.5
    data = drawn(success_over("omega[1]", values, settled, "rad/s"))
    assert data["y"][data["x"] < 0.4].min() == 1
    assert data["y"][data["x"] > 0.6].max() == 0
    assert success_over("constant", np.ones(100), settled[:100], "1") is None
    times = np.where(settled, 10 + values, np.inf)
    data = drawn(settling_over("omega[1]", values, times, "rad/s"))
    np.testing.assert_allclose(data["y"], 10 + data["x"], atol=1e-9)
    assert settled_by(np.full(10, np.inf)) is None


@pytest.mark.slow
def test_a_study_of_100_000_cases_stays_small(tmp_path):
    page = report_page([write_store(tmp_path / "big.zarr", 100_000, 10_000)])
    assert len(page.encode()) < 12e6


@pytest.mark.slow
def test_the_command_on_the_page_computes_the_same_case_again(tmp_path, monkeypatch):
    from jaxsat.cli import main

    def run(*tokens):
        with pytest.raises(SystemExit) as caught:
            main(list(tokens))
        assert caught.value.code == 0

    monkeypatch.chdir(tmp_path)
    text = library()["paper-rate"].read_text(encoding="utf-8")
    Path("mine.toml").write_text(text + DISPERSION, encoding="utf-8")
    more = ("--set", "simulation.duration_s=5", "--quiet")
    run("montecarlo", "mine.toml", "-n", "8", "--out", "s.zarr", *more)
    page = report_page(["s.zarr"])
    command = re.search(r"<code>(jaxsat montecarlo .*?)</code>", page).group(1)
    study = open_study("s.zarr")
    text = scenario_text(json.loads(study.attrs["identity"])["scenario"], "s")
    (tmp_path / "study.toml").write_text(text)
    assert read(tmp_path / "study.toml").simulation.duration_s == 5
    run(*shlex.split(command)[1:], "--out", "case", "--quiet")
    case = int(command.split()[-1])
    again = open_trajectory("case")
    last = np.flatnonzero(np.isfinite(again["omega"]).all("body_axis"))[-1]
    np.testing.assert_allclose(again["omega"][last], study["omega"][case], rtol=1e-9)
