"""Which kind of actuator made which part of a torque, and what came from outside in an orbit."""

import numpy as np
import pytest
import xarray as xr
from scipy.spatial.transform import Rotation

from jaxsat.report.shares import momentum_budget, share_plots, shares_of
from oracle import magnetic

ORBIT = 2e-3
SCENARIO = f"""
[spacecraft]
inertia_kg_m2 = [1.0, 2.0, 3.0]
[orbit]
rate_rad_s = {ORBIT}
[[wheel]]
axis = [0.0, 3.0, 4.0]
[[wheel]]
axis = [1.0, 0.0, 0.0]
"""
JETS = "[[thruster]]\ntorque_axis = [0.0, 0.0, 1.0]\n"


def run(turns, *, push, outside, scenario):
    """A body that turns by any attitudes over whole `turns` of its orbit and half of one.

    Wheels, others (`push`, N m) and torques from `outside` (N m) are constant in inertial axes.
    """
    time = np.linspace(0.0, (turns + 0.5) * 2 * np.pi / ORBIT, 4001)
    rate = np.array([0.0, -ORBIT, 0.0])
    orbit_to_inertial = Rotation.from_rotvec(np.outer(time, rate))
    body_to_orbit = Rotation.from_euler("xyz", np.outer(np.sin(ORBIT * time), [0.4, 1.0, 2.0]))
    body = orbit_to_inertial * body_to_orbit
    wheels = np.stack([np.sin(time), np.cos(2 * time)], 1)
    made = wheels @ [[0.0, 0.6, 0.8], [1.0, 0.0, 0.0]] + body.inv().apply(push)
    relative = np.zeros((len(time), 3))

    def of_body(values):
        return (("time", "body_axis"), values)

    variables = {
        "quaternion": (("time", "q"), np.roll(body_to_orbit.as_quat(), 1, axis=1)),
        "omega": of_body(body_to_orbit.inv().apply(rate)),
        "relative_rate": of_body(relative),
        "torque": of_body(made),
        "disturbance": of_body(body.inv().apply(outside)),
        "wheel_torque": (("time", "wheel"), wheels),
    }
    return xr.Dataset(variables, {"time": time}, {"scenario": scenario})


def test_momentum_from_outside_is_that_of_whole_orbits_in_inertial_axes():
    push, outside = np.array([0.0, 3e-3, 4e-3]), np.array([1e-4, 2e-4, -2e-4])
    orbit = 2 * np.pi / ORBIT
    text = momentum_budget(run(2, push=push, outside=outside, scenario=SCENARIO + JETS))
    by_outside, by_thrusters, span = text.split(", ")
    assert span == "in an orbit"
    assert by_outside.endswith(" N m s by external torques")
    assert by_thrusters.endswith(" N m s by thrusters")
    assert float(by_outside.split()[0]) == pytest.approx(3e-4 * orbit, rel=5e-3)
    assert float(by_thrusters.split()[0]) == pytest.approx(5e-3 * orbit, rel=5e-3)
    short = momentum_budget(run(0, push=push, outside=outside, scenario=SCENARIO))
    assert short.endswith(" N m s by external torques, in all")
    assert float(short.split()[0]) == pytest.approx(3e-4 * orbit / 2, rel=5e-3)


@pytest.mark.parametrize(("angle", "resolved"), [(0.9, True), (2 * np.pi, False)])
def test_waves_that_saved_times_alias_have_no_momentum(angle, resolved):
    """A torque that oscillates once between two saved times looks constant there."""
    step = 0.5 * 2 * np.pi / ORBIT / 4000
    waves = (
        f"[disturbance]\namplitude_N_m = [1.0, 0, 0]\nfrequency_rad_s = [{angle / step}, 0, 0]\n"
    )
    outside = np.array([1e-4, 2e-4, -2e-4])
    found = momentum_budget(run(0, push=0 * outside, outside=outside, scenario=SCENARIO + waves))
    assert ("external torques" in found) == resolved


def test_pulses_between_saved_times_count():
    """The second wheel, with a rotor of 0.5 kg m², makes sin t; the first seizes at 5.5 s."""
    time, rotor = np.arange(11.0), 0.5
    pulses = np.array([0, 0.3, 0, 0, -0.1, 0.2, 0, 0, 0, 0.4, 0])
    means = np.append(-np.diff(np.cos(time)), np.sin(10.0))
    rate, zero = 0.01 * time**2, np.zeros(11)
    momentum = np.stack([np.where(time < 5.5, 2.0, 0.0), np.cos(time) - rotor * rate], 1)

    def of_body(x, z):
        return (("time", "body_axis"), np.stack([x, zero, z], 1))

    made = np.stack([zero, np.sin(time)], 1)
    variables = {
        "quaternion": (("time", "q"), np.tile([1.0, 0.0, 0.0, 0.0], (11, 1))),
        "omega": of_body(rate, zero),
        "relative_rate": of_body(rate, zero),
        "torque": of_body(np.sin(time), zero),
        "torque_mean": of_body(means, pulses),
        "wheel_torque": (("time", "wheel"), made),
        "wheel_momentum": (("time", "wheel"), momentum),
    }
    scenario = SCENARIO.replace(f"{ORBIT}", "0.0") + f"rotor_inertia_kg_m2 = {rotor}\n" + JETS
    dataset = xr.Dataset(variables, {"time": time}, {"scenario": scenario})
    found = shares_of(dataset)
    np.testing.assert_allclose(found["wheels"][:, 0], means, atol=1e-14)
    np.testing.assert_allclose(found["thrusters"], np.outer(pulses, [0, 0, 1]), atol=1e-14)
    assert momentum_budget(dataset) == "0.8 N m s by thrusters, in all"


