"""What actuators cannot do is told before a run: closed forms, a linear programme, a flight."""

import warnings

import numpy as np
import pytest
from scipy.integrate import solve_ivp
from scipy.optimize import linprog, lsq_linear
from scipy.spatial.transform import Rotation

from jaxsat.core.attitude import Quaternion
from jaxsat.scenario import ScenarioWarning
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.idle_actuators import columns_in_use
from jaxsat.scenario.tables import InitialTable
from jaxsat.scenario.wheel_loads import _body_axes, _momenta_to_hold, largest_load

WHEELS = [[1, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1]]


def told(name, *changes):
    """What is told of a scenario with these changes, and the scenario."""
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ScenarioWarning)
        scenario = load(name, changes)
    return [str(one.message) for one in caught], scenario


def wheels(momentum, limit=20.0):
    tables = (
        f"{{axis={axis}, torque_limit_N_m=0.4, momentum_limit_N_m_s={limit}, "
        f"momentum_N_m_s={part}}}"
        for axis, part in zip(WHEELS, momentum, strict=True)
    )
    return f"wheel=[{', '.join(tables)}]"


OWN = ("failure=[]", "control.law='quaternion-feedback'", "control.natural_frequency_rad_s=0.02")


def test_library_scenarios_are_told_nothing_of_actuators():
    for name in ("cubesat-12u", "failures-12u", "thruster-dies", "wheels-fail"):
        assert not told(name)[0]


@pytest.mark.parametrize(
    ("name", "axes", "row", "law"),
    [
        ("two-torque-free", "[1,0,0]", "[0,1,0]", "three-slew"),
        ("free-third-rate", "[0,1,0]", "[1,0,0]", "three-axis"),
        ("paper-rate", "[1,0,0]", "[0,1,0]", "rate"),  # ends at 7 rad/s
        ("two-torque-free", "[1,0,0]", "[1,0,0],[0,1,0]", None),  # never used, as the next
        ("two-torque-free", "[1,0,0]},{axis=[-1,0,0]", "[1,0,0],[0.6,0.8,0]", None),
        ("two-torque-free", "[0,0,1]", "[1,0,0],[0,1,0]", None),
        ("two-torque-free", "[1,0,0],failed=true", "[1,0,0],[0,1,0]", None),
        ("paper-rate", "[1,0,0]},{axis=[1,1,0]", "[0,1,0]", None),  # both torques
    ],
)
def test_wheels_for_a_part_of_two_torques_are_told_of(name, axes, row, law):
    changes = f"wheel=[{{axis={axes}}}]", f"spacecraft.thruster_torque_axes=[{row}]"
    messages, _ = told(name, *changes, "spacecraft.failed_thrusters=[]")
    texts = [text for text in messages if "both torques" in text]
    assert len(texts) == (law is not None)
    assert all(f'both torques that the law "{law}" commands' in text for text in texts)
    idle = law is None and name == "two-torque-free" and "failed" not in axes
    assert any("key wheel: should each have a part" in text for text in messages) == idle


@pytest.mark.parametrize("seed", range(20))
def test_wheels_hold_what_a_linear_programme_holds(seed):
    """1 / share is the largest multiple of a momentum that wheels within their limits make."""
    rng = np.random.default_rng(seed)
    count = rng.integers(3, 7)
    axes = rng.normal(size=(3, count))
    axes /= np.linalg.norm(axes, axis=0)
    limit, momentum = rng.uniform(1, 30, count), rng.normal(size=3)
    most = linprog(
        [0.0] * count + [-1.0],
        A_eq=np.column_stack([axes, -momentum]),
        b_eq=np.zeros(3),
        bounds=[*zip(-limit, limit, strict=True), (0, None)],
    ).x[-1]
    assert largest_load(axes, -limit, limit, momentum)[0] == pytest.approx(1 / most, rel=1e-9)


def test_wheels_in_a_plane_hold_nothing_across_it():
    share, direction = largest_load(
        np.eye(3)[:, :2], -np.ones(2), np.ones(2), np.array([0.1, 0.1, 0.5])
    )
    assert share > 1e6
    np.testing.assert_allclose(np.abs(direction), [0, 0, 1])


