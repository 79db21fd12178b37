"""An actuator of an installed package: failures, draws, signals and drawing as built-in ones."""

import os
import pkgutil
import subprocess
import sys
from collections.abc import Callable
from contextlib import nullcontext
from importlib.metadata import EntryPoint

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.core.declaration import actuators
from jaxsat.scenario.build.effector_trial import (
    _keeps_failure_in_piece,
    require_acts,
    require_steered,
)
from jaxsat.scenario.build.errors import BuildError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.spacecraft.effector import Effect
from jaxsat.spacecraft.gimbals import ControlMomentGyros, GimbalFailures
from jaxsat.spacecraft.spacecraft import PlantState
from jaxsat.spacecraft.steering import AbstractSteering
from scenario.packages import FROZEN, install_package

PACKAGE = FROZEN / "flywheels"

FLOWN = """
import sys
import jax
import numpy as np
from scipy.spatial.transform import Rotation
jax.config.update("jax_enable_x64", True)
from jaxsat.report.controllability_study import controllability_study
from jaxsat.scenario import dump, read
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.store import trajectory_dataset

scenario = read(sys.argv[1])
found = trajectory_dataset(build(scenario).simulate(), scenario=dump(scenario))
h = found["flywheel_momentum"]
assert h.attrs["units"] == "N m s" and list(h["flywheel"].values) == ["1", "y", "3"]
q = Rotation.from_quat(np.roll(found["quaternion"].values, -1, axis=1))
total = q.apply(found["omega"].values * [5.0, 4.0, 3.0] + h.values)
np.testing.assert_allclose(total, total[:1] * np.ones_like(total), atol=1e-10)
late = found["time"].values >= 15
assert np.ptp(h.values[late, 2]) == 0 and np.ptp(h.values[late, 1]) > 0.01
judged = controllability_study(scenario)
assert "Controllable: flywheels included, actuators make at least 0.2 N m" in judged.verdict
assert judged.findings == [
    "Flywheels (not in the table), one more loose: 0 of 3 cases leave three torques"
]
study = build_study(scenario, 2, seed=1)
values = study.values(np.arange(2))
assert values["peak_flywheel_momentum"].shape == (2, 3)
assert values["drawn_flywheel_momentum_start"].shape == (2, 3)
assert study.columns()["peak_flywheel_momentum"].dims == ("flywheel",)
"""


@pytest.mark.slow
def test_it_does_what_built_in_ones_do(tmp_path, monkeypatch):
    """The momentum of body and flywheels stays in inertial axes, whatever fails."""
    install_package(tmp_path, monkeypatch, PACKAGE)
    command = [sys.executable, "-c", FLOWN, PACKAGE / "flywheels.toml"]
    done = subprocess.run(command, capture_output=True, text=True, env=dict(os.environ))
    assert done.returncode == 0, done.stderr


@pytest.mark.parametrize(
    ("place", "said"),
    [
        ("no_such_module:ONE", "No module named 'no_such_module'"),
        ("jaxsat.core.declaration.actuators:GROUP", "must be an ActuatorDeclaration"),
        ("jaxsat.core.declaration.gimbals:GIMBAL", "names of its own, got gimbal, gimbal_angle"),
    ],
)
def test_one_that_cannot_be_used_is_left_out_and_told(monkeypatch, place, said):
    points = [EntryPoint("mine", place, actuators.GROUP)]
    monkeypatch.setattr(actuators, "entry_points", lambda group: points)
    with pytest.warns(UserWarning, match=said):
        assert actuators._installed() == ()


class Steering(AbstractSteering):
    """Of four wheels; what it gives for a command of three torques."""

    kind = "wheel"
    given: Callable = eqx.field(static=True)

    def __call__(self, t, state, command):
        return self.given(command)


@pytest.mark.parametrize(
    ("given", "said"),
    [
        (lambda command: (np.ones((4, 3)) @ command, 0 * command), None),
        (lambda command: (command, command), r"gives arrays of shapes \(\(4,\), \(3,\)\).*py:"),
        (lambda command: (np.eye(2) @ command, command), "can be run, got TypeError: .*py:"),
    ],
)
def test_a_steering_that_does_not_suit_the_loop_is_refused(given, said):
    run = build(load("wheels-fail"))
    refused = nullcontext() if said is None else pytest.raises(BuildError, match=f"wheel .*{said}")
    with refused:
        require_steered([Steering(given)], run.loop.plant.effectors, run.start)


