"""The phases of a run in which a thruster fails, and the figure of them."""

import numpy as np
import xarray as xr

from jaxsat.report.figures import failure_figure, phases

SCENARIO = """
[[failure]]
of = "thruster b"
at_s = 30.0
kind = "dead"
[[thruster]]
name = "a"
[[thruster]]
name = "b"
"""


def run(settled):
    time = np.arange(101.0)
    kinds = np.where((time[:, None] >= 41) & (np.arange(2) == 1), 0.0, -1.0)
    mode = np.where((time >= 40) & (time < 41), 1, 0)
    attributes = {"flag_values": np.array([0.0, 1.0]), "flag_meanings": "three_axes alarm"}
    variables = {
        "pointing_error_total": ("time", np.full(101, 73.7)),
        "diagnosed_kind": (("time", "thruster"), kinds),
        "detection_statistic": (("time", "thruster"), np.zeros((101, 2))),
        "mode": ("time", mode, attributes),
        "settled_from": settled,
    }
    return xr.Dataset(
        variables, {"time": time, "thruster": ["a", "b"]}, {"scenario": SCENARIO, "title": "Story"}
    )


def test_phases_are_divided_by_failure_isolation_and_settling():
    spans = {name: np.flatnonzero(there) for name, there in phases(run(70.0)).items()}
    assert {name: (span[0], span[-1], len(span)) for name, span in spans.items()} == {
        "failed, not known": (30, 40, 11),
        "settling by what is left": (41, 69, 29),
        "settled": (70, 100, 31),
    }
    assert list(phases(run(np.inf))) == ["failed, not known", "settling by what is left"]
    assert list(phases(run(10.0))) == ["failed, not known", "flying by what is left"]


def test_rods_that_take_an_axis_are_named_beside_the_wheels_left():
    made = run(np.inf).rename(thruster="wheel")
    made.attrs["scenario"] = SCENARIO.replace("thruster", "wheel")
    assert [*phases(made)][-1] == "settling by 1 wheel"
    after = made["mode"].where(made["time"] < 42, 2)
    meanings = {"flag_values": np.arange(3.0), "flag_meanings": "three_axes alarm rods"}
    assert [*phases(made.assign(mode=after.assign_attrs(meanings)))][-1].endswith(" and rods")


def test_the_figure_names_what_happened_and_is_left_out_where_nothing_fails():
    made = failure_figure(run(70.0))
    texts = " ".join(text.get_text() for panel in made.axes for text in panel.texts)
    for part in ("thruster b dead, 30 s", "alarm, 40 s", "thruster b: isolated as dead, 41 s"):
        assert part in texts
    legend = made.axes[0].get_legend()
    assert [text.get_text() for text in legend.get_texts()] == [*phases(run(70.0))]
    assert failure_figure(run(70.0).assign_attrs(scenario="")) is None
    assert failure_figure(run(70.0).drop_vars("detection_statistic")) is None
