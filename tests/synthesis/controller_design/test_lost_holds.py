"""Which drawn bodies drift beyond what holds them: against a study that flies, and SciPy."""

import numpy as np
import pytest
from scipy.linalg import eigh, null_space
from scipy.spatial.transform import Rotation

import jaxsat
from jaxsat.core.ranges import SETTLED_RATE, SETTLED_TURN, SETTLED_W
from jaxsat.scenario.build.study import build_study
from jaxsat.studies.distributions import Uniform
from jaxsat.synthesis.controller_design.lost_holds import (
    BODIES,
    DrawnBody,
    drawn_bodies,
    first_bodies,
    holds_last,
    lost_holds,
    small_couplings,
)
from studies.studies import tumbling

RATE = 0.0011
"""Of the orbit, rad/s."""


BOUNDS = ("low", "high")


def body_of(inertia, products, nominal):
    """The inertia of drawn numbers."""
    xy, xz, yz = products * nominal.min()
    root = np.sqrt(1 + inertia)
    body = np.diag(nominal) * np.outer(root, root)
    return body + np.array([[0, xy, xz], [xy, 0, yz], [xz, yz, 0]])


def drawn_numbers(study, case):
    """The uniform draws of a case by name, from its point alone."""
    point, copies = study.cases(np.array([case])).point[0], study.case_factory
    ends = np.cumsum([0, *copies.dimensions().values()])
    numbers = {}
    for name, begin, end in zip(copies.dimensions(), ends, ends[1:], strict=False):
        low, high = (float(getattr(copies.dispersions.distributions[name], x)) for x in BOUNDS)
        numbers[name] = low + point[begin:end] * (high - low)
    return numbers


def study_of_bodies():
    errors = {"products_of_inertia": Uniform(-0.02, 0.02), "misalignment": Uniform(-0.02, 0.02)}
    return tumbling(12, duration=1.0, omega=Uniform(-0.01, 0.01), **errors)


def test_the_bodies_are_those_of_the_points_of_a_study():
    study, nominal = study_of_bodies(), np.array([449.5, 264.6, 312.5])
    for case, (inertia, directions) in enumerate(drawn_bodies(study, np.eye(3)[:, :2])):
        drawn = drawn_numbers(study, case)
        expected = body_of(drawn["inertia"], drawn["products_of_inertia"], nominal)
        np.testing.assert_allclose(inertia, expected, rtol=1e-12, atol=1e-9)
        np.testing.assert_allclose(directions.T @ directions, np.eye(2), atol=1e-12)
        normal = np.cross(*directions.T)
        tilts = np.abs(normal[:2] / normal[2])  # of torques turned out of the plane x, y
        angles = np.abs(drawn["misalignment"].reshape(2, 2))
        assert np.all(np.min(np.abs(tilts[:, None] - angles), axis=1) < 1e-3)


@pytest.mark.slow
def test_the_points_are_those_that_a_study_flies():
    study = study_of_bodies()
    columns = study.values(np.arange(12))
    for case in range(12):
        for name, values in drawn_numbers(study, case).items():
            flown = np.atleast_1d(columns[f"drawn_{name}"][case])
            np.testing.assert_allclose(flown, values, rtol=0, atol=1e-15)


def drift_and_balance(inertia, normal):
    """Drift about n at rest in orbit with gravity gradient, and what balances it to first order.

    The plane without a torque about n has the kinetic energy of the Schur complement of n'Jn.
    """

    def drift(turn):
        to_body = Rotation.from_rotvec(turn).as_matrix().T
        across, nadir = RATE * to_body[:, 1], RATE * to_body[:, 2]
        torque = 3 * np.cross(nadir, inertia @ nadir) - np.cross(across, inertia @ across)
        return normal @ torque / (normal @ inertia @ normal)

    step = 1e-5
    slope = [(drift(step * one) - drift(-step * one)) / (2 * step) for one in np.eye(3)]
    plane = null_space(normal[None])
    along = inertia @ normal
    reduced = plane.T @ (inertia - np.outer(along, along) / (normal @ along)) @ plane
    second, first = eigh(reduced, eigvals_only=True)
    sines = (first - second) / (normal @ along) * SETTLED_RATE**2 / 4
    tilt = 2 * np.arctan(SETTLED_W) * np.hypot(*slope[:2])
    return abs(drift(np.zeros(3))), tilt + SETTLED_TURN * abs(slope[2]), sines


@pytest.mark.slow
def test_the_counts_are_those_of_a_computation_apart():
    changes = ["spacecraft.inertia_kg_m2=[320,315,312.5]", "disturbance.gravity_gradient=true"]
    scenario = jaxsat.load("oscillatory-dispersed", changes, caution=lambda text: None)
    study = build_study(scenario, BODIES, engine="scan")
    bodies = drawn_bodies(study, np.eye(3)[:, :2])
    numbers = [drift_and_balance(one, np.cross(*directions.T)) for one, directions in bodies]
    drift, attitude, sines = np.array(numbers).T
    # The mean square of the flattest waves of the law is 8/9, that of sines 1/2.
    lost, hopeless = (int(np.sum(drift > attitude + part * sines)) for part in (16 / 9, 2))
    assert 0 < hopeless < 0.01 * BODIES < lost < BODIES
    told = lost_holds(scenario, first_bodies(scenario))
    assert f"{lost} of {BODIES} bodies drawn" in told
    assert f"{hopeless} of them by more than any periodic rates" in told
    assert not holds_last(scenario)
    known = scenario.dispersion.model_copy(update={"products_of_inertia": None})
    known = known.model_copy(update={"misalignment_rad": None})
    sure = scenario.model_copy(update={"dispersion": known})
    assert lost_holds(sure, first_bodies(sure)) is None
    assert holds_last(sure)


def test_bodies_of_a_small_coupling_are_counted():
    """c = (J1 - J2) / J3 for principal axes; the nominal body of c = 0.1 has none below 0.02."""
    moments = np.array([[1.0 + c, 1.0, 1.0] for c in (0.019, 0.021, 0.001, 0.1)])
    bodies = [DrawnBody(np.diag(one), np.eye(3)[:, :2]) for one in moments]
    scenario = jaxsat.load("oscillatory-dispersed", caution=lambda text: None)
    told = small_couplings(scenario, bodies)
    assert "2 of 4 bodies drawn from [dispersion] have c below 0.02" in told
    assert small_couplings(scenario, bodies[1::2]) is None
