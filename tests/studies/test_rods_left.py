"""What failed magnetorquers and wheels leave in each case of a study, over an orbit."""

import numpy as np
import pytest

from jaxsat.scenario import Scenario
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.studies.failure_codes import FAILURES, NEVER
from jaxsat.studies.rods_left import momentum_bias
from jaxsat.studies.torques_left import TorquesLeft, torques_left

QUICK = {"law": "quaternion-feedback", "natural_frequency_rad_s": 0.01, "period_s": 2.0}
"""A law that is quickly made."""


def left(name, *cases, law=QUICK, kind="wheel dead", rod="dead", amount=np.nan, rods=None):
    """Of every case: which devices fail as told, wheels counted before magnetorquers."""
    data = load(name).model_dump(exclude_none=True)
    if rods is not None:
        data["magnetorquer"] = [rod | {"name": f"rod {at}"} for at, rod in enumerate(rods)]
    devices = [(of, one["name"]) for of in ("wheel", "magnetorquer") for one in data.get(of, ())]
    data["failure"] = [
        {"of": f"{of} {which}", "kind": "dead", "at_s": 100.0 * at}
        for at, (of, which) in enumerate(devices, 1)
    ]
    data["control"] = law
    loop = build(Scenario.model_validate(data)).loop
    codes = [FAILURES.index(kind if of == "wheel" else rod) for of, _ in devices]
    places = np.arange(len(devices))
    dies = np.array([np.isin(places, case) for case in cases])
    struck = {
        "failure_time": np.tile(100.0 * (1 + places), (len(cases), 1)),
        "failed_part": np.tile(places, (len(cases), 1)),
        "failure_kind": np.where(dies, codes, NEVER),
        "failure_amount": np.full(dies.shape, amount),
    }
    return [TorquesLeft(int(code)) for code in torques_left(loop, np.zeros(3), struck)]


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


RODS = ", ".join(f"{{axis={axis}, dipole_limit_A_m2=10}}" for axis in np.eye(3).tolist())
BESIDE_WHEELS = [f"magnetorquer=[{RODS}]", "orbit.rate_rad_s=1.1e-3"]


def test_the_bias_of_wheels_is_known_whatever_steers_the_rods():
    more = [*BESIDE_WHEELS, "unloading.bias_N_m_s=0.3"]
    feedback = ['control={law="quaternion-feedback", natural_frequency_rad_s=0.05}', "failure=[]"]
    for changes in ([], feedback):
        loop = build(load("wheels-fail", [*more, *changes])).loop
        assert momentum_bias(loop) == 0.3