def test_shares_are_drawn_where_wheels_are_not_alone():
    push = np.array([0.0, 3e-3, 4e-3])
    (plot,) = share_plots(run(1, push=push, outside=0 * push, scenario=SCENARIO + JETS))
    wheels, others = plot.lines
    assert (wheels.label, others.label) == ("wheels", "thrusters")
    np.testing.assert_allclose(others.y, 5e-3, rtol=1e-9)
    np.testing.assert_allclose(wheels.y, np.hypot(np.sin(wheels.x), np.cos(2 * wheels.x)))
    assert not share_plots(run(1, push=push, outside=push, scenario=SCENARIO))


def test_magnetorquers_have_a_share_of_their_own():
    """Beside thrusters theirs is m × B, and thrusters make the rest; alone they make all of it."""
    rods = "[[magnetorquer]]\naxis = [0.0, 0.0, 2.0]\ndipole_limit_A_m2 = 1.0\n"
    push = np.array([0.0, 3e-3, 4e-3])
    both = run(1, push=push, outside=0 * push, scenario=SCENARIO + JETS + rods)
    time = both["time"].values
    both["dipole"] = (("time", "magnetorquer"), 0.3 * np.sin(time)[:, None])
    found = shares_of(both)
    orbit = (ORBIT, 0.0, 0.0, 0.0, 0.0)
    places = [0, 700, 4000]
    turned = Rotation.from_quat(both["quaternion"].values[places], scalar_first=True).inv()
    b = turned.apply([magnetic.field(time[place], orbit) for place in places])
    expected = np.cross([[0.0, 0.0, 0.3 * np.sin(time[place])] for place in places], b)
    np.testing.assert_allclose(found["magnetorquers"][places], expected, rtol=0, atol=1e-12)
    rest = found["thrusters"] + found["magnetorquers"]
    np.testing.assert_allclose(np.linalg.norm(rest, axis=1), 5e-3, rtol=1e-9)
    jets_and_rods = SCENARIO.partition("[[wheel]]")[0] + JETS + rods
    without_wheels = shares_of(both.drop_vars("wheel_torque").assign_attrs(scenario=jets_and_rods))
    assert list(without_wheels) == ["magnetorquers", "thrusters"]
    np.testing.assert_allclose(without_wheels["magnetorquers"], found["magnetorquers"])
    np.testing.assert_allclose(sum(without_wheels.values()), both["torque"], atol=1e-15)
    alone = shares_of(run(1, push=push, outside=0 * push, scenario=SCENARIO + rods))
    assert list(alone) == ["wheels", "magnetorquers"]
    np.testing.assert_allclose(np.linalg.norm(alone["magnetorquers"], axis=1), 5e-3, rtol=1e-9)


def test_magnetorquers_make_all_of_the_rest_while_no_thruster_fires():
    """Their mean torque differs from that at the saved times; a valve opens after 3 and 6 s."""
    time, zero = np.arange(10.0), np.zeros((10, 3))
    rods = np.outer(np.cos(time), [1e-5, -2e-5, 0.0])
    pulses = np.outer(np.isin(time, [3.0, 7.0]), [0.0, 0.0, 0.1])  # the second is delayed

    def of_time(axis, values):
        return (("time", axis), values)

    variables = {
        "quaternion": of_time("q", np.tile([1.0, 0.0, 0.0, 0.0], (10, 1))),
        "omega": of_time("body_axis", zero),
        "relative_rate": of_time("body_axis", zero),
        "torque": of_time("body_axis", zero),
        "torque_mean": of_time("body_axis", rods + pulses),
        "wheel_torque": of_time("wheel", zero[:, :2]),
        "wheel_momentum": of_time("wheel", zero[:, :2]),
        "dipole": of_time("magnetorquer", zero[:, :1]),
        "thrust_level": of_time("thruster", zero[:, :1]),
        "valve_openings": of_time("thruster", 1.0 * (time > 3)[:, None] + (time > 6)[:, None]),
    }
    rod = "[[magnetorquer]]\naxis = [0.0, 0.0, 2.0]\ndipole_limit_A_m2 = 1.0\n"
    found = shares_of(xr.Dataset(variables, {"time": time}, {"scenario": SCENARIO + JETS + rod}))
    fires = np.isin(time, [3.0, 4.0, 6.0, 7.0])
    np.testing.assert_allclose(found["magnetorquers"], np.where(fires[:, None], 0.0, rods))
    rest = np.where(fires[:, None], rods + pulses, 0.0)
    np.testing.assert_allclose(found["thrusters"], rest, atol=1e-20)


def test_thrusters_that_never_fire_have_no_share():
    """What wheels leave of a torque of them alone is round-off, not thrust."""
    time, zero = np.arange(4.0), np.zeros((4, 3))
    momentum = np.stack([67 - 0.1 * time, 33 + 0.3 * time], 1)
    means = -np.diff(momentum, axis=0, append=momentum[-1:]) @ [[0.0, 0.6, 0.8], [1.0, 0.0, 0.0]]
    none = ("time", "thruster"), zero[:, :1]
    variables = {
        "quaternion": (("time", "q"), np.tile([1.0, 0.0, 0.0, 0.0], (4, 1))),
        "omega": (("time", "body_axis"), zero),
        "relative_rate": (("time", "body_axis"), zero),
        "torque_mean": (("time", "body_axis"), means * (1 + 1e-13)),
        "wheel_torque": (("time", "wheel"), zero[:, :2]),
        "wheel_momentum": (("time", "wheel"), momentum),
        "thrust_level": none,
        "valve_openings": none,
    }
    dataset = xr.Dataset(variables, {"time": time}, {"scenario": SCENARIO + JETS})
    assert not shares_of(dataset)["thrusters"].any()
    assert momentum_budget(dataset) == ""
