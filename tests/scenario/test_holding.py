"""Which attitudes can be held: against a closed form, SciPy's optimiser, and what is told."""

import warnings

import numpy as np
import pytest
from scipy.optimize import minimize
from scipy.spatial.transform import Rotation

from jaxsat.core.declaration.domain import sweeps_of
from jaxsat.core.ranges import SETTLED_RATE
from jaxsat.scenario import ScenarioWarning
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.holding import _iterate, missing_torque, nearest_held, rest_drift

J = np.array([449.5, 264.6, 312.5])
Z = np.array([0.0, 0.0, 1.0])


def test_a_product_of_inertia_is_turned_away():
    """Without a torque about z the principal axes in the plane must be those of the orbit."""
    inertia = np.diag(J)
    inertia[0, 1] = inertia[1, 0] = 30.0
    angle = np.arctan2(2 * 30.0, J[0] - J[1]) / 2
    np.testing.assert_allclose(nearest_held(inertia, Z, False), [0, 0, -angle], atol=1e-5)
    turned = Rotation.from_rotvec([0, 0, -angle]).as_matrix()
    assert abs((turned @ inertia @ turned.T)[0, 1]) < 1e-9  # in the axes of the orbit


@pytest.mark.parametrize("gravity_gradient", [False, True])
@pytest.mark.parametrize("seed", range(6))
def test_the_turn_is_the_least(seed, gravity_gradient):
    rng = np.random.default_rng(seed)
    small = Rotation.from_rotvec(rng.uniform(-0.3, 0.3, 3)).as_matrix()
    inertia = small @ np.diag(J) @ small.T
    normal = Rotation.from_rotvec(rng.uniform(-0.3, 0.3, 3)).as_matrix()[2]
    found = nearest_held(inertia, normal, gravity_gradient)
    assert abs(missing_torque(inertia, normal, found, gravity_gradient)) < 1e-3

    def balance(v):
        return missing_torque(inertia, normal, v, gravity_gradient)

    best = minimize(
        lambda v: v @ v, found + 0.05, constraints={"type": "eq", "fun": balance}, tol=1e-12
    )
    assert np.linalg.norm(found) <= np.linalg.norm(best.x) + 1e-4


@pytest.mark.parametrize("normal", list(np.eye(3)))
def test_principal_axes_are_held_as_they_are(normal):
    np.testing.assert_array_equal(nearest_held(np.diag(J), normal, True), 0)


def told(*overrides):
    with warnings.catch_warnings(record=True) as caught:
        warnings.simplefilter("always", ScenarioWarning)
        load("acceptance-hard", overrides)
    return " ".join(str(one.message) for one in caught)


def test_an_attitude_that_cannot_be_held_is_told():
    products = "spacecraft.inertia_kg_m2=[[449.5,39.69,0],[39.69,264.6,0],[0,0,312.5]]"
    assert "the nearest attitude that can be held" in told(products)
    assert not told(products.replace("39.69", "0.1"))
    assert not told(products, "orbit.rate_rad_s=0")
    elliptic = ("orbit.perigee_altitude_km=500", "orbit.apogee_altitude_km=900")
    assert not told(products, *elliptic)  # there the target is inertial


def test_an_attitude_that_an_oscillation_holds_is_not_told():
    """The drift J12 ω0² / J3 at the target is half of c ρ² / 4 at one rate ω0; ρ = 1e-3 rad/s."""
    products = "spacecraft.inertia_kg_m2=[[449.5,39.69,0],[39.69,264.6,0],[0,0,312.5]]"
    stopped = np.hypot(449.5 - 264.6, 2 * 39.69) * SETTLED_RATE**2 / 4 / 2
    rate = np.sqrt(stopped / 39.69)
    assert "the nearest attitude that can be held" in told(
        products, f"orbit.rate_rad_s={1.001 * rate}"
    )
    assert not told(products, f"orbit.rate_rad_s={0.999 * rate}")


def test_what_lies_outside_the_verified_ranges_is_told_with_what_happens_there():
    small = told("spacecraft.inertia_kg_m2=[272,265.75,312.5]")
    sweep = next(one for one in sweeps_of("three-slew") if one.number == "coupling")
    low, high = sweep.verified
    assert f"c = (S1 - S2) / Jn from {low:.3g} to {high:.3g}" in small
    settled = dict(sweep.settled)[0.02]
    assert f"at 0.02 {settled:.0%} of the hard cases settled, got 0.02" in small
    assert "the rate that the periodic disturbance makes" in told(
        "disturbance.amplitude_N_m=[0.1,0.2,0.01]"
    )
    assert "control period over τ" in told("control.period_s=1", "simulation.save_every_s=1")
    assert "constant disturbance" in told("disturbance.constant_N_m=[0,0,1e-4]")
    assert not told("disturbance.constant_N_m=[1e-4,0,0]")
    assert not told()


