"""The requirements of a run in its document."""

import math

import numpy as np
import xarray as xr

from jaxsat.report.requirements import judgements, requirement_table

SCENARIO = """
[orbit]
rate_rad_s = 0.001
[disturbance]
sun_direction = [1.0, 0.0, 0.0]
[[failure]]
of = "thruster 1"
at_s = 4.0
kind = "dead"
[[requirement]]
id = "rate"
text = "It turns slowly."
formula = "within 2 s of failure rate < 3 rad/s"
[[requirement]]
id = "propellant"
formula = "always propellant < 2 g"
[[requirement]]
id = "later"
formula = "always[failure + 1 h, end] rate < 1 rad/s"
[[requirement]]
id = "sun"
formula = "always[0 s, 0 s] sun_angle(0, 0, 1) > 30 deg"
"""


def dataset(**attributes):
    times = np.arange(11.0)
    return xr.Dataset(
        {
            "omega": (("time", "body_axis"), np.outer(10 - times, [0.0, 1.0, 0.0])),
            "propellant": ("time", times / 2000),
            "quaternion": (("time", "quaternion_component"), np.eye(4)[np.zeros(11, int)]),
        },
        {"time": times},
        {"scenario": SCENARIO, **attributes},
    )


def test_each_requirement_has_its_margin_in_its_unit():
    rate, propellant, later, sun = judgements(dataset())
    assert (rate.margin, rate.unit, rate.time, rate.met) == (-1.0, "rad/s", 6.0, False)
    assert rate.text == "It turns slowly."
    assert math.isclose(propellant.margin, -3.0)
    assert (propellant.unit, propellant.time) == ("g", 10.0)
    assert (later.margin, later.met) == (math.inf, True)
    assert math.isclose(sun.margin, 150.0)  # it starts between the Earth and the Sun
    rows = requirement_table([rate, propellant, later, sun]).rows
    assert [str(getattr(row[3], "text", "")) for row in rows] == [
        "no", "no", "yes: nothing to judge", "yes",
    ]  # fmt: skip


def test_what_a_run_does_not_tell_is_not_met():
    (_, propellant, *_) = judgements(dataset().drop_vars("propellant"))
    assert math.isnan(propellant.margin)
    assert not propellant.met


def test_failures_strike_a_case_when_they_were_drawn():
    rate = judgements(dataset(drawn_failure_time=[7.0]))[0]
    assert (rate.margin, rate.time) == (2.0, 9.0)
