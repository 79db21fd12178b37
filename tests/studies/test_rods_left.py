"""What failed magnetorquers and wheels leave in each case of a study, over an orbit."""

import numpy as np
import pytest
from scipy.integrate import solve_ivp

from jaxsat.core.tolerances import Tolerances
from jaxsat.report.rod_findings import stuck_rod_words
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.actuator_set import judge_scenario
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import tolerances_of
from jaxsat.spacecraft.environment.orbit import DIPOLE
from jaxsat.studies.failure_codes import FAILURES, NEVER
from jaxsat.studies.momentum_left import Held
from jaxsat.studies.rods_left import (
    RodsLeft,
    ThrustersLeft,
    momentum_bias,
    rod_set,
)
from jaxsat.studies.torques_left import TorquesLeft, torques_left

QUICK = {"law": "quaternion-feedback", "natural_frequency_rad_s": 0.01, "period_s": 2.0}
"""A law that is quickly made."""


def left(
    name, *cases, law=QUICK, kind="wheel dead", rod="dead", amount=np.nan, rods=None, until=None
):
    """Of every case: which devices fail as told, wheels counted before magnetorquers. `until` is
    the duration (s) for which wheels must hold what they store."""
    data = load(name).model_dump(exclude_none=True)
    if rods is not None:
        data["magnetorquer"] = [rod | {"name": f"rod {at}"} for at, rod in enumerate(rods)]
    devices = [(of, one["name"]) for of in ("wheel", "magnetorquer") for one in data.get(of, ())]
    data["failure"] = [
        {"of": f"{of} {which}", "kind": "dead", "at_s": 100.0 * at}
        for at, (of, which) in enumerate(devices, 1)
    ]
    data["control"] = law
    scenario = Scenario.model_validate(data)
    run = build(scenario)
    loop = run.loop
    codes = [FAILURES.index(kind if of == "wheel" else rod) for of, _ in devices]
    places = np.arange(len(devices))
    dies = np.array([np.isin(places, case) for case in cases])
    struck = {
        "failure_time": np.tile(100.0 * (1 + places), (len(cases), 1)),
        "failed_part": np.tile(places, (len(cases), 1)),
        "failure_kind": np.where(dies, codes, NEVER),
        "failure_amount": np.full(dies.shape, amount),
    }
    hold = None if until is None else Held(loop, run.start, until, tolerances_of(scenario), {})
    found = torques_left(loop, np.zeros(3), struck, hold=hold)
    return [TorquesLeft(int(code)) for code in found]


@pytest.mark.slow
def test_rods_alone():
    assert left("rods-only", (), (0,), (2,), (0, 2), (0, 1, 2)) == [
        TorquesLeft.MAGNETIC,
        TorquesLeft.MAGNETIC,
        TorquesLeft.MAGNETIC,
        TorquesLeft.TOO_FEW,  # a rod along the orbit normal makes no torque about it
        TorquesLeft.TOO_FEW,
    ]


@pytest.mark.slow
def test_a_law_with_gains_of_all_rods_does_not_hold_a_body_that_gravity_gradient_turns_over():
    """Of x and z rods, by which the body is controllable; the law does not know which one died."""
    law = {"law": "fault-tolerant", "natural_frequency_rad_s": 0.001, "period_s": 2.0}
    found = left("rods-only", (0,), (1,), (2,), (0, 2), law=law)
    assert found == [
        TorquesLeft.MAGNETIC,
        TorquesLeft.TOO_FEW,
        TorquesLeft.MAGNETIC,
        TorquesLeft.TOO_FEW,
    ]


@pytest.mark.slow
def test_a_wheel_and_rods():
    found = left("wheel-and-rods", (), (0,), (1,), (1, 2, 3), (0, 1, 2, 3))
    assert found[:2] == [TorquesLeft.MAGNETIC] * 2
    assert found[3:] == [TorquesLeft.TOO_FEW] * 2


@pytest.mark.slow
def test_the_fault_tolerant_law_uses_rods_beside_two_wheels_and_one():
    law = {"law": "fault-tolerant", "natural_frequency_rad_s": 0.05, "period_s": 0.5}
    found = left("cubesat-3w3m", (0,), (1,), (2,), (0, 1), (0, 1, 2), law=law)
    assert found == [TorquesLeft.MAGNETIC] * 5