def test_the_start_is_that_of_either_form():
    x, y, z, w = Rotation.from_rotvec([0.4, -0.7, 1.1]).as_quat()
    quaternion = Quaternion(np.array([w, x, y, z]))
    wz, right = quaternion.as_wz(), quaternion.as_dcm().matrix
    for start in (
        InitialTable(quaternion=(w, x, y, z), omega_rad_s=(0, 0, 0)),
        InitialTable(w=tuple(map(float, wz.w)), z_rad=float(wz.z), omega_rad_s=(0, 0, 0)),
    ):
        np.testing.assert_allclose(_body_axes(start), right, atol=1e-12)


def test_momentum_is_that_of_the_start_in_axes_of_the_orbit():
    rotation, rate = Rotation.from_rotvec([0.4, -0.7, 1.1]), [0.01, -0.02, 0.03]
    x, y, z, w = rotation.as_quat()
    start = (
        f"initial.quaternion={[float(part) for part in (w, x, y, z)]}",
        f"initial.omega_rad_s={rate}",
    )
    _, scenario = told("wheels-fail", *start, wheels([1, 2, 3, 4]), *OWN)
    axes = np.array(WHEELS, float).T / np.sqrt(2)
    whole = np.diag([420.0, 380.0, 250.0]) @ rate + axes @ [1, 2, 3, 4]
    _, (found,) = _momenta_to_hold(scenario)
    np.testing.assert_allclose(found, rotation.apply(whole), rtol=1e-9)


def test_momentum_in_orbit_is_that_of_every_phase():
    """The frame turns about -y: what is along x at first is along ±z a quarter later."""
    changes = (
        "orbit.rate_rad_s=0.001",
        "simulation.duration_s=6300",
        "initial.quaternion=[1,0,0,0]",
        "initial.omega_rad_s=[0.01,-0.001,0]",
    )
    _, scenario = told("wheels-fail", *changes, wheels([0, 0, 0, 0]), *OWN)
    times, found = _momenta_to_hold(scenario)
    turn = 0.001 * times[6]
    np.testing.assert_allclose(np.hypot(found[:, 0], found[:, 2]), 4.2, rtol=1e-9)
    expected = [4.2 * np.cos(turn), 0, -4.2 * np.sin(turn)]
    np.testing.assert_allclose(found[6], expected, atol=1e-9)
    np.testing.assert_allclose(found[:, 1], 0, atol=1e-12)  # the rate of the orbit is kept


def test_too_much_momentum_is_told():
    message = "1.2 times what they hold"
    # Along z all four wheels hold 20 N m s each: 4 · 20 / √2 = 56.6.
    fast = f"initial.omega_rad_s=[0,0,{1.2 * 80 / np.sqrt(2) / 250}]"
    still = "initial.quaternion=[1,0,0,0]"
    assert any(message in one for one in told("wheels-fail", still, fast, *OWN)[0])
    two = [f"{{axis={axis}, momentum_limit_N_m_s=20}}" for axis in ([1, 0, 0], [0, 1, 0])]
    messages, _ = told("switching", f"wheel=[{', '.join(two)}]")
    assert any("where they hold none" in one for one in messages)
    slow = f"initial.omega_rad_s=[0,0,{0.9 * 80 / np.sqrt(2) / 250}]"
    assert not told("wheels-fail", still, slow, *OWN)[0]


def test_momentum_at_the_start_is_told_beside_magnetorquers_too():
    """They take it out in time, and so they do with what comes later."""
    rods = "magnetorquer=[{axis=[1,0,0],dipole_limit_A_m2=5}]"
    orbit = "orbit={altitude_km=600,inclination_rad=1.7}"
    start = ("initial.quaternion=[1,0,0,0]", orbit, rods, *OWN)
    for factor, told_of in ((1.2, True), (0.9, False)):
        fast = f"initial.omega_rad_s=[0,0,{factor * 80 / np.sqrt(2) / 250}]"
        messages, _ = told("wheels-fail", fast, *start)
        assert any("times what they hold" in one for one in messages) is told_of
    pushed = "disturbance.constant_N_m=[0,0,0.05]"
    assert not any("full after" in one for one in told("wheels-fail", pushed, *start)[0])


