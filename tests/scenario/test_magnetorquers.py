"""Tables `[[magnetorquer]]` and `[unloading]`: what is made of them, and mistakes."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from pydantic import ValidationError

from helpers.magnetic import document
from jaxsat.control.steering import MagneticSteering
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.run import build
from jaxsat.simulation.sampled_loop import SampledLoop


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
    np.testing.assert_array_equal(alone.wanted, np.eye(3))
    assert alone.wheel_axes is None
    two = steering_of(document(2))
    assert two.unloading == 2e-3
    np.testing.assert_array_equal(two.bias, np.zeros(3))
    normal = np.linalg.svd(np.asarray(two.wheel_axes))[0][:, 2]
    np.testing.assert_allclose(two.wanted, np.outer(normal, normal), atol=1e-14)
    three = steering_of(document(3))
    np.testing.assert_array_equal(three.wanted, np.zeros((3, 3)))


def test_one_that_has_failed_is_asked_nothing():
    data = document()
    data["magnetorquer"][1]["failed"] = True
    steering = steering_of(data)
    assert not np.any(steering.shares[1])
    np.testing.assert_allclose(steering.axes @ steering.shares[:, 0], [1, 0, 0], atol=1e-14)


def test_what_no_magnetorquer_can_make_is_not_missed():
    """Of a torque within their limits nothing; of a larger one what is across the field."""
    run = build(Scenario.model_validate(document()))
    loop, state = run.loop, run.start
    (steering,) = loop.distribution.steering
    field = np.asarray(steering.field.in_body(jnp.array(0.0), state.attitude))
    unit = field / np.linalg.norm(field)
    share = jax.jit(
        lambda wanted: loop.distribution(jnp.array(0.0), state, wanted, loop.plant.effectors)
    )
    for size in (1e-9, 1.0):
        torque = size * np.array([0.3, -0.8, 0.5])
        shares = share(torque)
        across = torque - unit * (unit @ torque)
        dipoles = np.asarray(shares.uses[0])
        made_of_it = np.cross(np.asarray(steering.axes) @ dipoles, field)
        np.testing.assert_allclose(shares.left, across - made_of_it, atol=1e-12 * size)
        assert (np.linalg.norm(shares.left) > 0.5 * size) == (size == 1.0)


def _renamed(data):
    data["magnetorquer"][2]["name"] = "1"


def _law(data):
    data["control"] = {"law": "three-slew", "period_s": 0.5}


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
