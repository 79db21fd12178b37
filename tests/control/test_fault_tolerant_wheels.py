"""The law that diagnoses its wheels, in the loop: what it knows, and what it does."""

import dataclasses

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.effectors import effector_of
from jaxsat.control.diagnosis.isolation import DiagnosedKind
from jaxsat.control.diagnosis.residual import Reading
from jaxsat.control.tolerant_actuators import Sample, TolerantMode
from jaxsat.core.attitude import Quaternion
from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels
from jaxsat.store.dataset import trajectory_dataset


def refuse(obstacle):
    raise AssertionError(obstacle)


class Told(eqx.Module):
    """Sensors that tell what was written down beforehand, whatever the truth is."""

    values: jax.Array

    def is_valid(self, sample, period):
        """They have no outages."""

    def first_readings(self):
        """They do not fail."""

    def __call__(self, sample, *truth):
        now = self.values[jnp.minimum(sample, len(self.values) - 1)]
        if len(truth) == 1:  # the tachometers
            return (WheelMomenta(now[7:]),)
        return type(truth[0])(now[:4]), now[4:7]


@pytest.mark.slow
def test_law_and_detector_see_estimates_readings_and_commands_alone():
    """The truth differs in body, wheels and failure; what is told does not."""
    run = build(load("failures-telescope", ["simulation.duration_s=20"], caution=print))
    rng = np.random.default_rng(5)
    attitude = np.array([0.9, 0.3, -0.2, 0.1]) + 1e-4 * rng.normal(size=(210, 4))
    attitude /= np.linalg.norm(attitude, axis=1)[:, None]
    rates = np.cumsum(1e-5 * rng.normal(size=(210, 3)), 0)
    momenta = np.cumsum(0.02 * rng.normal(size=(210, 4)), 0)
    told = Told(jnp.asarray(np.concatenate([attitude, rates, momenta], axis=1)))
    one = eqx.tree_at(lambda loop: (loop.sensors, loop.tachometers), run.loop, (told, told))
    other = eqx.tree_at(
        lambda loop: (
            loop.plant.spacecraft.inertia,
            effector_of(loop.plant, Wheels).axes,
            effector_of(loop.plant, Wheels).failures.at,
        ),
        one,
        (
            0.7 * one.plant.spacecraft.inertia,
            effector_of(one.plant, Wheels).axes[:, ::-1],
            effector_of(one.plant, Wheels).failures.at - 300.0,
        ),
    )
    first, second = (dataclasses.replace(run, loop=loop).simulate(refuse) for loop in (one, other))
    assert np.abs(np.asarray(first.signals.omega - second.signals.omega)).max() > 1e-3
    for x, y in zip(
        jax.tree.leaves(first.final.memory), jax.tree.leaves(second.final.memory), strict=True
    ):
        np.testing.assert_array_equal(x, y)
    assert bool(np.any(np.asarray(first.signals.parts["alarm"]) > 0))


@pytest.mark.slow
def test_two_of_four_wheels_fail_and_two_settle():
    run = build(load("wheels-fail", ["simulation.duration_s=900"]))
    trajectory = run.simulate()
    signals, times = trajectory.signals, np.asarray(trajectory.times)
    mode, kind = np.asarray(signals.mode), np.asarray(signals.parts["diagnosed_kind"])
    assert np.all(mode[times < 120] == TolerantMode.THREE_AXES)
    assert kind[-1].tolist() == [DiagnosedKind.DEAD, DiagnosedKind.STOPPED, -1, -1]
    assert np.all(kind[times < 120] < 0)
    assert np.all(kind[times < 360, 1] < 0)
    assert 360 < times[np.argmax(kind[:, 1] >= 0)] < 365
    assert np.all(mode[(times > 200) & (times < 360)] == TolerantMode.REALLOCATED)
    assert mode[-1] == TolerantMode.TWO_WHEELS
    assert np.count_nonzero(np.diff(mode[mode != TolerantMode.ALARM])) < 6  # no chatter
    assert float(trajectory.assessment.settled_from) < 800
    momentum = np.asarray(signals.parts["wheel_momentum"])
    assert np.abs(momentum).max() < 0.5 * 20.0
    data = trajectory_dataset(trajectory, modes=run.modes)
    assert data["diagnosed_kind"].dims == ("time", "wheel")


@pytest.mark.slow
def test_every_kind_that_leaves_enough_settles():
    found = build_study(load("failures-telescope"), 24, seed=7).values(np.arange(24))
    recovered = np.isfinite(found["settling_time"])
    lost = found["torques_left"] == 7  # the momentum of a runaway
    assert 1 < np.count_nonzero(lost) < 10
    assert np.all(recovered[~lost])
    assert not found["false_alarms"].any()
    wrong = (found["isolated_kind"] > 0) & (np.arange(4) != found["failed_part"])
    assert not wrong.any()


def test_damping_takes_energy_out_whatever_is_left():
    run = build(load("failures-telescope"))
    law = run.loop.controller
    (wheels,) = law.actuators
    axes = np.asarray(wheels.filter.wheels.axes)
    rng = np.random.default_rng(6)
    memory = law.init(run.loop.plant.complete(run.start))
    for omega in rng.normal(size=(10, 3)) * 1e-3:
        state = PlantState(run.start.attitude, omega, (WheelMomenta(np.zeros(4)),))
        torque = np.asarray(
            wheels.damping(
                Sample(jnp.array(0.0), state, Reading(omega), law.healthy), memory.actuators[0]
            )
        )
        assert torque[0] == 0  # it had failed before the start
        assert np.all(torque[1:] * (omega @ axes[:, 1:]) < 0)


