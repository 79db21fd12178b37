"""What failed wheels leave in each case of a study, and what of it no law can settle."""

import dataclasses

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxsat.control.diagnosis.isolation import DiagnosedKind
from jaxsat.core.tolerances import Tolerances
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.spacecraft.effector import AbstractEffector, Effect, Reach
from jaxsat.spacecraft.flexible_modes import FlexibleModes
from jaxsat.studies.failure_codes import DIAGNOSED, FAILURES, HYPOTHESES
from jaxsat.studies.momentum_left import SLOW, Held
from jaxsat.studies.torques_left import TorquesLeft, torques_left


def left(loop, *failures, momentum=(0.0, 0.0, 0.0)):
    """Of one case: (wheel, kind, amount) of each failure, one second after the other."""
    struck = {
        "failure_time": np.arange(float(len(failures)))[None],
        "failed_part": np.array([[wheel for wheel, *_ in failures]]),
        "failure_kind": np.array([[FAILURES.index(f"wheel {kind}") for _, kind, _ in failures]]),
        "failure_amount": np.array([[amount for *_, amount in failures]]),
    }
    return TorquesLeft(int(torques_left(loop, np.array(momentum), struck)[0]))


@pytest.fixture(scope="module")
def four():
    return build(load("wheels-fail")).loop


@pytest.fixture(scope="module")
def three():
    return build(load("failures-telescope")).loop


@pytest.mark.parametrize(
    ("failures", "expected"),
    [
        ([(0, "dead", np.nan)], TorquesLeft.THREE_AXES),
        ([(0, "dead", np.nan), (1, "stopped", np.nan)], TorquesLeft.TWO_TORQUES),
        ([(0, "dead", np.nan), (0, "stopped", np.nan)], TorquesLeft.THREE_AXES),
        ([(0, "degraded", 0.1), (1, "degraded", 0.2)], TorquesLeft.THREE_AXES),
        ([(0, "friction to", 0.3), (1, "dead", np.nan)], TorquesLeft.THREE_AXES),
        ([(0, "friction to", 0.37), (1, "dead", np.nan)], TorquesLeft.TWO_TORQUES),
        ([(0, "runaway", np.nan)], TorquesLeft.UNHELD_MOMENTUM),
        ([(0, "runaway", np.nan), (0, "dead", np.nan)], TorquesLeft.THREE_AXES),
        ([(0, "dead", np.nan), (0, "runaway", np.nan)], TorquesLeft.UNHELD_MOMENTUM),
        ([(0, "dead", np.nan), (1, "dead", np.nan), (0, "degraded", 0.5)], TorquesLeft.THREE_AXES),
    ],
)
def test_what_four_wheels_leave(four, failures, expected):
    assert left(four, *failures) == expected


class Vanes(AbstractEffector):
    """Devices of another package, whose torque is neither even in a hold nor stored."""

    kind = "vane"
    columns: jnp.ndarray
    failures: None = None

    @property
    def count(self):
        return self.columns.shape[1]

    def driven(self, state, command, struck):
        return self, command

    def reach(self, t, plant, state, struck, span):
        return Reach(self.columns, -jnp.ones(self.count), jnp.ones(self.count))

    def piece(self, mode, command):
        return command

    def effect(self, piece, t, plant, state):
        return Effect(self.columns @ piece)


def carrying(loop, *effectors):
    return dataclasses.replace(loop, plant=loop.plant.with_effectors(effectors))


def test_torques_of_devices_of_another_package_count(four):
    wheels, vanes = four.plant.effectors[0], Vanes(columns=jnp.eye(3))
    assert left(carrying(four, vanes)) == TorquesLeft.THREE_AXES
    assert left(carrying(four, Vanes(columns=jnp.eye(3)[:, :1]))) == TorquesLeft.TOO_FEW
    dead = [(number, "dead", np.nan) for number in range(4)]
    assert left(carrying(four, wheels, vanes), *dead) == TorquesLeft.THREE_AXES


def test_flexible_modes_are_no_thrusters(four):
    modes = FlexibleModes([[1.0], [0.0], [0.0]], 0.1, 1.0)
    two_dead = [(0, "dead", np.nan), (1, "stopped", np.nan)]
    loop = carrying(four, *four.plant.effectors, modes)
    assert left(loop, *two_dead) == TorquesLeft.TWO_TORQUES