def test_wheels_that_a_constant_torque_fills_are_told_with_the_time():
    """Along z all four hold 56.6 N m s; a torque fixed in the body turns with it in orbit."""
    still = ("initial.quaternion=[1,0,0,0]", "initial.omega_rad_s=[0,0,0]")
    pushed = "disturbance.constant_N_m=[0,0,0.05]"
    (message,) = told("wheels-fail", *still, pushed, *OWN)[0]
    assert f"full after {4 * 20 / np.sqrt(2) / 0.05:.4g} s, counting constant_N_m" in message
    assert not told("wheels-fail", *still, pushed.replace("0.05", "0.045"), *OWN)[0]
    orbit = ("orbit.rate_rad_s=0.001", "disturbance.constant_N_m=[0.01,0.02,0.03]")
    start = ("initial.quaternion=[1,0,0,0]", "initial.omega_rad_s=[0,-0.001,0]")
    _, scenario = told("wheels-fail", *start, *orbit, wheels([0, 0, 0, 0]), *OWN)
    times, found = _momenta_to_hold(scenario)
    force, rate = np.array([0.01, 0.02, 0.03]), np.array([0, -0.001, 0])
    change = solve_ivp(
        lambda t, h: force - np.cross(rate, h), (0, times[-1]), [0, 0, 0], rtol=1e-10, atol=1e-10
    )
    np.testing.assert_allclose(found[-1], change.y[:, -1], atol=1e-6)


JET = "{torque_axis=%s, torque_N_m=0.01, min_on_time_s=0.02}"
JETS = [
    JET % (sign * np.eye(3)[axis]).astype(int).tolist() for axis in range(3) for sign in (1, -1)
]


def test_thrusters_that_never_fire_are_told():
    """Of two torques wheels make all; of three, thrusters make what wheels lack."""
    jets = f"thruster=[{', '.join(JETS)}]"
    two = "wheel=[{axis=[1,0,0], torque_limit_N_m=0.4}, {axis=[0,1,0], torque_limit_N_m=0.4}]"
    assert any("ever fires" in one for one in told("pulsed-two-torque", two)[0])
    for more in ((), (two,)):
        assert not any("fires" in one for one in told("wheels-fail", jets, *more, *OWN)[0])


def thrusters(*axes):
    return f"thruster=[{', '.join(JET % list(axis) for axis in axes)}]"


def test_wheels_that_thrusters_cannot_empty_are_told():
    """Thrusters that push to +z alone: a constant torque along z fills wheels, one along -z does
    not, and in orbit the frame turns all of it where they push."""
    still = ("initial.quaternion=[1,0,0,0]", "initial.omega_rad_s=[0,0,0]")
    one_way = thrusters((1, 0, 0.2), (-1, 0, 0.2), (0, 1, 0.2), (0, -1, 0.2))
    for torque, rate, more, told_of in (
        (0.05, 0.0, (one_way,), True),
        (-0.05, 0.0, (one_way,), False),
        (0.05, 1e-3, (one_way,), False),
        (0.05, 1e-3, (), True),
        (0.05, 0.0, (f"thruster=[{', '.join(JETS)}]",), False),
    ):
        pushed = f"disturbance.constant_N_m=[0,0,{torque}]"
        orbit = (f"orbit.rate_rad_s={rate}", "simulation.duration_s=3000")
        texts = told("wheels-fail", *still, pushed, *orbit, *more, *OWN)[0]
        texts = [one for one in texts if "full after" in one]
        assert len(texts) == told_of
        if told_of and more:
            assert "thrusters take none of it out" in texts[0]
            assert f"full after {4 * 20 / np.sqrt(2) / 0.05:.4g} s" in texts[0]


WHEEL = "{axis=%s, torque_limit_N_m=0.4}"
SWITCHING = (
    "control={law='switching', k1=0.5, k2=0.3, k3=0.05, mu=0.5, a=0.2, k4=60.0, period_s=0.1, "
    "internal_model_frequency_rad_s=[0.7,0.8], upper_threshold_rad_s=8e-3, "
    "lower_threshold_rad_s=1.4e-3, rate_slope_limit_rad_s2=[0.1,0.1], "
    "three_axis_slope_limit_rad_s2=[0.1,0.1]}"
)
IN_PLANE = [(1, 0, 0), (-1, 0, 0), (0, 1, 0), (0, -1, 0)]


