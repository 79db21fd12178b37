"""`[[wheel]]`: what is built of it, and what is refused."""

import warnings

import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog

from helpers.effectors import effector_of
from jaxsat.control.controller import AbstractController
from jaxsat.core.attitude import Quaternion
from jaxsat.scenario import ScenarioError, ScenarioWarning, dump
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build, build_uncontrolled
from jaxsat.scenario.derived import believed_axes, torque_limit
from jaxsat.scenario.overrides import apply_overrides, parse_override
from jaxsat.scenario.schema import Scenario
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.distribution import WheelsFirst
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.pulsed_thrusters import PulsedThrusters
from jaxsat.spacecraft.wheels import Wheels, wheel_momentum
from jaxsat.store.dataset import trajectory_dataset

ZERO = np.zeros(3)
X, Y = "{axis=[2.0,0.0,0.0]}", "{axis=[0.0,1.0,0.0]}"
HEAVY = "{axis=[0.0,1.0,0.0],rotor_inertia_kg_m2=1.5}"


def test_the_telescope_flies_the_law_whose_third_rate_its_wheels_hold():
    run = build(load("two-wheel-telescope"))
    loop = run.loop
    assert isinstance(loop, ContinuousLoop)
    assert isinstance(loop.controller, AbstractController)
    assert loop.controller.model.third_rate_held
    wheels = effector_of(loop.plant, Wheels)
    assert not loop.plant.third_rate_held
    np.testing.assert_array_equal(wheels.axes, np.eye(3))
    np.testing.assert_array_equal(wheels.momentum_limit, [20.0, 20.0, 20.0])
    assert wheels.coulomb_friction is None
    np.testing.assert_array_equal(wheel_momentum(run.start), np.zeros(3))
    assert isinstance(loop.distribution, WheelsFirst)
    np.testing.assert_array_equal(loop.distribution.wheel_map, np.eye(3)[:, :2])
    assert loop.plant.effectors == (wheels,)


@pytest.mark.slow
def test_a_sampled_law_shares_its_command_among_wheels_and_their_history_is_saved(tmp_path):
    wheels = [
        "wheel=[{axis=[1.0,0.0,0.0],momentum_limit_N_m_s=0.2,momentum_N_m_s=0.1},"
        "{axis=[0.6,0.8,0.0],coulomb_friction_N_m=0.01,viscous_friction_N_m_s=1e-5,"
        "rotor_inertia_kg_m2=0.01}]"
    ]
    short = ["simulation.duration_s=1", "simulation.save_every_s=0.5"]
    with pytest.warns(ScenarioWarning, match="never used: 1, 2"):
        scenario = load("switching", wheels + short)
    path = tmp_path / "again.toml"
    path.write_text(dump(scenario), encoding="utf-8")
    with pytest.warns(ScenarioWarning, match="never used: 1, 2"):
        assert load(path) == scenario
    run = build(scenario)
    assert isinstance(run.loop, SampledLoop)
    trajectory = run.simulate()
    data = trajectory_dataset(trajectory)
    assert data["wheel_momentum"].dims == data["wheel_torque"].dims == ("time", "wheel")
    assert data["wheel_momentum"].attrs["units"] == "N m s"
    assert list(data["wheel"].values) == [1, 2]
    np.testing.assert_array_equal(data["wheel_momentum"][0], [0.1, 0.0])
    assert abs(data["wheel_momentum"][1:, 0]).max() <= 0.2 * (1 + 1e-12)
    axes = np.array([[1.0, 0.6], [0.0, 0.8], [0.0, 0.0]])
    np.testing.assert_allclose(data["torque"], data["wheel_torque"].values @ axes.T, atol=1e-12)