def test_an_effector_puts_all_that_a_failure_changes_into_the_piece(monkeypatch):
    """A motor whose gain the failure changes on the effector alone would fly on as if sound."""
    monkeypatch.syspath_prepend(PACKAGE)
    flywheels = pkgutil.resolve_name("flywheels.effector")
    start = build(load("wheels-fail")).start
    failures = flywheels.FlywheelFailures([1.0], [10.0], [1.0], [0.5])
    sound = flywheels.Flywheels(jnp.eye(3), jnp.ones(3), failures)
    at_rest = PlantState(start.attitude, start.omega, (sound.init(),))
    require_acts([sound], at_rest)

    class Forgets(flywheels.Flywheels):
        gain: jnp.ndarray = eqx.field(default_factory=lambda: jnp.ones(3))

        def driven(self, state, command, struck):
            gain = self.failures.gain(struck, self.count)
            return eqx.tree_at(lambda x: (x.failures, x.gain), self, (None, gain)), command

        def effect(self, piece, t, plant, state):
            return Effect(self.axes @ (self.gain * piece))

    class Slow(flywheels.Flywheels):
        def derivative(self, piece, plant, state, acceleration):
            return flywheels.FlywheelMomenta(-piece[:2])

    class Flat(flywheels.Flywheels):
        def effect(self, piece, t, plant, state):
            return Effect(piece[:2])

    class Raises(flywheels.Flywheels):
        def piece(self, mode, command):
            raise KeyError("gain")

    arguments = (jnp.eye(3), jnp.ones(3), failures)
    for mistaken, message in (
        (Forgets, r'changes into the piece \(.*py:\d+\), got another effect of "loose"'),
        (Slow, r"gives the rate of its state, float64 \(3,\) .*py:\d+\), got float64 \(2,\)"),
        (Flat, r"gives a torque of shape \(3,\) .*py:\d+\), got \(2,\)"),
        (Raises, r"can be run, got KeyError: 'gain' .*py:\d+"),
    ):
        with pytest.raises(BuildError, match=f'flywheel .*"{mistaken.__name__}" .*{message}'):
            require_acts([mistaken(*arguments)], at_rest)


def test_own_effectors_put_all_that_a_failure_changes_into_the_piece():
    run = build(load("wheels-fail"))
    gyros = ControlMomentGyros(
        np.eye(3), np.eye(3)[[1, 2, 0]], 2.0, 1.0, GimbalFailures([1.0], [10.0], [1.0], [5.0])
    )
    for one, own in ((run.loop.plant.effectors[0], run.start.of_each[0]), (gyros, gyros.init())):
        assert one.failures is not None
        for kind in one.failures.kinds:
            assert _keeps_failure_in_piece(one, run.start, own, jnp.array(kind)), kind


def test_flywheels_that_do_not_span_make_the_part_of_a_torque_along_their_axes(monkeypatch):
    """Of two flywheels whose axes lean, the first at its limit."""
    monkeypatch.syspath_prepend(PACKAGE)
    steering_class = pkgutil.resolve_name("flywheels.effector:FlywheelSteering")
    axes = np.array([[1.0, 0.6], [0.0, 0.8], [0.0, 0.0]])
    shares = np.linalg.pinv(axes)
    torque = jnp.array([0.03, 0.02, 0.05])
    for limit in (1.0, 0.01):
        steering = steering_class(*map(jnp.asarray, (axes, np.array([limit, 1.0]), shares)))
        own, left = steering(0.0, None, torque)
        np.testing.assert_allclose(axes @ own + left, torque, atol=1e-12)
        np.testing.assert_allclose(steering.within_reach(0.0, None, torque), [0.03, 0.02, 0])
        assert abs(own[0]) <= limit + 1e-12
        if limit == 1.0:
            np.testing.assert_allclose(own, [0.015, 0.025], atol=1e-9)