@pytest.mark.parametrize(
    ("changes", "idle"),
    [
        ((thrusters(*IN_PLANE, (0, 0, 1)),), ["thruster: 5"]),
        ((thrusters(*IN_PLANE, (0, 0, 1), (0, 0, -1)),), ["thruster: 5, 6"]),  # only cancel
        ((thrusters(*IN_PLANE, (0, 0, 1), (1, 0, -1)),), []),
        ((thrusters(*IN_PLANE), SWITCHING, "wheel=[{axis=[1,0,0]}]"), ["wheel: 1"]),
        ((thrusters(*IN_PLANE), SWITCHING, "wheel=[{axis=[0,0,1]}]"), ["wheel: 1"]),
        ((f"wheel=[{WHEEL % [1, 0, 0]}, {WHEEL % [0, 1, 1]}, {WHEEL % [0, 0, 1]}]",), []),
    ],
)
def test_actuators_without_a_part_in_two_torques_are_told(changes, idle):
    messages, _ = told("pulsed-two-torque", *changes)
    found = [one.split("key ")[1] for one in messages if "never used" in one]
    assert [f"{one.split(':')[0]}: {one.rpartition(': ')[2]}" for one in found] == idle


X_Y_Z = "spacecraft.thruster_torque_axes=[[1,0,0],[0,1,0],[0,0,1]]"
TURN = "control.law='quaternion-feedback'", "control.natural_frequency_rad_s=0.02"


@pytest.mark.parametrize(
    ("changes", "idle"),
    [
        ((X_Y_Z, "spacecraft.failed_thrusters=[]"), "3"),
        ((X_Y_Z.replace("[0,0,1]", "[0.6,0.8,0]"), "spacecraft.failed_thrusters=[]"), ""),
        ((X_Y_Z, "spacecraft.failed_thrusters=[2]", "wheel=[{axis=[0,1,0]}]"), "3"),
        ((X_Y_Z, "wheel=[{axis=[1,0,0]}, {axis=[0,1,0]}]"), "1, 2"),
        ((X_Y_Z, "spacecraft.failed_thrusters=[]", *TURN), ""),
        ((X_Y_Z, "spacecraft.failed_thrusters=[]", "wheel=[{axis=[0,0,1]}]", *TURN), "3"),
        (
            (
                X_Y_Z,
                f"wheel=[{WHEEL % [1, 0, 1]}, {WHEEL % [0, 1, 0]}, {WHEEL % [0, 0, 1]}]",
                *TURN,
            ),
            "1, 2",
        ),
    ],
)
def test_ideal_thrusters_without_a_part_are_told(changes, idle):
    """Two of three ideal thrusters, along body axes, are left in the scenario."""
    messages, _ = told("switching", *changes)
    found = [one.rpartition(": ")[2] for one in messages if "thruster_torque_axes: should" in one]
    assert found == ([idle] if idle else [])


@pytest.mark.parametrize("seed", range(6))
@pytest.mark.parametrize("torques", [1, 2])
def test_linear_programmes_use_every_column_in_use_and_no_other(seed, torques):
    """Of torques in the commanded plane, of both signs, with bounds and prices at random."""
    rng = np.random.default_rng(seed)
    columns = rng.integers(-1, 2, (3, 7)).astype(float)
    columns = columns[:, columns.any(axis=0)]
    command = np.eye(3)[:, :torques]
    used = np.zeros(columns.shape[1], bool)
    for _ in range(150):
        direction = command @ rng.choice([-1.0, 0.0, 1.0, 0.5], torques)
        cost, most = 10.0 ** rng.uniform(-3, 3, used.size), 10.0 ** rng.uniform(-1, 2, used.size)
        bounds = [(0, one) for one in most]
        found = linprog(cost, A_eq=columns, b_eq=direction, bounds=bounds)
        if found.status == 0:
            used |= found.x > 1e-9
    np.testing.assert_array_equal(columns_in_use(columns, command), used)