@pytest.mark.slow
def test_the_orbit_turns_the_momentum_of_a_runaway():
    """Nothing takes it out, but about the orbit normal it stays."""
    law = {"law": "fault-tolerant", "natural_frequency_rad_s": 0.05, "period_s": 0.5}
    assert left("cubesat-3w3m", (0,), (1,), (2,), law=law, kind="wheel runaway") == [
        TorquesLeft.UNHELD_MOMENTUM,
        TorquesLeft.MAGNETIC,
        TorquesLeft.UNHELD_MOMENTUM,
    ]


@pytest.mark.slow
def test_a_stuck_rod_is_opposed_by_the_others_or_not():
    """About z, which wheels leave, a dipole along z makes no torque, and one along y, the orbit
    normal, more than the others, unless it is small; but a large one along z fills the wheels."""
    law = {"law": "fault-tolerant", "natural_frequency_rad_s": 0.05, "period_s": 0.5}
    lost_z = (2,)
    alone = left("cubesat-3w3m", (*lost_z, 4), law=law, rod="stuck on")
    assert alone == [TorquesLeft.UNOPPOSED_TORQUE]
    little = left("cubesat-3w3m", (*lost_z, 4), law=law, rod="stuck at", amount=0.02)
    assert little == [TorquesLeft.MAGNETIC]
    for amount, found in ((0.5, TorquesLeft.MAGNETIC), (1.0, TorquesLeft.UNOPPOSED_TORQUE)):
        along = left("cubesat-3w3m", (*lost_z, 5), law=law, rod="stuck at", amount=amount)
        assert along == [found]
    whole = left("cubesat-3w3m", (4,), law=law, rod="stuck on")
    assert whole == [TorquesLeft.THREE_AXES]


@pytest.mark.slow
def test_two_rods_do_not_oppose_one_along_the_orbit_normal_near_the_poles():
    """For hours the field has no part along it. Of the others, they oppose smaller dipoles."""
    law = {"law": "fault-tolerant", "natural_frequency_rad_s": 0.02, "period_s": 2.0}
    for rod, amount, found in (
        (2, 0.05, TorquesLeft.UNOPPOSED_TORQUE),
        (1, 0.05, TorquesLeft.MAGNETIC),
        (1, -1.0, TorquesLeft.UNOPPOSED_TORQUE),
        (3, 0.2, TorquesLeft.MAGNETIC),
    ):
        stuck = left("wheel-and-rods", (rod,), law=law, rod="stuck at", amount=amount)
        assert stuck == [found]


@pytest.mark.slow
def test_stuck_rods_that_cancel_make_no_torque():
    """Two along x, one against the other, beside rods along y and z."""
    axes = [[1, 0, 0], [-1, 0, 0], [0, 1, 0], [0, 0, 1]]
    rods = [{"axis": axis, "dipole_limit_A_m2": 0.2} for axis in axes]
    assert left("rods-only", (0, 1), rod="stuck on", rods=rods) == left("rods-only", (0,))


@pytest.mark.slow
def test_the_finding_on_one_stuck_rod_is_what_a_study_says():
    """Two orbits by three wheels: x fills them, y and z do not, as the others take out enough."""
    scenario = load("cubesat-3w3m")
    words = stuck_rod_words(scenario, judge_scenario(scenario))
    assert words == (
        "One magnetorquer stuck at its limit: wheels hold 2 of 3 for 8400 s; x-m1 would fill them"
    )
    found = left("cubesat-3w3m", (3,), (4,), (5,), rod="stuck on", until=8400.0)
    assert found == [TorquesLeft.UNHELD_MOMENTUM, *[TorquesLeft.THREE_AXES] * 2]
    brief = left("cubesat-3w3m", (3,), rod="stuck on", until=1200.0)
    assert brief == [TorquesLeft.THREE_AXES]


@pytest.mark.slow
def test_the_finding_on_one_stuck_rod_tells_what_others_oppose_over_an_orbit():
    """With a wheel about the orbit normal; a study says the same of a little less and more."""
    scenario = load("wheel-and-rods")
    words = stuck_rod_words(scenario, judge_scenario(scenario))
    assert words == (
        "One magnetorquer stuck at its limit: over an orbit the others oppose x up to 12 %, "
        "y up to 0.97 %, z up to 23 % of it"
    )
    law = {"law": "fault-tolerant", "natural_frequency_rad_s": 0.02, "period_s": 2.0}
    for amount, verdict in ((0.11, TorquesLeft.MAGNETIC), (0.13, TorquesLeft.UNOPPOSED_TORQUE)):
        found = left(
            "wheel-and-rods",
            (1,),
            law=law,
            rod="stuck at",
            amount=amount,
            until=scenario.simulation.duration_s,
        )
        assert found == [verdict]


