"""Disturbances and actuators that do not come with jaxsat."""

import contextlib
import sys

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxsat.core import process
from jaxsat.core.attitude import Quaternion
from jaxsat.scenario import ScenarioError, dump, plugins
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.store.files import OutputError
from jaxsat.store.ledger import study_columns
from jaxsat.studies.executors import Serial
from jaxsat.studies.processes import Processes
from jaxsat.studies.run import run_study
from scenario.packages import forget_package, install_package

PARTS = """
import jax
import jax.numpy as jnp

from jaxsat import AbstractActuators, AbstractDisturbance, AbstractSmoothActuators, Actuators
from jaxsat import PartDeclaration
from jaxsat.core.declaration import choice, number


class Wind(AbstractDisturbance):
    declaration = PartDeclaration(
        "a torque that turns with the orbit frame",
        (
            number("torque_N_m", "Torque about -y of the orbit frame", "N m", at_least=0),
            number("swing", "Share of it that comes and goes", at_most=1, default=0.5),
            choice("axis", "Of the orbit frame", ("x", "y"), "y"),
        ),
    )
    torque: jax.Array
    swing: jax.Array
    orbit_rate: jax.Array

    @classmethod
    def from_table(cls, values, context):
        return cls(*map(jnp.asarray, (values["torque_N_m"], values["swing"], context.orbit_rate)))

    def __call__(self, t, attitude, inertia):
        about = attitude.as_dcm().matrix @ jnp.array([0.0, -1.0, 0.0])
        return self.torque * (1 + self.swing * jnp.sin(self.orbit_rate * t)) * about


class Flat(Wind):
    def __call__(self, t, attitude, inertia):
        return self.torque


class Broken(Wind):
    def __call__(self, t, attitude, inertia):
        return inertia @ jnp.zeros(2)


class OnlyQuaternions(Wind):
    def __call__(self, t, attitude, inertia):
        return self.torque * attitude.q[1:]


class Unbuildable(Wind):
    @classmethod
    def from_table(cls, values, context):
        return values["nothing"]


class Other(Wind):
    @classmethod
    def from_table(cls, values, context):
        return None


class NoDeclaration(Wind):
    declaration = 3


class Coarse(AbstractSmoothActuators):
    declaration = PartDeclaration(
        "commanded in steps", (number("step_N_m", "Least change of the command", "N m", above=0),)
    )
    thrusters: Actuators
    step: jax.Array

    @classmethod
    def from_table(cls, values, context):
        return cls(context.ideal, jnp.asarray(values["step_N_m"]))

    def __call__(self, command):
        return self.thrusters(self.step * jnp.round(command / self.step))


class Cornered(AbstractActuators):
    declaration = Coarse.declaration
    thrusters: Actuators
    step: jax.Array
    event_count = 2

    @classmethod
    def from_table(cls, values, context):
        return cls(context.ideal, jnp.asarray(values["step_N_m"]))

    def __call__(self, command):
        return self.thrusters(jnp.where(jnp.abs(command) < self.step, 0.0, command))

    def event_functions(self, command):
        return jnp.abs(command) - self.step

    def smooth_piece(self, signs):
        return Held(self.thrusters, signs)


class Held(AbstractSmoothActuators):
    thrusters: Actuators
    passes: jax.Array

    def __call__(self, command):
        return self.thrusters(jnp.where(self.passes, command, 0.0))


class Miscounted(Cornered):
    event_count = 3


class Weak(Coarse):
    def __call__(self, command):
        return command
"""

SCENARIO = """
title = "Own parts"
[spacecraft]
inertia_kg_m2 = [449.5, 264.6, 312.5]
thruster_torque_axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]
failed_thrusters = [3]
torque_limit_N_m = 5.0
[orbit]
rate_rad_s = 0.0011
[disturbance]
constant_N_m = [1e-4, 0.0, 0.0]
[disturbance.torques.wind]
kind = "own_parts:Wind"
torque_N_m = 2e-3
[actuators]
kind = "own_parts:Coarse"
step_N_m = 0.5
[initial]
quaternion = [0.8, 0.6, 0.0, 0.0]
omega_rad_s = [0.0, 0.01, -0.02]
[control]
law = "three-slew"
[simulation]
duration_s = 2
[dispersion.misalignment_rad]
distribution = "uniform"
low = -0.01
high = 0.01
"""