def test_slow_thrust_and_slow_samples_are_told():
    slow = f"thruster=[{', '.join(JETS)}]".replace("0.02}", "0.02, rise_time_s=0.03}")
    assert sum("ends before full thrust" in one for one in told("cubesat-12u", slow)[0]) == 6
    quick = "control.natural_frequency_rad_s=6", "control.damping=1"
    assert any("= 0.08333 s" in one for one in told("cubesat-12u", *quick)[0])


def flown(kind, angle, rate=1.0):
    """How often valves opened in 30 s from an error of attitude (rad) about the first axis."""
    changes = [
        "spacecraft.inertia_kg_m2=[0.3,0.55,0.62]",
        f"thruster=[{', '.join(JETS)}]",
        "orbit={rate_rad_s=0}",
        "disturbance={}",
        "sampling={}",
        f"initial.quaternion=[{np.cos(angle / 2)},{np.sin(angle / 2)},0,0]",
        "control.natural_frequency_rad_s=0.3",
        "control.period_s=0.1",
        f"control.max_rate_rad_s={rate}",
        "simulation.duration_s=30",
        *([] if kind is None else [f"modulation.kind={kind!r}"]),
    ]
    messages, scenario = told("cubesat-12u", *changes)
    if kind is None:
        scenario = scenario.model_copy(update={"modulation": None})
    run = build(scenario).simulate()
    return messages, np.asarray(run.signals.parts["thrust_level"]).any()


@pytest.mark.slow
def test_no_thruster_fires_in_the_dead_zone_of_pulse_width():
    """A duty of 0.2, the shortest pulse of 0.02 s in 0.1 s, is asked for by 0.2 T / (J ω²)."""
    idle = 0.2 * 0.01 / (0.3 * 0.3**2)
    messages, fired = flown("pwm", 0.99 * idle)
    assert not fired
    assert any(f"none fires below {np.degrees(idle):.3g} degrees" in one for one in messages)
    assert flown("pwm", 1.01 * idle)[1]
    messages, fired = flown("pwm", 3.0, rate=0.9 * 0.3 * idle / 2)
    assert not fired
    assert any("none fires at any error" in one for one in messages)
    messages, fired = flown(None, 0.1 * idle)  # by default what is left is kept
    assert fired
    assert not any("fires" in one for one in messages)


@pytest.mark.parametrize(
    ("wheels", "inertia", "part"),
    [
        ([], 0.3, 1),
        ([[1, 0, 0], [0, 0, 1]], 0.55, 1),
        ([[1, 0, 1], [0, 1, 0]], (0.3 + 0.62) / 2, np.sqrt(0.5)),
    ],
)
def test_pulses_too_coarse_to_settle_are_told(wheels, inertia, part):
    """Half a step is 1e-3 rad/s: about x, or its part about the axis without a wheel."""
    largest = 1e-3 * 2 * inertia / (0.01 * part)
    drives = ", ".join(f"{{axis={one}, torque_limit_N_m=0.02}}" for one in wheels)
    for factor in (0.9, 1.1):
        jets = f"thruster=[{', '.join(JETS)}]".replace("0.02}", f"{factor * largest}}}")
        body = "spacecraft.inertia_kg_m2=[0.3,0.55,0.62]"
        changes = body, "control.period_s=0.2", f"wheel=[{drives}]", jets
        texts = [one for one in told("cubesat-12u", *changes)[0] if "not count as settled" in one]
        assert len(texts) == (factor > 1)
        assert all(f"should be at most {largest:.4g} s" in one for one in texts)