@pytest.mark.slow
@pytest.mark.parametrize("friction", [0.002, 0.02])
def test_a_sampled_law_points_as_well_with_friction_as_without(friction):
    """Friction that nothing makes up for would leave its torque over the law's stiffness."""

    def flown(torque: float):
        wheel = f"torque_limit_N_m=0.4,coulomb_friction_N_m={torque},rotor_inertia_kg_m2=0.01,"
        wheel += f"viscous_friction_N_m_s={torque / 100}"
        wheels = ",".join(f"{{axis={axis},{wheel}}}" for axis in np.eye(3).tolist())
        law = ["control={law='quaternion-feedback',natural_frequency_rad_s=0.1,damping=1.0}"]
        start = ["initial={quaternion=[0.8,0.6,0.0,0.0],omega_rad_s=[0.003,0.001,-0.002]}"]
        body = ["spacecraft={inertia_kg_m2=[9.2,11.4,7.1]}", "control.period_s=0.1"]
        steps = ["simulation={duration_s=150,save_every_s=1}", f"wheel=[{wheels}]"]
        data, blocked = apply_overrides(
            {"title": "Friction", "orbit": {"rate_rad_s": 0.0}},
            map(parse_override, [*body, *law, *start, *steps]),
        )
        assert not blocked
        return build(Scenario.model_validate(data)).simulate()

    with_friction, ideal = flown(friction), flown(0.0)
    assert with_friction.assessment.settled_from < 100
    turns = [np.asarray(one.signals.quaternion) for one in (with_friction, ideal)]
    offset = friction / (7.1 * 0.1**2)  # rad
    apart = np.abs(turns[0] - turns[1])
    assert apart.max() < 0.05 * offset  # while a wheel passes rest
    assert apart[-1].max() < 1e-3 * offset


@pytest.mark.filterwarnings("ignore:.*should make both torques")
def test_thrusters_make_what_wheels_leave_and_all_where_they_can():
    """A wheel that makes a part has momentum, which laws of two torques do not model."""
    one = "spacecraft.thruster_torque_axes=[[0,1,0]]", "spacecraft.failed_thrusters=[]"
    mixed = build(load("switching", [f"wheel=[{X}]", *one])).loop
    assert isinstance(mixed.distribution, WheelsFirst)
    told, command = PlantState(Quaternion([1.0, 0, 0, 0]), np.zeros(3)), jnp.array([0.3, -0.2])
    thrusters, wheels = mixed.plant.effectors
    shares = mixed.distribution(jnp.zeros(()), told, command, mixed.plant.effectors)
    left, asked = shares.uses
    assert isinstance(wheels, Wheels)
    np.testing.assert_allclose(asked, [0.3])
    np.testing.assert_allclose(thrusters(left), [0, -0.2, 0], atol=1e-15)
    pushing = ",".join(
        f"{{torque_axis=[{x},{y},0.0],torque_N_m=1.0}}"
        for x, y in ((1.0, 0.0), (-1.0, 0.0), (0.0, 1.0), (0.0, -1.0))
    )
    wheelless = load("switching")
    document = wheelless.model_dump()
    document["spacecraft"] |= {"thruster_torque_axes": None, "failed_thrusters": ()}
    changes = [parse_override(f"thruster=[{pushing}]"), parse_override(f"wheel=[{X}]")]
    data, blocked = apply_overrides(document, changes)
    assert not blocked
    pulsed = build(Scenario.model_validate(data)).loop
    thrusters, wheels = pulsed.plant.effectors
    assert isinstance(thrusters, PulsedThrusters)
    assert isinstance(wheels, Wheels)
    np.testing.assert_allclose(pulsed.distribution.wheels(command), [0.0])
    np.testing.assert_allclose(pulsed.distribution.rest, np.eye(2))


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore:.*(should make both torques|never used)")
def test_a_law_of_two_torques_settles_beside_a_wheel_as_beside_none():
    """Thrusters make both; a wheel that made a part would keep the momentum of the turn."""
    wheel = "wheel=[{axis=[1,0,0],rotor_inertia_kg_m2=1e-6,torque_limit_N_m=20}]"
    ends = [
        float(build(load("two-torque-free", changes)).simulate().assessment.settled_from)
        for changes in ([], [wheel])
    ]
    assert np.isfinite(ends).all()
    assert ends[1] == pytest.approx(ends[0], rel=1e-3)


def test_wheels_that_have_failed_do_not_change_the_plane_of_the_thrusters():
    """Skew thrusters, pushing or ideal, make the same torques beside a wheel that does nothing."""
    failed = "wheel=[{axis=[0,1,0],failed=true}]"
    jets = ("[1,0,0.3]", "[-1,0,-0.3]", "[0,1,0.2]", "[0,-1,-0.2]")
    tables = ",".join(f"{{torque_axis={axis},torque_N_m=1,min_on_time_s=0.02}}" for axis in jets)
    ideal = "spacecraft.thruster_torque_axes=[[0.8,0,0.6],[0,0.6,0.8],[0,0,1]]"
    with warnings.catch_warnings():
        warnings.simplefilter("ignore", ScenarioWarning)
        for name, change in (
            ("pulsed-two-torque", f"thruster=[{tables}]"),
            ("two-torque-free", ideal),
        ):
            alone, beside = load(name, [change]), load(name, [change, failed])
            np.testing.assert_array_equal(believed_axes(beside), believed_axes(alone))
            assert torque_limit(beside) == torque_limit(alone)
            made = []
            for scenario in (alone, beside):
                loop, at_rest = build(scenario).loop, PlantState(Quaternion([1.0, 0, 0, 0]), ZERO)
                command = jnp.array([0.03, -0.02])
                effectors = loop.plant.effectors
                uses = loop.distribution(jnp.zeros(()), at_rest, command, effectors).uses
                made.append(np.asarray(uses[0]))
            np.testing.assert_allclose(made[1], made[0], atol=1e-15)