def test_a_wheel_that_had_failed_before_is_not_counted(three):
    assert left(three, (1, "dead", np.nan)) == TorquesLeft.TWO_TORQUES
    assert left(three, (0, "dead", np.nan)) == TorquesLeft.THREE_AXES
    assert left(three, (1, "runaway", np.nan)) == TorquesLeft.UNHELD_MOMENTUM


def test_momentum_leaves_some_attitudes(three):
    assert left(three, (1, "dead", np.nan), momentum=(1.0, 2.0, 0.5)) == TorquesLeft.SOME_ATTITUDES


def test_a_runaway_that_holds_less_than_the_others_is_held():
    wheels = ",".join(
        f"{{axis={axis},torque_limit_N_m=0.4,momentum_limit_N_m_s={most}}}"
        for axis, most in (("[1,0,1]", 10), ("[0,1,1]", 20), ("[-1,0,1]", 20), ("[0,-1,1]", 20))
    )
    changes = [f"wheel=[{wheels}]", "failure=[{of='wheel 1',at_s=5,kind='dead'}]"]
    loop = build(load("wheels-fail", changes)).loop
    assert left(loop, (0, "runaway", np.nan)) == TorquesLeft.THREE_AXES
    assert left(loop, (1, "runaway", np.nan)) == TorquesLeft.UNHELD_MOMENTUM


def test_every_failure_of_a_wheel_has_the_verdict_that_is_right_for_it():
    for code, name in enumerate(FAILURES):
        if name.startswith("wheel "):
            verdict = DIAGNOSED[HYPOTHESES[code]]
            assert name.removeprefix("wheel ").split()[0] == verdict.split()[0]
    assert HYPOTHESES[FAILURES.index("dead")] == 1 + DiagnosedKind.DEAD


NORMAL = np.cross([-1.0, 0.0, 1.0], [0.0, -1.0, 1.0]) / np.sqrt(3)
"""Of the wheels C and D of `wheels-fail`."""


def asked(changes, tolerances=None, duration=1200.0, **draws):
    run = build(load("wheels-fail", changes))
    return Held(run.loop, run.start, duration, tolerances or Tolerances(), draws)


def test_the_target_is_held_where_an_attitude_within_the_tolerances_lets_momentum_be_across():
    """n·C H = 0 for a rotation by the angle of H to the plane across n, about n × H."""
    across = np.array([1.0, -1.0, 0.0]) / np.sqrt(2)
    axis = np.cross(NORMAL, across)
    most = min(2 * np.arctan(0.05) / np.hypot(*axis[:2]), 0.05 / abs(axis[2]))
    angle = most * np.array([0.99, 1.1, 0.5, -0.99, -1.1])
    momentum = np.cos(angle)[:, None] * across + np.sin(angle)[:, None] * NORMAL
    start = np.array([1.0, 0.0, 0.0, 0.0])
    found = asked(
        [f"initial.quaternion={start.tolist()}", "spacecraft.inertia_kg_m2=[400.0,400.0,400.0]"],
        omega=20.0 * momentum / 400,
    )
    assert found.free
    held = [found.holds(case, NORMAL, 300.0) for case in range(len(angle))]
    assert held == [True, False, True, True, False]


@pytest.mark.parametrize(("part", "expected"), [(0.9, True), (1.1, False)])
def test_little_momentum_is_no_obstacle(part, expected):
    """It turns the body by a part of the tolerance in the 120 s asked; along n nothing helps."""
    most = SLOW * min(2 * np.arctan(0.05) / np.hypot(*NORMAL[:2]), 0.05 * np.sqrt(3))
    found = asked(
        ["initial.quaternion=[1.0,0.0,0.0,0.0]", "spacecraft.inertia_kg_m2=[400.0,400.0,400.0]"],
        omega=(part * most / 115 * NORMAL)[None],
    )
    assert found.holds(0, NORMAL, 300.0) == expected