@pytest.mark.parametrize("seed", [42, 58])
def test_a_turn_is_found_where_iteration_from_the_orbit_frame_finds_none(seed):
    """SLSQP of SciPy from many starts finds none nearer."""
    turn = Rotation.random(random_state=seed).as_matrix()
    inertia = turn @ np.diag([2.0, 2.5, 3.0]) @ turn.T
    normal = Rotation.random(random_state=seed + 999).as_matrix()[0]

    def balance(v):
        return missing_torque(inertia, normal, v, False)

    assert _iterate(balance, 3.0, np.zeros(3)) is None
    found = nearest_held(inertia, normal, False)
    assert abs(balance(found)) < 1e-5

    starts = np.random.default_rng(seed).normal(size=(8, 3))
    equal = {"type": "eq", "fun": balance}
    tried = [minimize(lambda v: v @ v, one, constraints=equal) for one in starts]
    least = min(np.linalg.norm(one.x) for one in tried if one.success)
    assert np.linalg.norm(found) <= least + 1e-4


def told_of_end_game(changes):
    found = []
    scenario = load("acceptance-nominal", changes, caution=found.append)
    return [one for one in found if "oscillation" in one], scenario


@pytest.mark.parametrize("law", ["oscillatory", "three-slew"])
def test_an_end_game_beyond_the_tolerances_is_told(law):
    """The oscillation of the law as it is built, and tolerances just above and below it."""
    changes = [f"control.law={law}", "control.period_s=0.25", "spacecraft.torque_limit_N_m=3"]
    game = build(told_of_end_game(changes)[1]).loop.controller.fine.end_game
    rate = np.sqrt(2) * float(game.largest_amplitude)
    for key, reached in (("rate_rad_s", rate), ("tilt_rad", rate / float(game.frequency))):
        assert told_of_end_game([*changes, f"settled.{key}={1.001 * reached}"])[0] == []
        (text,) = told_of_end_game([*changes, f"settled.{key}={0.999 * reached}"])[0]
        assert f"settled.{key}: should be above" in text


def test_a_flat_topped_end_game_tilts_the_body_further():
    """By at most π/2, the area of half a square wave over that of a sine."""
    changes = ["control.law=three-slew", "control.period_s=0.25", "spacecraft.torque_limit_N_m=3"]
    changes = [*changes, "disturbance.gravity_gradient=true"]
    game = build(told_of_end_game(changes)[1]).loop.controller.fine.end_game
    sines = np.sqrt(2) * float(game.largest_amplitude / game.frequency)
    q = float(game.roundness)
    wave = sines * np.arccos(q) / np.sqrt(1 - q**2)
    bound = sines * np.pi / 2
    assert 0.9 * bound < wave < bound
    assert told_of_end_game([*changes, f"settled.tilt_rad={1.001 * bound}"])[0] == []
    (text,) = told_of_end_game([*changes, f"settled.tilt_rad={0.999 * bound}"])[0]
    assert "settled.tilt_rad: should be above" in text


def test_an_oscillation_of_sines_balances_half_of_what_any_periodic_rates_do():
    """The largest mean of c p1 p2 of periodic rates without a mean, |p| within the tolerance, by
    SciPy from random rates: square waves have c ω²/2, two sines in phase the c ω²/4 told, and the
    flattest waves of a law under gravity gradient lie between them."""
    inertia, plane = np.diag([3.0, 2.0, 4.0]), np.eye(3)[:, :2]
    rate, coupling, count = 1e-3, 0.25, 16

    def mean_product(x):
        first, second = x.reshape(2, count)
        return -np.mean(first * second)

    def slope(x):
        first, second = x.reshape(2, count)
        return -np.concatenate([second, first]) / count

    within = {"type": "ineq", "fun": lambda x: 1 - np.sum(x.reshape(2, count) ** 2, axis=0)}
    no_mean = {"type": "eq", "fun": lambda x: x.reshape(2, count).mean(axis=1)}
    start = 0.3 * np.random.default_rng(0).normal(size=2 * count)
    best = minimize(mean_product, start, jac=slope, constraints=[within, no_mean], method="SLSQP")
    assert best.success
    most = coupling * rate**2 * -best.fun
    assert most == pytest.approx(coupling * rate**2 / 2, rel=1e-5)
    told = rest_drift(inertia, plane, 1e-3, gravity_gradient=True, tolerances=(0.1, 0.05, rate))
    assert told.oscillation == pytest.approx(most / 2, rel=1e-5)
    phase = np.linspace(0, 2 * np.pi, 1000, endpoint=False)
    sines = rate / np.sqrt(2) * np.sin(phase)
    assert told.oscillation == pytest.approx(coupling * np.mean(sines**2))
    flat = rate / np.sqrt(2) * np.sin(np.arctan2(np.sin(phase), np.cos(phase) / 8))
    told = told._replace(attitude=0.0)
    assert told.balanced == pytest.approx(coupling * np.mean(flat**2))
    assert told.most_balanced == pytest.approx(most, rel=1e-5)
    alone = rest_drift(inertia, plane, 1e-3, gravity_gradient=False, tolerances=(0.1, 0.05, rate))
    assert alone.balanced == alone.attitude + alone.oscillation
