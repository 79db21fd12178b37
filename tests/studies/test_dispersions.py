"""Every dispersed name reaches the model, and only possible bodies are drawn."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helpers.effectors import effector_of
from helpers.paper import (
    PAPER_THREE_AXIS,
    three_axis_loop,
    three_axis_start,
)
from helpers.switching import start
from jaxsat.core import noise
from jaxsat.core.attitude import Quaternion
from jaxsat.spacecraft.wheels import Wheels
from jaxsat.studies.changes import possible_body, possible_inertia
from jaxsat.studies.designs import Independent
from jaxsat.studies.dispersions import RATES, Dispersed, Dispersions, with_gains
from jaxsat.studies.distributions import Normal, RandomAttitude, Uniform
from jaxsat.studies.quantities import QUANTITIES
from studies.copies import backstepping, copies_of, sampled

J = np.array([449.5, 264.6, 312.5])


def models(loop):
    law = loop.controller
    return [law.rate_law.model, law.three_axis_law.model]


def of_both_models(read):
    """What is read of the model of the rate law and of that of the three-axis law."""

    def read_both(copy):
        one, other = map(read, models(copy.loop))
        np.testing.assert_array_equal(one, other)
        return one

    return read_both


def tilted(copy):
    return jax.vmap(lambda a: a.as_wz())(copy.start.attitude)


def periodic(copy):
    """The periodic torque, alone or with a constant one."""
    disturbance = copy.loop.plant.disturbance
    return getattr(disturbance, "terms", [disturbance])[0]


REACHES = {
    "inertia": lambda c: np.diagonal(c.loop.plant.spacecraft.inertia, axis1=1, axis2=2) / J - 1,
    "products_of_inertia": lambda c: (
        c.loop.plant.spacecraft.inertia[:, [0, 0, 1], [1, 2, 2]] / 264.6
    ),
    "torque_gain": lambda c: np.linalg.norm(c.loop.plant.effectors[0].torque_axes, axis=1) - 1,
    "disturbance_amplitude": lambda c: periodic(c).amplitude / np.array([0.01, 0.02, 0.001]) - 1,
    "disturbance_frequency": lambda c: periodic(c).frequency / np.array([0.7, 0.8, 0.1]) - 1,
    "disturbance_phase": lambda c: periodic(c).phase,
    "constant_torque": lambda c: c.loop.plant.disturbance.terms[1].torque,
    "model_inertia": of_both_models(
        lambda m: np.diagonal(m.spacecraft.inertia, axis1=1, axis2=2) / J - 1
    ),
    "model_orbit_rate": of_both_models(lambda m: m.orbit.rate[:, None] / 0.0011 - 1),
    "rate_noise": lambda c: c.loop.sensors.rate_noise[:, None],
    "attitude_noise": lambda c: c.loop.sensors.attitude_noise[:, None],
    "delay": lambda c: c.loop.delay[:, None],
    "attitude": lambda c: c.start.attitude.q,
    "tilt": lambda c: np.linalg.norm(tilted(c).w, axis=1)[:, None],
    "tilt_direction": lambda c: jnp.arctan2(tilted(c).w[:, 1], tilted(c).w[:, 0])[:, None],
    "turn": lambda c: tilted(c).z[:, None],
    "omega": lambda c: c.start.omega,
}


FAILURES = {"failure_time", "failed_thruster", "failed_wheel", "failure_kind", "failure_amount"}
"""Of real actuators: tests/scenario/build/test_thrusters_as_parts.py and test_failing_wheels.py."""

OF_SENSORS = ("gyro", "tracker", "magnetometer", "sun_sensor", "horizon_sensor")
SENSORS = {name for name in QUANTITIES if name.startswith(OF_SENSORS)}
"""Of loops with an estimator: tests/control/navigation/test_dispersed_sensors.py."""

FAILING_SENSORS = {"sensor_failure_time"}
"""In tests/scenario/build/test_failing_sensors.py."""

MAGNETORQUERS = {"dipole_limit", "magnetorquer_misalignment", "failed_magnetorquer"}
GYROS = {"rotor_momentum", "failed_gimbal"}
"""In tests/scenario/test_gimbals.py."""

MODES = {"mode_coupling", "mode_frequency", "mode_damping"}
"""In tests/scenario/test_flexible_modes.py."""

OTHERWISE = {"misalignment", "attitude_error", "rate_error", "wheel_momentum", "rotor_inertia"}
OTHERWISE |= {*FAILURES, *SENSORS, *FAILING_SENSORS, *MAGNETORQUERS, *GYROS, *MODES}


def test_every_quantity_has_its_test():
    assert set(REACHES) | OTHERWISE == set(QUANTITIES)


TOGETHER = sorted(REACHES.keys() - {"attitude"})
"""What can be dispersed at once: `attitude` draws what `tilt` and `turn` displace."""


def assert_reached(copy, name):
    drawn = copy.drawn[name]
    np.testing.assert_allclose(
        REACHES[name](jax.tree.map(np.asarray, copy)), drawn, rtol=1e-9, atol=1e-12
    )
    assert len(np.unique(drawn)) == drawn.size
    assert jnp.all(copy.possible)


@pytest.fixture(scope="module")
def together():
    return copies_of(sampled(), 5, **dict.fromkeys(TOGETHER, Uniform(0.01, 0.06)))


@pytest.mark.parametrize("name", TOGETHER)
def test_dispersed_quantities_reach_the_model_beside_one_another(together, name):
    assert_reached(together, name)


@pytest.mark.parametrize(
    "name", ["attitude", *(pytest.param(name, marks=pytest.mark.slow) for name in TOGETHER)]
)
def test_a_dispersed_quantity_reaches_the_model(name):
    distribution = RandomAttitude() if name == "attitude" else Uniform(0.01, 0.06)
    copy = copies_of(sampled(), 5, **{name: distribution})
    assert_reached(copy, name)
    assert np.ptp(copy.start.omega, axis=0).any() == (name in RATES)


def test_misalignment_reaches_the_torque_axes():
    """Of each thruster its own pair, towards two directions across it that stay the same."""
    copy = copies_of(sampled(), 5, misalignment=Uniform(-0.02, 0.02))
    axes = np.asarray(copy.loop.plant.effectors[0].torque_axes)
    drawn = np.asarray(copy.drawn["misalignment"]).reshape(5, 2, 2)
    for j in range(2):
        across = np.delete(axes[:, :, j], j, axis=1) / axes[:, j, j, None]
        directions = np.linalg.lstsq(drawn[:, j], across, rcond=None)[0]
        np.testing.assert_allclose(drawn[:, j] @ directions, across, atol=1e-15)
        np.testing.assert_allclose(directions @ directions.T, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(np.linalg.norm(axes, axis=1), 1.0, rtol=1e-14)
    nominal = sampled().plant.effectors[0].thrust_map
    np.testing.assert_array_equal(copy.loop.plant.effectors[0].thrust_map, jnp.stack([nominal] * 5))


def test_an_attitude_error_is_a_rotation_vector():
    copy = copies_of(sampled(), 5, attitude_error=Uniform(-1.5, 1.5))
    nominal = np.asarray(start().attitude.as_dcm().matrix)
    for q, rotation in zip(copy.start.attitude.q, copy.drawn["attitude_error"], strict=True):
        expected = Rotation.from_rotvec(-np.asarray(rotation)).as_matrix() @ nominal
        np.testing.assert_allclose(Quaternion(q).as_dcm().matrix, expected, atol=1e-12)


def test_a_rate_error_counts_from_the_reference_at_the_dispersed_attitude():
    loop, begin = backstepping(), three_axis_start(PAPER_THREE_AXIS)
    ranges = {"rate_error": Uniform(-0.03, 0.03), "tilt": Uniform(0.5, 1.2)}
    copy = copies_of(loop, 5, begin=begin, **ranges)
    for i in range(5):
        state = jax.tree.map(lambda x, i=i: x[i], copy.start)
        error = loop.controller.rate_error(state)
        np.testing.assert_allclose(error, copy.drawn["rate_error"][i], atol=1e-14)
        assert 0.5 < jnp.linalg.norm(state.attitude.w) < 1.2
    assert "rate_error" in RATES
    assert np.ptp(copy.start.omega, axis=0).any()


@pytest.mark.slow
def test_dispersions_add_up_and_leave_the_rest_alone():
    ranges = {"inertia": Uniform(-0.1, 0.1), "model_inertia": Uniform(-0.1, 0.1)}
    copy = copies_of(sampled(), 3, constant_torque=Uniform(-1.0, 1.0), **ranges)
    for name in ("inertia", "model_inertia", "constant_torque"):
        np.testing.assert_allclose(
            REACHES[name](jax.tree.map(np.asarray, copy)), copy.drawn[name], rtol=1e-9, atol=1e-12
        )
    nominal = sampled()
    np.testing.assert_array_equal(
        copy.loop.plant.effectors[0].torque_axes[1], nominal.plant.effectors[0].torque_axes
    )
    periodic = copy.loop.plant.disturbance.terms[0]
    np.testing.assert_array_equal(periodic.amplitude[1], nominal.plant.disturbance.amplitude)


def test_the_internal_model_follows_the_frequency_only_if_asked():
    for known in (True, False):
        copy = copies_of(sampled(), 3, known=known, disturbance_frequency=Uniform(-0.2, 0.2))
        believed = copy.loop.controller.three_axis_law.internal_model.frequency
        true = copy.loop.plant.disturbance.frequency[:, :2]
        assert bool(jnp.all(believed == true)) is known


def test_every_case_has_a_sensor_key_of_its_own():
    copy = copies_of(sampled(), 4, turn=Uniform(-1.0, 1.0))
    keys = copy.loop.sensors.key
    assert len({tuple(map(int, key)) for key in keys}) == 4
    own = noise.fold_in(noise.key_of_seed(3), 2)
    expected = noise.fold_in(own, noise.name_number("sensor noise"))
    np.testing.assert_array_equal(keys[2], expected)


@pytest.mark.slow
def test_only_possible_bodies_are_drawn():
    """From a spread that makes about a third of all draws impossible, against eigenvalues."""
    ranges = {"inertia": Normal(0.0, 0.25), "products_of_inertia": Normal(0.0, 0.2)}
    copy = copies_of(sampled(), 400, **ranges)
    assert jnp.all(copy.possible)
    inertia = np.asarray(copy.loop.plant.spacecraft.inertia)
    low, middle, high = np.linalg.eigvalsh(inertia).T
    assert np.all((low > 0) & (low + middle > high))
    study = Dispersed(sampled(), start(), Dispersions(ranges), 3)
    points = Independent(3).points(np.arange(400), study.dimensions())
    first = jax.vmap(ranges["inertia"].quantile)(jnp.array(points[:, :3]))
    kept = np.isclose(first, copy.drawn["inertia"]).all(axis=1)
    assert 0.4 < kept.mean() < 0.95


def test_possible_inertia_against_eigenvalues():
    rng = np.random.default_rng(0)
    for _ in range(200):
        half = rng.normal(size=(3, 3))
        inertia = half @ half.T + 0.1 * np.diag(rng.normal(size=3))
        low, middle, high = np.linalg.eigvalsh(inertia)
        assert bool(possible_inertia(jnp.array(inertia))) is bool(low > 0 and low + middle > high)


def test_the_rotors_of_all_effectors_are_part_of_the_body():
    """The body has 264.6 kg m² about y."""
    loop, axis = sampled(), np.array([[0.0], [1.0], [0.0]])
    both = tuple(Wheels(axis, rotor_inertia=[100.0]) for _ in range(2))
    loop = dataclasses.replace(loop, plant=loop.plant.with_effectors(both))
    assert possible_body(loop)

    def numbers(loop):
        return [one.rotor_inertia for one in loop.plant.effectors]

    for first, second, possible in ((150.0, 100.0, True), (150.0, 150.0, False), (-1, 2, False)):
        drawn = [jnp.array([first]), jnp.array([second])]
        assert bool(possible_body(eqx.tree_at(numbers, loop, drawn))) is possible


def test_a_case_without_a_possible_body_says_so():
    copy = copies_of(sampled(), 3, inertia=Uniform([2.0, -0.5, -0.5], [3.0, -0.4, -0.4]))
    assert not jnp.any(copy.possible)


def test_gains_displace_those_of_the_controller():
    loop = with_gains(sampled(), {"three_axis_law.k3": jnp.array(0.3)})
    assert loop.controller.three_axis_law.k3 == 0.3
    assert loop.controller.three_axis_law.mu == sampled().controller.three_axis_law.mu


@pytest.mark.parametrize(
    ("loop", "distributions", "message"),
    [
        (sampled, {"inerta": Uniform(0.0, 1.0)}, "must be among"),
        (sampled, {"omega": Uniform([0.0, 0.0], [1.0, 1.0])}, "must have 3 components"),
        (sampled, {"omega": RandomAttitude()}, "RandomAttitude"),
        (sampled, {"attitude": Uniform(0.0, 1.0)}, "RandomAttitude"),
        (sampled, {"rate_error": Uniform(0.0, 1.0)}, "no reference rate"),
        (backstepping, {"delay": Uniform(0.0, 0.1)}, "no delay"),
        (backstepping, {"rate_noise": Uniform(0.0, 0.1)}, "sensors"),
        (backstepping, {"omega": Uniform(0.0, 1.0), "rate_error": Uniform(0.0, 1.0)}, "both"),
        (lambda: three_axis_loop(PAPER_THREE_AXIS), {"inertia": Uniform(0.0, 0.1)}, "ideal"),
    ],
)
def test_what_cannot_be_dispersed_is_refused(loop, distributions, message):
    with pytest.raises(ValueError, match=message):
        Dispersed(loop(), start(), Dispersions(distributions), 0)


def test_rotors_are_dispersed_in_the_plant_alone_and_stay_a_part_of_the_body():
    """Draws of more than the body has, 264.6 kg m² about y, are drawn again."""
    loop, axes = sampled(), np.eye(3)[:, :2]
    wheels = Wheels(axes, rotor_inertia=[100.0, 50.0])
    loop = dataclasses.replace(
        loop, plant=dataclasses.replace(loop.plant, effectors=(*loop.plant.effectors, wheels))
    )
    copy = copies_of(loop, 60, rotor_inertia=Uniform([-0.5, -0.9], [0.5, 9.0]))
    found = np.asarray(effector_of(copy.loop.plant, Wheels).rotor_inertia)
    np.testing.assert_allclose(found, [100.0, 50.0] * (1 + np.asarray(copy.drawn["rotor_inertia"])))
    assert found[:, 1].max() < 264.6
    assert np.ptp(found[:, 1]) > 150
    assert np.ptp(np.asarray(copy.loop.plant.spacecraft.inertia), axis=0).max() == 0
    believed = np.asarray(copy.loop.controller.rate_law.model.spacecraft.inertia)
    assert np.ptp(believed, axis=0).max() == 0
