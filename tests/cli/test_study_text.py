"""What is printed of a study, from columns made by hand."""

import numpy as np
import xarray as xr

from jaxsat.cli.study_text import progress_text, summary_lines
from jaxsat.cli.summary import propellant_row
from jaxsat.scenario.build.load import load
from jaxsat.studies import StudyProgress, summarise


def lines(cost, settling_time=None, more=None, **drawn):
    count = len(cost)
    times = np.linspace(10.0, 20.0, count) if settling_time is None else settling_time
    columns = {
        "code": np.zeros(count, np.int8),
        "settling_time": times,
        "effort": np.linspace(1.0, 2.0, count),
        "cost": cost,
        **(more or {}),
        **{f"drawn_{name}": values for name, values in drawn.items()},
    }
    return summary_lines(summarise(columns))


def test_percentiles_that_need_more_cases_have_an_open_end():
    (found,) = (line for line in lines(np.ones(25)) if line.startswith("settling time"))
    assert "99 %: 19.9 (over 19.17) s, of those that settle" in found
    assert "50 %: 15 (12.92 to 17.08)" in found


def test_what_actuators_used_is_told_where_there_are_some():
    """Openings of all valves together, and of the wheels the one with the largest momentum."""
    used = {
        "propellant": np.linspace(0.01, 0.03, 25),
        "valve_openings": np.arange(50.0).reshape(25, 2),
        "peak_wheel_momentum": np.stack([np.full(25, 4.0), np.linspace(1, 3, 25)], axis=1),
    }
    text = lines(np.ones(25), more=used)
    assert text[4].startswith("propellant       50 %: 0.02 (")
    assert text[4].endswith(" kg, of those that end")
    assert text[5].startswith("valve openings   50 %: 49 (")
    assert text[6].startswith("wheel momentum   50 %: 4 (4 to 4)")
    assert len(text) == len(lines(np.ones(25))) + 3


def test_only_what_matters_is_listed_and_noise_is_said_to_be():
    rng = np.random.default_rng(0)
    x, q = rng.random((200, 3)), rng.normal(size=(200, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    angle = 2 * np.arccos(np.abs(q[:, 0]))
    text = lines(angle + 0.1 * rng.random(200), omega=x, attitude=q)
    start = text.index(
        "sensitivity of the cost: first-order index and rank correlation (95 % intervals)"
    )
    assert text[start + 1].startswith("  attitude[angle] ")
    assert len(text) == start + 2  # nothing about settling, as all cases settle
    text = lines(rng.random(200), omega=x)
    assert text[-1].endswith("no significant dependence with this number of cases")


def test_progress_never_says_that_no_time_is_left():
    """An estimate below half a second would read "0 s left" until the last chunk is done."""
    text = progress_text(StudyProgress(done=9_999, count=10_000, settled=9_999, rate=5.0))
    assert "finishing" in text
    assert "0 s left" not in text
    assert "9 s left" in progress_text(StudyProgress(done=1, count=10, settled=1, rate=1.0))


def test_a_run_tells_its_propellant_where_a_specific_impulse_is_known():
    dataset = xr.Dataset({"propellant": ("time", [0.0, 0.012345, np.nan])})
    known = load("pulsed-two-torque", purpose="text")
    none = [one.model_copy(update={"specific_impulse_s": None}) for one in known.thruster]
    without = known.model_copy(update={"thruster": tuple(none)})
    assert propellant_row(dataset, known) == {"propellant": "0.01235 kg"}
    assert propellant_row(dataset, without) == {}
    assert propellant_row(dataset.drop_vars("propellant"), known) == {}
