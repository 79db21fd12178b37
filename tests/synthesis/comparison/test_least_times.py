"""Least times of the acceptance set: that they can be, and what is divided by them."""

import json
from importlib import resources

import jax
import numpy as np
import pytest

from jaxsat.core.ranges import SETTLED_RATE
from jaxsat.report.comparison_document import comparison_document
from jaxsat.synthesis.comparison.acceptance import ComparisonSetting, Start, comparison_study
from jaxsat.synthesis.comparison.least_times import least_times, median_least_time
from jaxsat.synthesis.comparison.verdict import comparison_row

MOMENTS, ORBIT_RATE = np.array([449.5, 264.6, 312.5]), 0.0011
DISTURBANCE = np.sum([0.01, 0.02, 0.001])
"""N m, at most."""

TABLES = json.loads(
    (resources.files("jaxsat.synthesis.comparison") / "least_times.json").read_text()
)


def test_a_median_is_that_of_the_first_starts():
    wanted = {"torque_limit_N_m": 5.0, "seed": 0, "end": "settled"}
    table = next(one for one in TABLES if wanted.items() <= one.items())
    assert median_least_time(0, 5.0, 3) == np.median(table["least_times_s"][:3])
    assert median_least_time(0, 5.0, 3) < median_least_time(0, 5.0, 3, "rest")
    assert median_least_time(0, 5.0, len(table["least_times_s"]) + 1) is None
    assert median_least_time(0, 4.0, 3) is None
    assert median_least_time(999, 5.0, 3) is None


def row(level, law, limit, time):
    columns = {"settling_time": np.full(3, time), "effort": np.ones(3), "peak_rate": np.ones(3)}
    return comparison_row(ComparisonSetting(level, limit, law), columns)


def table_of(rows, least):
    found = {"torque_limit": least.torque_limit, "end": least.end, "seconds": least.median}
    data = [row.as_data() for row in rows]
    document = comparison_document({"rows": data, "verdicts": [], "median_least_times": [found]})
    return document.blocks[0]


def test_laws_are_judged_by_the_least_times_of_their_starts():
    median = median_least_time(0, 20.0, 3)
    assert median is not None
    rows = [row("hard", "a", 20.0, 2 * median), row("mc", "b", 20.0, np.inf)]
    rows.append(row("hard", "a", 7.0, 1.0))  # of this limit nothing is stored
    (found,) = least_times(rows, 0)
    assert found.torque_limit == 20.0
    laws = table_of(rows, found)
    assert [line[-1] for line in laws.rows] == [pytest.approx(2.0), None, None]
    assert f"until settled: {median:.1f} s" in laws.note
    assert least_times(rows, 999) == []
    (found,) = least_times(rows, 0, "rest")
    laws = table_of(rows, found)
    assert "least time" not in " ".join(laws.columns)  # no law comes to rest
    assert "until exact rest" in laws.note


@pytest.mark.slow
@pytest.mark.parametrize("seed", sorted({table["seed"] for table in TABLES}))
@pytest.mark.parametrize("end", ["settled", "rest"])
def test_no_time_is_less_than_the_momentum_takes(seed, end):
    """Two thrusters at right angles take at most √2 limit from |H| in a second, and a disturbance
    some; and four times the torque takes half the time, but for the disturbance and the orbit."""
    study = comparison_study(
        ComparisonSetting("nominal", 5.0, "three-slew"), Start.RANDOM, 200, seed
    )
    cases = study.cases(np.arange(200))
    omega = np.asarray(jax.vmap(lambda case: study.case_factory(case).start.omega)(cases))
    momentum = np.linalg.norm(MOMENTS * omega, axis=1) - MOMENTS.max() * ORBIT_RATE
    momentum -= MOMENTS.max() * SETTLED_RATE if end == "settled" else 0.0
    times = {}
    for table in TABLES:
        if table["seed"] == seed and table["end"] == end:
            limit = table["torque_limit_N_m"]
            found = np.array(table["least_times_s"], float)
            assert np.isfinite(found).sum() >= 199
            known = found[np.isfinite(found)]
            least = momentum / (np.sqrt(2) * limit + DISTURBANCE)
            assert np.all(known > least[np.isfinite(found)])
            times[limit] = found
    both = np.isfinite(times[1.0]) & np.isfinite(times[20.0])
    assert np.all(times[1.0][both] > times[5.0][both])
    assert np.all(times[5.0][both] > times[20.0][both])


@pytest.mark.parametrize("place", range(len(TABLES) // 2, len(TABLES)))
def test_rest_takes_longer_than_to_settle(place):
    """What comes to rest settles on the way; both are local optima."""
    settled = TABLES[place]
    same = {key: settled[key] for key in ("seed", "torque_limit_N_m")} | {"end": "rest"}
    rest = next(one for one in TABLES if same.items() <= one.items())
    pairs = np.array([settled["least_times_s"], rest["least_times_s"]], float)
    ratios = pairs[0] / pairs[1]
    assert settled["end"] == "settled"
    assert np.nanmedian(ratios) < 0.99
    assert np.nanmax(ratios) <= 1