def test_momentum_changes_in_orbit_as_scipy_integrates_it():
    """In inertial axes: the body turns with the orbit, under gravity gradient, about its target."""
    inertia = np.array([[420.0, 30.0, -20.0], [30.0, 380.0, 25.0], [-20.0, 25.0, 250.0]])
    changes = [
        f"spacecraft.inertia_kg_m2={inertia.tolist()}",
        "orbit={altitude_km=500}",
        "disturbance={gravity_gradient=true}",
    ]
    none = Tolerances(1e-9, 1e-9, 1e-3)  # no attitude but the target
    found = asked(changes, none, omega=np.array([[1e-3, -2e-3, 5e-4]]))
    rate = float(found.loop.plant.orbit.rate)

    def frame(t):  # rows are the axes of the orbit frame, inertial at t = 0
        angle = -rate * t
        c, s = np.cos(angle), np.sin(angle)
        return np.array([[c, 0, -s], [0, 1, 0], [s, 0, c]])

    def torque(t, _):
        nadir = np.array([0.0, 0.0, 1.0])
        return frame(t).T @ (3 * rate**2 * np.cross(nadir, inertia @ nadir))

    times, path = found.path(0, NORMAL, 300.0)
    start = found.start.attitude.as_dcm().matrix
    begun = np.asarray(start).T @ (inertia @ [1e-3, -2e-3, 5e-4])
    told = solve_ivp(torque, (300, 1200), begun, t_eval=times, rtol=1e-10, atol=1e-13).y.T
    expected = [
        frame(t) @ one - inertia @ [0, -rate, 0] for t, one in zip(times, told, strict=True)
    ]
    np.testing.assert_allclose(path, expected, atol=1e-5 * np.abs(path).max())


PAIR = (
    "thruster=["
    "{torque_axis=[0,0,1],torque_N_m=0.5,min_on_time_s=0.02},"
    "{torque_axis=[0,0,-1],torque_N_m=0.5,min_on_time_s=0.02}]"
)
PLANE = (
    "thruster=["
    + ",".join(
        f"{{torque_axis={axis},torque_N_m=0.5,min_on_time_s=0.02}}"
        for axis in ("[1,0,0]", "[-1,0,0]", "[0,1,0.1]", "[0,-1,-0.1]")
    )
    + "]"
)


def beside(thrusters, *axes, **keys):
    """Changes of a scenario: thrusters, the second of which fails, and wheels along these axes."""
    extra = "".join(f",{key}={value}" for key, value in keys.items())
    wheels = ",".join(f"{{axis={axis},torque_limit_N_m=0.4{extra}}}" for axis in axes)
    return [thrusters, f"wheel=[{wheels}]", "failure=[{of='thruster 2',at_s=5,kind='dead'}]"]


def dead(loop, part, kind="dead", momentum=(0.0, 0.0, 0.0)):
    """What is left where the actuator with this number among all, or none, is dead."""
    failures = {
        "failure_time": np.array([[5.0]]),
        "failed_part": np.array([[part]]),
        "failure_kind": np.array([[FAILURES.index(kind)]]),
        "failure_amount": np.array([[np.nan]]),
    }
    return TorquesLeft(int(torques_left(loop, np.array(momentum), failures)[0]))


def test_thrusters_leave_two_wheels_a_momentum_that_only_the_flight_tells():
    """One of a pair that made the third axis dies: two wheels hold some attitudes, in an orbit
    frame none for long, whatever the momentum at the start was."""
    changes = beside(PAIR, "[1,0,0]", "[0,1,0]")
    inertial = build(load("wheels-fail", changes)).loop
    for momentum in ((0.0, 0.0, 0.0), (1.0, 2.0, 0.5)):
        assert dead(inertial, 1, momentum=momentum) == TorquesLeft.SOME_ATTITUDES
    orbit = build(load("wheels-fail", [*changes, "orbit={altitude_km=500}"])).loop
    assert dead(orbit, 1, momentum=(1.0, 2.0, 0.5)) == TorquesLeft.BY_DRIFT


def test_thrusters_in_a_plane_are_flown_beside_wheels_that_never_worked():
    """A wheel that fails in flight keeps momentum, which no law of two torques models."""
    wheel = "failure=[{of='wheel 1',at_s=5,kind='dead'}]"
    worked = build(load("wheels-fail", [*beside(PLANE, "[0,0,1]"), wheel])).loop
    assert dead(worked, 4, "wheel dead") == TorquesLeft.BY_DRIFT
    assert dead(worked, 4, "none") == TorquesLeft.THREE_AXES
    never = build(load("wheels-fail", beside(PLANE, "[0,0,1]", failed="true"))).loop
    assert dead(never, 1, "none") == TorquesLeft.TWO_TORQUES