RODS = ", ".join(f"{{axis={axis}, dipole_limit_A_m2=10}}" for axis in np.eye(3).tolist())
BESIDE_WHEELS = [f"magnetorquer=[{RODS}]", "orbit.rate_rad_s=1.1e-3"]


def test_the_bias_of_wheels_is_known_whatever_steers_the_rods():
    more = [*BESIDE_WHEELS, "unloading.bias_N_m_s=0.3"]
    feedback = ['control={law="quaternion-feedback", natural_frequency_rad_s=0.05}', "failure=[]"]
    for changes in ([], feedback):
        loop = build(load("wheels-fail", [*more, *changes])).loop
        assert momentum_bias(loop) == 0.3


IN_ORBIT = [
    "orbit={altitude_km=450, inclination_deg=60, ascending_node_deg=20, sidereal_angle_deg=70, "
    "argument_of_latitude_deg=35}",
    "spacecraft.inertia_kg_m2=[[42,3,-2],[3,38,2],[-2,2,25]]",
    "disturbance={gravity_gradient=true}",
    "initial={quaternion=[1,0,0,0], omega_rad_s=[1e-3,-2e-3,5e-4]}",
    f"magnetorquer=[{RODS}]",
    "failure=[]",
    'control={law="quaternion-feedback", natural_frequency_rad_s=0.05}',
]


def momentum_by_scipy(stuck, since, end):
    """Momentum (N m s, orbit frame, beyond what its rate requires) of a body that rests there under
    gravity gradient and with a dipole along y from `since` on, integrated in inertial axes."""
    inertia = np.array([[42.0, 3, -2], [3, 38, 2], [-2, 2, 25]])
    radius, tilt, node, begin, sidereal = 6378137 + 450e3, *np.radians([60, 20, 35, 70])
    rate = np.sqrt(3.986004418e14 / radius**3)

    def frame(t):  # rows are the axes of the orbit frame
        u = begin + rate * t
        ascending = np.array([np.cos(node), np.sin(node), 0])
        ahead = np.array([-np.sin(node) * np.cos(tilt), np.cos(node) * np.cos(tilt), np.sin(tilt)])
        up = np.cos(u) * ascending + np.sin(u) * ahead
        along = np.cos(u) * ahead - np.sin(u) * ascending
        return np.stack([along, -np.cross(up, along), -up])

    def torque(t, _):
        turn = sidereal + 7.292115e-5 * t
        earth = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
        dipole = np.append(earth @ DIPOLE[:2], DIPOLE[2])
        up, down = -frame(t)[2], np.array([0.0, 0, 1])
        field = (6371.2e3 / radius) ** 3 * (3 * (dipole @ up) * up - dipole)
        of_rod = np.cross([0, stuck, 0], frame(t) @ field)
        return frame(t).T @ (3 * rate**2 * np.cross(down, inertia @ down) + of_rod)

    begun = frame(0).T @ (inertia @ [1e-3, -2e-3, 5e-4])
    times = np.linspace(since, end, 200)
    told = solve_ivp(torque, (since, end), begun, t_eval=times, rtol=1e-9, atol=1e-10).y.T
    required = inertia @ [0, -rate, 0]
    return np.array([frame(t) @ one - required for t, one in zip(times, told, strict=True)])


def test_a_stuck_rod_fills_three_wheels_as_scipy_integrates_it():
    """Over two orbits; the other rods take out most of it."""
    run, since, end = build(load("wheels-fail", IN_ORBIT)), 300.0, 11000.0
    (dipoles,) = [found for one in run.loop.plant.effectors if (found := one.dipoles())]
    hold = Held(run.loop, run.start, end, Tolerances(), {})
    none = ThrustersLeft(np.zeros((3, 0)), np.zeros(0), np.zeros(0))
    whole = np.abs(momentum_by_scipy(4.0, since, end)).max(axis=0)

    def needed(part, *helping):
        healthy = np.isin(np.arange(3), helping)
        rods = RodsLeft(
            rod_set(run.loop, dipoles),
            healthy,
            np.array([0.0, 4.0, 0.0]),
            np.where(healthy, 10.0, 0.0),
            np.array([np.inf, since, np.inf]),
        )
        return rods.load(np.eye(3), part * whole, none, hold)

    assert needed(1.0) == pytest.approx(1.0, rel=2e-3)
    assert needed(2.0) == pytest.approx(0.5, rel=2e-3)
    assert 0.05 < needed(1.0, 0, 2) < 0.5