@pytest.mark.parametrize(("torque", "told_of"), [(0.02, True), (0.005, False)])
def test_pulses_that_unload_three_wheels_too_coarsely_are_told(torque, told_of):
    """In 1000 s the torque fills the wheel about y beyond 70 % of its limit, or does not."""
    jets = f"thruster=[{', '.join(JETS)}]".replace("0.01", "10.0")
    axes = ", ".join(f"{{axis={one}, momentum_limit_N_m_s=20}}" for one in np.eye(3).tolist())
    own = "spacecraft.inertia_kg_m2=[420,380,250]", f"wheel=[{axes}]", "simulation.duration_s=1000"
    still = "initial.quaternion=[1,0,0,0]", "initial.omega_rad_s=[0,0,0]"
    pushed = f"disturbance={{constant_N_m=[0,{-torque},0]}}"
    largest = 1e-3 * 2 * 380 / 10
    for factor in (0.9, 1.1):
        coarse = jets.replace("0.02}", f"{factor * largest}}}")
        texts = told("wheels-fail", *own, *still, pushed, coarse, *OWN)[0]
        texts = [one for one in texts if "not count as settled" in one]
        assert len(texts) == (told_of and factor > 1)
        assert all(f"should be at most {largest:.4g} s" in one for one in texts)


def test_pulses_too_coarse_for_the_band_about_the_third_axis_are_told():
    """Four thrusters of 1 N m or less about x, of 960 kg m²: half a step over 0.1 ω is the band."""
    force = np.cross([-1.5, 0.85, 0.85], np.array([1.0, -0.045, 0.045]))
    force /= np.linalg.norm([1.0, -0.045, 0.045])
    least = abs(force[0]) * 0.01 / 960 / 2 / (0.1 * 0.02)
    message = "fire from edge to edge"
    for factor in (0.99, 1.01):
        texts = told("k2", f"control.third_axis_band_rad={factor * least}")[0]
        assert sum(message in one for one in texts) == (factor < 1)
    axes = np.eye(3).astype(int).tolist()
    wheel = ", ".join(f"{{axis={axis}, torque_limit_N_m=0.1}}" for axis in axes)
    three = told("k2", f"control.third_axis_band_rad={0.5 * least}", f"wheel=[{wheel}]")[0]
    assert not any(message in one for one in three)
    assert not any(message in one for one in told("k2")[0])


@pytest.mark.parametrize("seed", range(6))
def test_a_constant_torque_beyond_the_actuators_is_told(seed):
    """The share by bisection of SciPy's least squares within bounds, of wheels and of thrusters."""
    rng = np.random.default_rng(seed)
    torque = rng.normal(size=3) * 0.3
    axes, limits = np.array(WHEELS, float).T / np.sqrt(2), rng.uniform(0.05, 0.2, 4)
    tables = ", ".join(
        f"{{axis={axis}, torque_limit_N_m={limit}}}"
        for axis, limit in zip(WHEELS, limits, strict=True)
    )

    def opposes(share):
        nearest = lsq_linear(axes, -share * torque, (-limits, limits), tol=1e-14, method="bvls")
        return np.linalg.norm(nearest.fun) < 1e-10

    low, high = 0.0, 1.0
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if opposes(middle) else (low, middle)
    own = (*OWN, f"wheel=[{tables}]")
    messages = told("wheels-fail", *own, f"disturbance.constant_N_m={torque.tolist()}")[0]
    about_torque = [one for one in messages if "disturbance.constant_N_m" in one]
    assert len(about_torque) == (low < 0.999)
    assert all(f"of at most {100 * low:.3g} %, got" in one for one in about_torque)


@pytest.mark.parametrize(
    ("torque", "words"),
    [("1.5", None), ("-1.5", "66.7 %"), ("-0.9", None), ("2.5", "80 %")],
)
def test_thrusters_that_push_one_way_oppose_a_torque_of_the_other(torque, words):
    """Two about x: 2 N m at most towards -x, and 1 N m towards x."""
    push = "position_m=[0,1,0], direction=[0,0,{}], force_N={}"
    pair = ", ".join("{" + push.format(*one) + "}" for one in ((1, 1.0), (-1, 2.0)))
    changes = [f"thruster=[{pair}]", f"disturbance.constant_N_m=[{torque},0,0]"]
    changes += ["spacecraft={inertia_kg_m2=[1,1,1]}"]
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ScenarioWarning)
        load("two-torque-free", changes, purpose="motion")
    about_torque = [str(one.message) for one in caught if "constant_N_m" in str(one.message)]
    assert len(about_torque) == (words is not None)
    assert all(words in one for one in about_torque)