@pytest.mark.parametrize("law", ["oscillatory", "three-slew", "planned"])
def test_a_settling_law_flies_wheels_or_says_why_not(law):
    """Two wheels without momentum keep n·Jω at zero.

    Of 8 flights of `oscillatory` with two wheels none settles, whatever their plane.
    """
    for axes, more in (("[1,0,0.2]", "{axis=[0,1,0]}"), ("[0,1,0]", "{axis=[0,0.3,1]}")):
        changes = [f"wheel=[{{axis={axes}}},{more}]", f"control={{law='{law}'}}"]
        changes += ["spacecraft.torque_limit_N_m=0.2", *ANY_PLANE[1:], TRIAXIAL]
        if law == "three-slew":
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", ScenarioWarning)
                load("two-wheel-telescope", changes)
            continue
        with pytest.raises(ScenarioError, match=r"wheel: must leave none .*gyroscopic"):
            load("two-wheel-telescope", changes)


def test_the_limit_of_a_law_is_what_wheels_make_about_both_axes_at_once():
    """Least squares by hand: about x and y each of the skew wheels makes ∓u1/√2 + u2/√2."""
    skew = [
        f"{{axis=[{x},1.0,0.0],torque_limit_N_m={limit}}}" for x, limit in ((1, 0.3), (-1, 0.2))
    ]
    scenario = load("two-wheel-telescope", [f"wheel=[{','.join(skew)}]"])
    assert torque_limit(scenario) == pytest.approx(0.2 / np.sqrt(2))
    assert torque_limit(load("two-wheel-telescope", [f"wheel=[{X},{Y}]"])) is None
    found = load(
        "two-wheel-telescope", [f"wheel=[{','.join(skew)}]", "spacecraft.torque_limit_N_m=9"]
    )
    assert torque_limit(found) == 9


def test_what_needs_no_law_needs_no_law_that_bears_friction():
    loop, _ = build_uncontrolled(load("wheels-fail", purpose="motion"))
    assert effector_of(loop.plant, Wheels).coulomb_friction is None


@pytest.mark.parametrize(
    ("name", "changes", "said"),
    [
        ("paper-three-axis", [f"wheel=[{X},{Y}]"], "third_rate"),
        ("switching", ["wheel=[{axis=[0.0,0.0,0.0]}]"], r"wheel\[1\]\.axis|wheel.*axis.*direction"),
        (
            "switching",
            ["wheel=[{axis=[1.0,0.0,0.0],momentum_N_m_s=2.0,momentum_limit_N_m_s=1.0}]"],
            "momentum_limit_N_m_s",
        ),
        ("switching", ["wheel=[{axis=[1.0,0.0,0.0],viscous_friction_N_m_s=1.0}]"], "rotor_inertia"),
        (
            "free-third-rate",
            [f"wheel=[{X},{{axis=[0.0,1.0,0.0],coulomb_friction_N_m=0.1}}]"],
            "coulomb_friction_N_m",
        ),
        (
            "two-wheel-telescope",
            ["spacecraft.inertia_kg_m2=[1,1,1]", f"wheel=[{X},{HEAVY}]"],
            "rotor_inertia_kg_m2.*must be a part of spacecraft.inertia_kg_m2",
        ),
        (
            "switching",
            [
                "spacecraft.thruster_torque_axes=[[0,0,1]]",
                "spacecraft.failed_thrusters=[]",
                f"wheel=[{X}]",
            ],
            "independent torques about body axes x and y",
        ),
        (
            "switching",
            [f"wheel=[{X},{{axis=[0.0,1.0,0.0],nme='a'}}]"],
            r"keys of \[\[wheel.*mean name",
        ),
        ("two-wheel-telescope", ["simulation.coordinates=error"], "has wheels"),
        (
            "two-wheel-telescope",
            ["spacecraft.failed_thrusters=[1]"],
            "without thruster_torque_axes",
        ),
        (
            "two-wheel-telescope",
            ["simulation.solver.steps=fixed", "simulation.solver.step_s=0.1"],
            "momentum limit",
        ),
    ],
)
def test_what_cannot_be_is_told(name, changes, said):
    with pytest.raises(ScenarioError, match=said):
        load(name, changes)


