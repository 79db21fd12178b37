"""Tables `[[magnetorquer]]` and `[unloading]`: what is made of them, and mistakes."""

from typing import ClassVar

import jax.numpy as jnp
import numpy as np
import pytest
from pydantic import ValidationError

from helpers.magnetic import document
from jaxsat.report.controllability_study import controllability_study
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.run import build
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.magnetorquers import MagneticSteering, Magnetorquers
from jaxsat.spacecraft.steering import AbstractSteering, Steered


def made(data) -> SampledLoop:
    loop = build(Scenario.model_validate(data)).loop
    assert isinstance(loop, SampledLoop)
    return loop


def steering_of(data) -> MagneticSteering:
    (steering,) = made(data).distribution.steering
    assert isinstance(steering, MagneticSteering)
    return steering


def test_what_is_asked_of_magnetorquers_depends_on_the_wheels():
    alone = steering_of(document())
    np.testing.assert_array_equal(alone.command_part, np.eye(3))
    assert alone.wheel_axes is None
    two = steering_of(document(2))
    assert two.unloading == 2e-3
    np.testing.assert_array_equal(two.bias, np.zeros(3))
    normal = np.linalg.svd(np.asarray(two.wheel_axes))[0][:, 2]
    np.testing.assert_allclose(two.command_part, np.outer(normal, normal), atol=1e-14)
    three = steering_of(document(3))
    np.testing.assert_array_equal(three.command_part, np.zeros((3, 3)))


def test_one_that_has_failed_is_asked_nothing():
    data = document()
    data["magnetorquer"][1]["failed"] = True
    steering = steering_of(data)
    assert not np.any(steering.shares[1])
    np.testing.assert_allclose(steering.axes @ steering.shares[:, 0], [1, 0, 0], atol=1e-14)


class Powerless(AbstractSteering):
    """Magnetorquers whose limits are zero."""

    kind: ClassVar[str] = Magnetorquers.kind

    of: MagneticSteering

    def __call__(self, t, state, command):
        del t, state
        return jnp.zeros(self.of.axes.shape[1]), command

    def within_reach(self, t, state, torque):
        return self.of.within_reach(t, state, torque)


def test_a_torque_that_no_dipole_makes_is_not_missed():
    """Missing is the least-squares fit of the torques of three dipoles to the command."""
    run = build(Scenario.model_validate(document()))
    (steering,), state = run.loop.distribution.steering, run.start
    t, torque = jnp.array(0.0), np.array([0.3, -0.8, 0.5])
    shares = Steered((Powerless(steering),))(
        t, state, jnp.asarray(torque), run.loop.plant.effectors
    )
    field = np.asarray(steering.field.in_body(t, state.attitude))
    columns = 1e5 * np.cross(np.asarray(steering.axes).T, field).T
    fit = columns @ np.linalg.lstsq(columns, torque, rcond=1e-9)[0]
    np.testing.assert_allclose(shares.remainder, fit, atol=1e-12)
    assert 0.1 < np.linalg.norm(fit) < 0.99 * np.linalg.norm(torque)


def test_beside_wheels_only_what_is_beyond_the_limits_is_missed():
    """By hand: wheels offset what dipoles do about their axes, so the rest of their lack is."""
    run = build(Scenario.model_validate(document(2)))
    (steering,), state = run.loop.distribution.steering, run.start
    field = np.asarray(steering.field.in_body(jnp.array(0.0), state.attitude))
    normal = np.linalg.svd(np.asarray(steering.wheel_axes))[0][:, 2]
    columns = np.cross(np.asarray(steering.axes).T, field).T
    for size, saturates in ((1e-7, False), (1e-3, True)):
        torque = size * np.array([0.3, -0.8, 0.5])
        effectors = run.loop.plant.effectors
        shares = run.loop.distribution(jnp.array(0.0), state, jnp.asarray(torque), effectors)
        (dipoles,) = (
            use
            for one, use in zip(effectors, shares.uses, strict=True)
            if one.kind == Magnetorquers.kind
        )
        asked = normal * (normal @ torque) - 2e-3 * np.asarray(steering.excess(state))
        fit = asked - field * (field @ asked) / (field @ field)  # three rods make it all
        lack = normal * (normal @ (fit - columns @ np.asarray(dipoles)))
        np.testing.assert_allclose(shares.remainder, lack, atol=1e-9 * size)
        assert (np.linalg.norm(lack) > 0.1 * size) == saturates
        assert abs(normal @ field) < 0.99 * np.linalg.norm(field)


def _renamed(data):
    data["magnetorquer"][2]["name"] = "1"


def _law(data):
    data["control"] = {"law": "three-slew", "period_s": 0.5}


def _tolerant(data):
    data["control"] = {"law": "fault-tolerant", "natural_frequency_rad_s": 0.05}
    data["wheel"] = [{"axis": [1.0, 0.0, 0.0], "torque_limit_N_m": 1e-3}]
    _all_failed(data)


def _inertial(data):
    data["orbit"] = {"rate_rad_s": 0.0}


def _all_failed(data):
    for one in data["magnetorquer"]:
        one["failed"] = True


def _unloading(data):
    data["unloading"] = {"time_constant_s": 10.0}


def _bias_alone(data):
    data["unloading"] = {"bias_N_m_s": 0.1}


def _bias_across(data):
    data["wheel"] = [{"axis": [1.0, 0.2, 0.0], "momentum_N_m_s": 0.02}]
    data["unloading"] = {"bias_N_m_s": 0.1}


def _turned(data):
    data["failure"] = [
        {"of": "magnetorquer 1", "at_s": 1.0, "kind": "turned", "turn_rad": [1.0, 0.0, 0.0]}
    ]


def _unknown(data):
    data["failure"] = [{"of": "magnetorquer 9", "at_s": 1.0, "kind": "dead"}]


@pytest.mark.parametrize(
    ("mistake", "said"),
    [
        (_renamed, "must be a name of its own"),
        (_law, 'commands three torques .*"quaternion-feedback"'),
        (
            _tolerant,
            "two axes at least where neither thrusters nor magnetorquers make",
        ),
        (_inertial, "must be that of an orbit above the ground"),
        (_all_failed, "must leave one that works"),
        (_unloading, r"got time_constant_s = 10.0 without \[\[wheel\]\]"),
        (_bias_alone, r"must belong to wheels and magnetorquers.* without \[\[wheel\]\]"),
        (_bias_across, "must be 0 where the wheels left make no torque about body y alone"),
        (_turned, "must be one of dead, degraded, stuck-on, stuck-at, reversed"),
        (_unknown, '"magnetorquer 3"'),
    ],
)
def test_mistakes_are_told(mistake, said):
    data = document()
    mistake(data)
    with pytest.raises(ValidationError, match=said):
        Scenario.model_validate(data)


@pytest.mark.slow
def test_momentum_of_wheels_that_suffice_is_taken_by_magnetorquers_that_work():
    data = document(wheels=3)
    lines = "\n".join(controllability_study(Scenario.model_validate(data)).lines)
    assert "N m s in total at the start; magnetorquers take momentum across the field" in lines
    for one in data["magnetorquer"]:
        one["failed"] = True
    del data["unloading"]
    lines = "\n".join(controllability_study(Scenario.model_validate(data)).lines)
    assert "conserved: no actuator removes momentum from the wheels" in lines