@pytest.fixture
def own(tmp_path, monkeypatch):
    """A scenario beside a module of parts, neither of them in the current folder."""
    monkeypatch.setattr(sys, "path", list(sys.path))
    monkeypatch.setattr(process, "_ADDED", [])
    (tmp_path / "own_parts.py").write_text(PARTS, encoding="utf-8")
    path = tmp_path / "own.toml"
    path.write_text(SCENARIO, encoding="utf-8")
    yield path
    sys.modules.pop("own_parts", None)


def refused(path, *overrides):
    with pytest.raises(ScenarioError) as caught:
        load(path, overrides)
    return str(caught.value)


def test_the_torques_add_up_in_the_plant(own):
    loop = build(load(own, ["disturbance.torques.wind.swing=1"])).loop
    q = np.array([0.8, 0.6, 0.0, 0.0])
    found = loop.plant.disturbance(
        jnp.array(1000.0), Quaternion(jnp.asarray(q)), jnp.diag(jnp.array([449.5, 264.6, 312.5]))
    )
    from_orbit_to_body = Rotation.from_quat(q[[1, 2, 3, 0]]).inv()
    wind = 2e-3 * (1 + np.sin(1.1)) * from_orbit_to_body.apply([0.0, -1.0, 0.0])
    np.testing.assert_allclose(found - wind, [1e-4, 0, 0], rtol=1e-12, atol=1e-15)


def test_actuators_displace_the_thrusters_and_keep_their_limit(own):
    actuators = build(load(own)).loop.plant.effectors[0].actuators
    np.testing.assert_array_equal(actuators(jnp.array([0.3, -0.2])), [0.5, 0.0, 0.0])
    np.testing.assert_array_equal(actuators(jnp.array([99.0, -99.0])), [5.0, -5.0, 0.0])


def test_actuators_are_never_left_out_for_error_coordinates(own):
    printed = "paper-three-axis"
    actuators = 'actuators={kind="own_parts:Coarse", step_N_m=0.5}'
    with contextlib.chdir(own.parent):
        assert type(build(load(printed)).loop).__name__ == "ErrorCoordinateLoop"
        assert type(build(load(printed, [actuators])).loop).__name__ == "ContinuousLoop"
        told = refused(printed, actuators, "simulation.coordinates=error")
    assert "because the actuators are not jaxsat's own" in told


def test_corners_of_actuators_take_adaptive_steps(own):
    cornered = ["actuators.kind=own_parts:Cornered", "control={law='rate', k1=0.2, k2=0.2}"]
    smooth = "control.omega3_width_rad_s=0.01"
    loop = build(load(own, [*cornered, smooth])).loop
    assert loop.controller.is_smooth()
    assert not loop.is_smooth()
    start = loop.start(build(load(own)).start)
    assert loop.event_functions(jnp.array(0.0), start).shape == (2,)
    scenario = load(own, [*cornered, smooth], purpose="study")
    stepper = build_study(scenario, 1, engine="scan").engine.stepper
    assert type(stepper).__name__ == "AdaptiveStepper"


def test_the_same_disturbance_can_act_twice(own):
    twice = 'disturbance.torques.again={kind="own_parts:Wind", torque_N_m=1e-3}'
    assert len(build(load(own, [twice])).loop.plant.disturbance.terms) == 4


def test_what_is_dumped_loads_to_the_same(own):
    scenario = load(own)
    own.write_text(dump(scenario), encoding="utf-8")
    assert load(own) == scenario


def test_mistakes_are_told_like_those_of_jaxsats_own_keys(own):
    own.write_text(SCENARIO.replace("torque_N_m = 2e-3", "torqe_N_m = 2e-3"), encoding="utf-8")
    told = refused(own)
    line = SCENARIO.split("\n").index("torque_N_m = 2e-3") + 1
    assert f"own.toml:{line}: key disturbance.torques.wind.torqe_N_m" in told
    assert "did you mean torque_N_m?" in told
    assert "disturbance.torques.wind.torque_N_m: must be given in N m, got nothing" in told