SKEW = (
    "wheel=[{axis=[1,0,1],torque_limit_N_m=0.3},{axis=[0,1,1],torque_limit_N_m=0.3},"
    "{axis=[1,-1,0],torque_limit_N_m=0.3}]"
)


TRIAXIAL = "spacecraft.inertia_kg_m2=[500,300,350]"
ANY_PLANE = (
    "control={law='three-slew'}",
    "disturbance={}",
    "orbit={rate_rad_s=0}",
    "simulation={duration_s=60}",
)
OUTSIDE = pytest.mark.filterwarnings("ignore:.*where the law .* was verified")


@OUTSIDE
@pytest.mark.filterwarnings("ignore:.*ever fires")
def test_wheels_alone_are_commanded_about_two_directions_of_their_plane():
    """Of any plane, as thrusters are, where the law says so; what it believes is what they make."""
    plane = np.array([[1.0, 0, 1], [0, 1, 1]]).T
    jet = "thruster=[{torque_axis=[0,0,1],torque_N_m=0.1,min_on_time_s=0.02}]"
    for tables, columns, more in (
        (SKEW, plane, ()),
        (SKEW, plane, (jet,)),  # which never fires
        ("wheel=[{axis=[1,0,0]},{axis=[0,0,1]}]", np.eye(3)[:, ::2], ()),
    ):
        changes = [tables, "spacecraft.torque_limit_N_m=0.2", *ANY_PLANE, TRIAXIAL, *more]
        scenario = load("two-wheel-telescope", changes)
        loop, believed = build(scenario).loop, believed_axes(scenario)
        axes = loop.distribution.axes
        np.testing.assert_allclose(axes @ loop.distribution.wheel_map, believed, atol=1e-12)
        np.testing.assert_allclose(believed.T @ believed, np.eye(2), atol=1e-12)
        assert np.linalg.matrix_rank(np.hstack([columns, believed]), tol=1e-9) == 2
        assert loop.distribution.rest is None


@OUTSIDE
def test_the_limit_in_a_plane_is_what_its_wheels_make_about_both_directions_at_once():
    scenario = load("two-wheel-telescope", [SKEW, *ANY_PLANE, TRIAXIAL])
    axes = np.array([[1.0, 0, 1], [0, 1, 1], [1, -1, 0]]).T / np.sqrt(2)
    most = min(
        linprog(
            [0, 0, 0, -1],
            A_eq=np.column_stack([axes, -believed_axes(scenario) @ signs]),
            b_eq=np.zeros(3),
            bounds=[*[(-0.3, 0.3)] * 3, (0, None)],
        ).x[-1]
        for signs in ([1, 1], [1, -1])
    )
    assert torque_limit(scenario) <= most * (1 + 1e-9)


@OUTSIDE
@pytest.mark.slow
def test_a_flight_is_the_same_in_body_axes_of_another_order():
    """x, y, z become y, z, x, so that the two wheels are about y and z."""
    flights = []
    for shift, wheels in ((0, "[1,0,0],[0,1,0]"), (1, "[0,1,0],[0,0,1]")):
        tables = (f"{{axis=[{axis}],torque_limit_N_m=0.4}}" for axis in wheels[1:-1].split("],["))
        roll = lambda values, shift=shift: np.roll(values, shift).tolist()  # noqa: E731
        changes = [
            f"wheel=[{','.join(tables)}]",
            f"spacecraft.inertia_kg_m2={roll([420.0, 350.0, 250.0])}",
            f"initial={{quaternion={[0.8, *roll([0.4, -0.4, 0.2])]},omega_rad_s=[0,0,0]}}",
            *ANY_PLANE,
        ]
        found = trajectory_dataset(build(load("two-wheel-telescope", changes)).simulate())
        flights.append(np.roll(found["omega"].values, -shift, axis=-1))
    assert np.abs(flights[0]).max() > 0.01
    np.testing.assert_allclose(flights[1], flights[0], atol=1e-7)
