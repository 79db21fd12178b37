"""What failing cases have in common, and the changes that are tried on them."""

import jax.numpy as jnp
import numpy as np
import pytest

import jaxsat
from jaxsat.studies.changes import PerturbedLoop
from jaxsat.studies.quantities import QUANTITIES
from jaxsat.synthesis.controller_design.candidates import Candidate
from jaxsat.synthesis.controller_design.explanation import (
    COUPLING,
    drawn_numbers,
    remedies,
    separations,
)
from jaxsat.synthesis.controller_design.variants import NOISE, multiplied, stronger
from jaxsat.synthesis.controller_design.vehicle import vehicle_verdict

HARD = jaxsat.load("acceptance-hard")


def columns(count, seed=0):
    """Draws of a study without its flights."""
    rng = np.random.default_rng(seed)
    return {
        "drawn_inertia": rng.uniform(-0.1, 0.1, (count, 3)),
        "drawn_products_of_inertia": rng.uniform(-0.02, 0.02, (count, 3)),
        "drawn_omega": rng.uniform(-0.1, 0.1, (count, 3)),
        "settling_time": np.full(count, 100.0),
    }


@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
def test_the_number_that_decides_is_named_first():
    scenario = jaxsat.load("acceptance-hard", ["spacecraft.failed_thrusters=[1]"])
    drawn = columns(1500)
    couplings = drawn_numbers(scenario, drawn, two_torques=True)[COUPLING]
    drawn["settling_time"][couplings < np.quantile(couplings, 0.05)] = np.inf
    first, *_ = separations(scenario, drawn, two_torques=True)
    assert first.name == COUPLING
    assert first.failing[2] < first.settled[0]

    drawn["settling_time"][:] = 100.0
    size = np.linalg.norm(drawn["drawn_omega"], axis=1)
    drawn["settling_time"][size > np.quantile(size, 0.95)] = np.inf
    first, *_ = separations(scenario, drawn, two_torques=True)
    assert first.name == "size of omega"


def test_failures_by_chance_are_told_as_such():
    drawn = columns(1000, seed=3)
    drawn["settling_time"][np.random.default_rng(8).random(1000) < 0.05] = np.inf
    assert separations(HARD, drawn, two_torques=True) == ()


def test_the_coupling_is_that_of_the_body_that_is_flown():
    drawn = columns(4)
    loop = jaxsat.build(HARD).loop
    for case, found in enumerate(drawn_numbers(HARD, drawn, two_torques=True)[COUPLING]):
        flown = PerturbedLoop(loop, None, loop)
        for name in ("inertia", "products_of_inertia"):
            flown = QUANTITIES[name].apply(flown, jnp.asarray(drawn[f"drawn_{name}"][case]))
        inertia = np.asarray(flown.loop.plant.spacecraft.inertia)
        along = inertia @ np.array([0.0, 0.0, 1.0])
        reduced = (inertia - np.outer(along, along) / along[2])[:2, :2]
        low, high = np.linalg.eigvalsh(reduced)
        assert found == pytest.approx((high - low) / along[2], rel=1e-12)


def made(scenario, others=()):
    chosen = Candidate("three-slew", scenario)
    return {change: made() for change, made in remedies(chosen, others, vehicle_verdict(scenario))}


def test_every_change_changes_what_it_says():
    found = made(HARD, (Candidate("other", jaxsat.load("acceptance-mc")),))
    assert found["twice the torque"].spacecraft.torque_limit_N_m == 10
    assert found["twice the time"].simulation.duration_s == 2400
    noise = found["half the noise of the sensors"].sampling
    assert (noise.rate_noise_rad_s, noise.attitude_noise_rad) == (1.5e-5, 5e-5)
    assert found["half the disturbance"].disturbance.amplitude_N_m == (0.005, 0.01, 0.0005)
    inertia = found["half the error of the inertia"].dispersion.inertia
    assert (inertia.low, inertia.high) == (-0.05, 0.05)
    assert found["the law other"].title == "Acceptance set, mc"
    assert "the nearest attitude that can be held" not in found


def test_only_what_is_there_is_changed():
    calm = jaxsat.load("two-wheel-telescope")
    assert not set(made(calm)) & {"half the noise of the sensors", "half the disturbance"}


def test_an_attitude_that_cannot_be_held_has_the_nearest_one_tried():
    inertia = ((449.5, 39.7, 0.0), (39.7, 264.6, 0.0), (0.0, 0.0, 312.5))
    table = HARD.spacecraft.model_copy(update={"inertia_kg_m2": inertia})
    scenario = HARD.model_copy(update={"spacecraft": table})
    turned = made(scenario)["the nearest attitude that can be held"]
    assert vehicle_verdict(turned).holds
    assert not vehicle_verdict(scenario).holds


def test_pulsed_thrusters_and_filters_are_scaled_too():
    pulsed = jaxsat.load("pulsed-two-torque")
    assert {one.force_N for one in stronger(pulsed, 2.0).thruster} == {10.0}
    given = jaxsat.load(
        "two-torque-free",
        [
            "gyro.noise_density_rad_s_sqrt_Hz=1e-5",
            "star_tracker.across_rad=1e-5",
            "star_tracker.along_rad=1e-4",
        ],
    )
    half = multiplied(given, 0.5, NOISE)
    assert half.gyro.noise_density_rad_s_sqrt_Hz == 5e-6
    assert (half.star_tracker.across_rad, half.star_tracker.along_rad) == (5e-6, 5e-5)