@pytest.mark.slow
def test_two_wheels_with_momentum_rest_at_the_nearest_attitude_that_they_hold():
    """A body that turns at first. The angle of n to the target's one is that of n to H less 90
    degrees, with the conserved momentum H."""
    changes = ["initial.omega_rad_s=[2e-3, -1e-3, 2e-3]", "simulation.duration_s=1200"]
    run = build(load("wheels-fail", changes))
    trajectory = run.simulate()
    assert np.all(np.asarray(trajectory.signals.mode)[-400:] == TolerantMode.NEAREST)
    normal = np.ones(3) / np.sqrt(3)  # of wheels C and D
    momentum = [420, 380, 250] * np.array([2e-3, -1e-3, 2e-3])
    momentum = np.asarray(run.start.attitude.as_dcm().matrix).T @ momentum
    angle = abs(np.arcsin(normal @ momentum / np.linalg.norm(momentum)))
    assert angle > 0.1
    turned = np.asarray(trajectory.signals.quaternion)[-200:, 0]
    np.testing.assert_allclose(2 * np.arccos(np.abs(turned)), angle, atol=0.01)
    assert np.abs(np.asarray(trajectory.signals.omega)[-200:]).max() < 5e-4


@pytest.mark.slow
def test_much_momentum_about_the_axis_without_a_wheel_is_damped_and_not_chased():
    """Two wheels go to no attitude, and do not spin the body up."""
    changes = ["initial.omega_rad_s=[8e-3, -4e-3, 8e-3]", "simulation.duration_s=500"]
    trajectory = build(load("wheels-fail", changes)).simulate()
    assert np.all(np.asarray(trajectory.signals.mode)[-200:] == TolerantMode.DAMPING)
    rates = np.linalg.norm(np.asarray(trajectory.signals.omega), axis=1)
    assert rates[-200:].max() < rates[0]
    assert not np.isfinite(float(trajectory.assessment.settled_from))


@pytest.mark.parametrize(
    ("change", "key"),
    [
        ("wheel=[{axis=[0, 0, 1], torque_limit_N_m=1.0}]", "wheel"),
        ("spacecraft.thruster_torque_axes=[[1.0, 0.0, 0.0]]", "spacecraft.thruster_torque_axes"),
        (
            "gimbal=[{axis=[0, 0, 1], spin_axis=[1, 0, 0], rotor_momentum_N_m_s=1, "
            "rate_limit_rad_s=1}]",
            "gimbal",
        ),
        (
            "wheel=[{axis=[1, 0, 0]}, {axis=[0, 1, 0]}, {axis=[0, 0, 1]}]",
            "wheel.torque_limit_N_m",
        ),
    ],
)
def test_the_law_needs_wheels_about_three_axes_with_limits_and_nothing_else(change, key):
    with pytest.raises(ScenarioError) as caught:
        load("wheels-fail", [change, "failure=[]"])
    assert any(
        problem.key == key and "fault-tolerant" in problem.message
        for problem in caught.value.problems
    ), [(problem.key, problem.message) for problem in caught.value.problems]


def test_the_law_commands_the_motor_of_each_wheel():
    loop = build(load("wheels-fail")).loop
    command, told = jnp.arange(4.0), PlantState(Quaternion([1.0, 0, 0, 0]), np.zeros(3))
    (wheels,) = loop.plant.effectors
    assert isinstance(wheels, Wheels)
    shares = loop.distribution(jnp.zeros(()), told, command, loop.plant.effectors)
    (asked,) = shares.uses
    np.testing.assert_array_equal(asked, command)


@pytest.mark.slow
def test_wheels_of_unequal_momentum_slew_where_they_hold_it_together():
    """0.4 times what they can hold: the smallest was full after 130 s, and the body never turned to
    its target."""
    each = zip(
        ("[1,0,1]", "[0,1,1]", "[-1,0,1]", "[0,-1,1]"),
        (0.2, 0.2, 0.1, 0.1),
        (40, 20, 10, 5),
        (12, -5, 0, 4),
        strict=True,
    )
    rows = ",".join(
        f"{{axis={axis},torque_limit_N_m={torque},momentum_limit_N_m_s={most},momentum_N_m_s={now}}}"
        for axis, torque, most, now in each
    )
    changes = [
        f"wheel=[{rows}]",
        "failure=[]",
        "dispersion={}",
        "spacecraft.inertia_kg_m2=[900,800,500]",
        "orbit={altitude_km=550}",
        "disturbance={gravity_gradient=true}",
        "initial={quaternion=[0.8,0.36,-0.48,0],omega_rad_s=[2e-3,-1e-3,1e-3]}",
        "control.natural_frequency_rad_s=0.03",
        "simulation.duration_s=800",
    ]
    trajectory = build(load("wheels-fail", changes)).simulate()
    assert float(trajectory.assessment.settled_from) < 700
    momentum = np.abs(np.asarray(trajectory.signals.parts["wheel_momentum"]))
    assert np.all(momentum[-1] < 0.9 * np.array([40, 20, 10, 5]))