@pytest.mark.parametrize(
    ("override", "told"),
    [
        ("disturbance.torques.wind.torque_N_m=-1", "must be at least 0 N m, got -1"),
        ("disturbance.torques.wind.axis=z", 'must be one of "x", "y", got "z"'),
        ("disturbance.torques.wind=3", "must be a table, got 3"),
        ("disturbance.torques.wind={force=1}", "wind.kind: must be given"),
        ("disturbance.torques.wind.kind=3", "must be text in quotes, got 3"),
        ("disturbance.torques.wind.kind=wind", 'must have the form "module:Class", got wind'),
        ("disturbance.torques.wind.kind=own_parts:Coarse", "a subclass of AbstractDisturbance"),
        ("disturbance.torques.wind.kind=own_parts:Gone", "must name a class of own_parts"),
        ("disturbance.torques.wind.kind=own_part:Wind", "there is no module own_part"),
        ("disturbance.torques.wind.kind=own_parts:NoDeclaration", "that is a PartDeclaration"),
        ("disturbance.torques.wind.kind=own_parts:Flat", "gives an array of shape (3,)"),
        ("disturbance.torques.wind.kind=own_parts:Broken", "can be run, got TypeError"),
        ("disturbance.torques.wind.kind=own_parts:Unbuildable", "can be built, got KeyError"),
        ("disturbance.torques.wind.kind=own_parts:Other", "is made by its `from_table`"),
        ("actuators.kind=own_parts:Wind", "a subclass of AbstractActuators"),
        ("actuators.kind=own_parts:Weak", "gives an array of shape (3,)"),
        ("actuators.step_N_m=0", "must be greater than 0 N m, got 0"),
        ("actuators.kind=own_parts:Miscounted", "gives an array of shape (3,) from `event_func"),
    ],
)
def test_parts_that_cannot_be_used_are_refused(own, override, told):
    assert told in refused(own, override)


def test_an_exception_is_told_with_the_line_of_the_file(own):
    line = PARTS.split("\n").index("        return inertia @ jnp.zeros(2)") + 1
    assert f"own_parts.py:{line})" in refused(own, "disturbance.torques.wind.kind=own_parts:Broken")


def test_a_disturbance_is_tried_with_the_attitude_that_is_integrated(own):
    kind = "disturbance.torques.wind.kind=own_parts:OnlyQuaternions"
    assert load(own, [kind]).disturbance.torques["wind"].kind == "own_parts:OnlyQuaternions"
    assert "can be run, got AttributeError" in refused(own, kind, "simulation.attitude=wz")


def test_a_disturbance_of_a_package_has_a_name(tmp_path, monkeypatch):
    plugins.installed.cache_clear()
    install_package(tmp_path / "site", monkeypatch)
    text = 'disturbance.torques.air={kind="aerodynamic", force_N=0.01, arm_m=[0, 0, 2]}'
    loop = build(load("paper-rate", [text])).loop
    q = np.array([0.5, -0.5, 0.5, 0.5])
    found = loop.plant.disturbance.terms[-1](jnp.array(0.0), Quaternion(jnp.asarray(q)), jnp.eye(3))
    force = Rotation.from_quat(q[[1, 2, 3, 0]]).inv().apply([-0.01, 0.0, 0.0])
    np.testing.assert_allclose(found, np.cross([0, 0, 2], force), atol=1e-17)
    told = refused("paper-rate", text.replace("aerodynamic", "aerodynamik"))
    assert 'must be one of "aerodynamic" or have the form "module:Class"' in told
    assert told.endswith("got aerodynamik, did you mean aerodynamic?")
    plugins.installed.cache_clear()
    forget_package()


LIGHT = [
    "control={law='quaternion-feedback', natural_frequency_rad_s=0.1, period_s=0.1}",
    "spacecraft.failed_thrusters=[]",
]
"""A law that is quick to trace: what is compared are the parts."""


def study(scenario, engine):
    return build_study(scenario, 6, engine=engine, batch_size=4, chunk=3)


def costs(made, target, executor=None):
    run_study(made, target, executor=executor or Serial())
    return np.asarray(study_columns(target)["cost"])


@pytest.mark.slow
def test_both_engines_of_studies_give_the_same(own, tmp_path):
    scenario = load(own, LIGHT, purpose="study")
    found = {
        name: costs(study(scenario, name), tmp_path / f"{name}.zarr") for name in ("native", "scan")
    }
    np.testing.assert_allclose(found["native"], found["scan"], rtol=1e-6)
    there = costs(study(scenario, "scan"), tmp_path / "there.zarr", Processes(1))
    np.testing.assert_array_equal(there, found["scan"])


@pytest.mark.slow
def test_a_changed_part_does_not_resume_a_study(own, tmp_path):
    target = tmp_path / "s.zarr"
    costs(study(load(own, LIGHT, purpose="study"), "scan"), target)
    text = PARTS.replace("return self.torque * (1 +", "return -self.torque * (1 +")
    (own.parent / "own_parts.py").write_text(text, encoding="utf-8")
    sys.modules.pop("own_parts")
    with pytest.raises(OutputError, match="program"):
        costs(build_study(load(own, LIGHT), 9, engine="scan", batch_size=4, chunk=3), target)
