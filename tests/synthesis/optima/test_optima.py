"""Open-loop optima against exact ones, and their flights against other equations."""

import dataclasses
import json
import math
import signal

import jax.numpy as jnp
import numpy as np
import pytest

from control.planning.spacecraft import planner, random_body
from jaxsat.cli import main
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.tolerances import Tolerances
from jaxsat.scenario import library
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build, build_uncontrolled
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.environment.disturbances import AbstractDisturbance
from jaxsat.synthesis.optima.manoeuvre import Manoeuvre, manoeuvre_of
from jaxsat.synthesis.optima.run import UnsuitableScenario, required_manoeuvre
from jaxsat.synthesis.optima.search import EndError, best_of_starts, plans_of, propagate
from jaxsat.synthesis.optima.transcription import BoundObjective, BoundTranscription, Solution

pytest.importorskip("casadi")

REAL = (
    "cubesat-12u",
    "cubesat-3w3m",
    "failures-12u",
    "failures-telescope",
    "hybrid-wheels",
    "k2",
    "pulsed-two-torque",
    "rods-only",
    "thruster-dies",
    "wheel-and-rods",
    "wheels-fail",
    "two-wheel-telescope",
)
"""Scenarios with wheels, or thrusters that push, which have no bound."""


class _Replayed(AbstractSampledController):
    """Thrusts known in advance."""

    thrust: jnp.ndarray
    period: jnp.ndarray

    def init(self, state):
        return jnp.array(0)

    def step(self, t, state, memory):
        return self.thrust[jnp.minimum(memory, len(self.thrust) - 1)], memory + 1

    def rate_error(self, state, memory):
        return jnp.full(2, jnp.nan)


INERTIA = (449.5, 264.6, 312.5)
NONE = np.zeros(3)


def planar(angle, rate, limit=5.0):
    """A body turned about x alone, without orbit or disturbance."""
    quaternion = np.array([np.cos(angle / 2), np.sin(angle / 2), 0.0, 0.0])
    omega = np.array([rate, 0.0, 0.0])
    return Manoeuvre(
        np.diag(INERTIA), np.eye(3)[:, :2], limit, 0.0, quaternion, omega, NONE, NONE, NONE, NONE
    )


@pytest.mark.parametrize("second", [1e-6, 1.0, 1e6])
def test_rest_is_judged_alike_in_every_unit_of_time(second):
    """1e-4 rad per √(J/Tm), which is 1.2e-5 rad/s for the paper's spacecraft at 5 N m."""
    manoeuvre = planar(0.1, 0.0, limit=5.0 / second**2)
    for rate, rests in ((1.1e-5, True), (1.3e-5, False)):
        end = EndError(9e-5, rate / second, 0.0, 0.0, 0.0, 0.0)
        assert end.arrives(manoeuvre) is rests


@pytest.mark.parametrize("second", [1e-6, 1.0, 1e6])
def test_the_shortest_manoeuvre_has_no_unit_of_its_own(second):
    """A thousandth of √(J/Tm), 9.48 s here."""
    manoeuvre = planar(0.1, 0.0, limit=5.0 / second**2)
    shortest = math.sqrt(INERTIA[0] / 5.0) * second / 1000
    found = BoundTranscription(manoeuvre, BoundObjective.TIME, 1.001 * shortest).shortest
    assert found == pytest.approx(shortest)
    with pytest.raises(ValueError, match="must be finite and at least"):
        BoundTranscription(manoeuvre, BoundObjective.TIME, 0.999 * shortest)


def test_thrusters_that_fail_in_flight_have_no_bound():
    """A time in which a dead thruster pushes is the bound of another spacecraft."""
    changes = ['failure=[{of="thruster 1", kind="dead", at_s=0.5}]']
    with pytest.raises(UnsuitableScenario, match="failure: must be left out for a bound"):
        required_manoeuvre(load("two-torque-free", changes))
    required_manoeuvre(load("two-torque-free"))


def test_rest_to_rest_is_bang_bang():
    """2 √(J θ / Tm): half the time full thrust, half the time full brake."""
    found = best_of_starts(planar(0.1, 0.0), BoundObjective.TIME, 2, longest=100.0, intervals=30)
    exact = 2 * np.sqrt(INERTIA[0] * 0.1 / 5.0)
    assert found.solution.value == pytest.approx(exact, rel=1e-4)
    np.testing.assert_allclose(found.solution.thrust[:15, 0], -5.0, atol=1e-3)
    np.testing.assert_allclose(found.solution.thrust[15:, 0], 5.0, atol=1e-3)
    assert found.values == sorted(found.values)


def test_a_published_least_time_of_three_torques():
    """28.6304 s: 150 degrees about x by 50 N m (Fleming, Sekhavat & Ross 2010; Betts 2010).

    Torques that are constant over 48 intervals cannot be quicker.
    """
    turn, body = math.radians(150) / 2, np.diag([5621.0, 4547.0, 2364.0])
    start = np.array([math.cos(turn), math.sin(turn), 0.0, 0.0])
    manoeuvre = Manoeuvre(body, np.eye(3), 50.0, 0.0, start, *([NONE] * 5))
    found = best_of_starts(manoeuvre, BoundObjective.TIME, 1, longest=100.0, intervals=48)
    assert 28.6304 <= found.solution.value < 1.0005 * 28.6304


def least_time_until_settled(angle, limit, tolerances):
    """Full thrust and full brake about x alone, down to the largest tilt and rate allowed."""
    acceleration, rate = limit / INERTIA[0], float(tolerances.relative_rate)
    way = angle - 2 * math.atan(float(tolerances.w))
    speeding = math.sqrt((way + rate**2 / (2 * acceleration)) / acceleration)
    return 2 * speeding - rate / acceleration


@pytest.mark.slow
@pytest.mark.parametrize(("tilt", "rate"), [(0.05, 0.004), (1e-3, 0.01)])
def test_a_settled_case_may_still_be_off_and_turn(tilt, rate):
    tolerances = Tolerances(math.tan(tilt / 2), 0.02, rate)
    manoeuvre = dataclasses.replace(planar(0.3, 0.0), end=(tilt, 0.02, rate))
    found = best_of_starts(manoeuvre, BoundObjective.TIME, 2, longest=100.0, intervals=60)
    exact = least_time_until_settled(0.3, 5.0, tolerances)
    assert found.solution.value == pytest.approx(exact, rel=1e-3)
    assert found.verification.tilt == pytest.approx(tilt, rel=1e-3)
    assert found.verification.rate == pytest.approx(rate, rel=1e-3)


def test_what_is_known_to_arrive_is_among_the_starts():
    """A slow turn is improved; where the search fails it is still there."""
    manoeuvre, angle, duration = planar(0.1, 0.0), 0.1, 12.0
    torque = 4 * INERTIA[0] * angle / duration**2
    thrust = np.repeat([[-torque, 0.0], [torque, 0.0]], 4, axis=0)
    t = np.linspace(0, duration, 9)
    turned = np.where(t < 6, angle * (1 - 2 * (t / 12) ** 2), 2 * angle * (1 - t / 12) ** 2)
    rate = -torque / INERTIA[0] * np.minimum(t, duration - t)
    zero = np.zeros(9)
    columns = [np.cos(turned / 2), np.sin(turned / 2), zero, zero, rate, zero, zero]
    known = Solution(duration, duration, thrust, np.stack(columns, axis=1))
    keys = {"longest": 100.0, "intervals": 16, "plans": [known]}
    found = best_of_starts(manoeuvre, BoundObjective.TIME, 1, **keys)
    exact = 2 * np.sqrt(INERTIA[0] * angle / 5.0)
    assert found.solution.value == pytest.approx(exact, rel=1e-4)
    assert found.starts == 2
    assert duration == found.values[-1]


@pytest.mark.slow
@pytest.mark.parametrize("tolerances", [None, Tolerances()])
def test_no_plan_is_quicker_than_the_bound(tolerances):
    """Of a random body under two random torques, from a random start."""
    body, axes, limit, start = random_body(np.random.default_rng(5))
    made = planner(body, axes, limit)
    thrusters = Actuators(jnp.asarray(axes), jnp.eye(2), limit)
    loop = SampledLoop(
        made.model.with_effectors((thrusters,)),
        _Replayed(jnp.zeros((1, 2)), jnp.ones(())),
        substeps=1,
    )
    manoeuvre = manoeuvre_of(loop, start, tolerances=tolerances)
    longest = 100 * math.sqrt(np.trace(body) / limit)
    plans = plans_of(loop, start, BoundObjective.TIME, longest, tolerances)
    assert len(plans) == (1 if tolerances is None else 2)
    keys = {"longest": longest, "plans": plans}
    found = best_of_starts(manoeuvre, BoundObjective.TIME, 1, **keys)
    quickest = min(plan.value for plan in plans)
    assert 0.8 * quickest < found.solution.value <= quickest
    assert found.verification.arrives(manoeuvre)


def test_least_effort_is_the_angular_momentum():
    """∫ Σ|T_i| dt >= |H(0)|; coasting to the target and braking there attains it."""
    found = best_of_starts(planar(-0.1, 0.01), BoundObjective.EFFORT, 2, longest=60.0, intervals=30)
    assert found.solution.value == pytest.approx(INERTIA[0] * 0.01, rel=2e-3)
    assert found.verification.effort == pytest.approx(found.solution.value, rel=1e-6)
    assert found.solution.duration <= 60.0


@pytest.fixture(scope="module")
def paper():
    run = build(load("acceptance-nominal"))
    return run, manoeuvre_of(run.loop, run.start)


def test_manoeuvre_is_that_of_the_scenario(paper):
    run, manoeuvre = paper
    np.testing.assert_array_equal(np.diag(manoeuvre.inertia), INERTIA)
    np.testing.assert_array_equal(manoeuvre.torque_axes, np.eye(3)[:, :2])
    assert (manoeuvre.limit, manoeuvre.orbit_rate) == (5.0, 0.0011)
    for t in (0.0, 3.7):
        ours = run.loop.plant.disturbance_torque(jnp.asarray(t), run.start)
        np.testing.assert_allclose(manoeuvre.disturbance(t), ours, atol=1e-15)


COMMON = ["orbit.rate_rad_s=0.02", "disturbance.gravity_gradient=true", "initial.w=[0.05,0.02]"]
FREE = ["initial.z_rad=0.02", "initial.omega_rad_s=[0,-0.02,0.001]"]
HELD = ["spacecraft.third_rate=held", "initial.z_rad=0", "initial.omega_rad_s=[0.001,-0.02,0]"]
SMALL = ["orbit.relation=small-angle", "disturbance.constant_N_m=[0.3,-0.2,0.1]"]


@pytest.mark.slow
@pytest.mark.parametrize("changes", [FREE, [*HELD, *SMALL]], ids=["free", "held"])
def test_flight_is_that_of_the_plant(paper, changes):
    """The states that the program ties together, the flight and jaxsat's own loop agree."""
    scenario = load("acceptance-nominal", [*COMMON, *changes], purpose="motion")
    own, start = build_uncontrolled(scenario)
    manoeuvre = manoeuvre_of(own, start)
    transcription = BoundTranscription(
        manoeuvre, BoundObjective.TIME, 100.0, intervals=20, substeps=4
    )
    solver = transcription.solver()
    solution = next(filter(None, (transcription.solve(solver, seed) for seed in range(9))))
    verification = propagate(manoeuvre, solution)
    assert verification.angle < 1e-4
    assert verification.rate < 1e-5
    assert verification.largest_thrust <= 5 * (1 + 1e-6)
    thrust = jnp.asarray(solution.thrust)
    controller = _Replayed(thrust, jnp.asarray(solution.duration / len(thrust)))
    loop = SampledLoop(
        own.plant.with_effectors((paper[0].loop.plant.effectors[0],)), controller, substeps=20
    )
    run = simulate(loop, start, controller.period * jnp.arange(len(thrust) + 1))
    np.testing.assert_allclose(run.signals.omega, solution.states[:, 4:], atol=2e-6)
    assert np.linalg.norm(run.signals.w[-1]) < 1e-4
    assert np.linalg.norm(run.signals.relative_rate[-1]) < 1e-5


@pytest.mark.slow
def test_known_least_time_from_the_papers_start(paper):
    """An independent transcription found 30.5 s at 5 N m."""
    found = best_of_starts(paper[1], BoundObjective.TIME, 12, longest=100.0)
    assert found.solution.value == pytest.approx(30.5, abs=0.1)


@pytest.mark.parametrize("name", [name for name in library() if name not in REAL])
def test_every_scenario_with_a_torque_limit_has_a_manoeuvre(name):
    limit = "spacecraft.torque_limit_N_m=5"
    for relation in ("exact", "small-angle"):
        changes = [limit, f"orbit.relation={relation}", "disturbance.gravity_gradient=true"]
        manoeuvre = manoeuvre_of(*build_uncontrolled(load(name, changes, purpose="motion")))
        assert manoeuvre.small_angle == (relation == "small-angle")
        assert manoeuvre.gradient_rate == manoeuvre.orbit_rate > 0


class _Unknown(AbstractDisturbance):
    """A torque of which the bounds know nothing."""

    def __call__(self, t, attitude, inertia):
        return jnp.zeros(3)


def test_other_manoeuvres_are_refused(paper):
    ideal = build(load("paper-three-axis"))
    with pytest.raises(ValueError, match="thrusters with a limit"):
        manoeuvre_of(ideal.loop, ideal.start)
    plant = dataclasses.replace(paper[0].loop.plant, disturbance=_Unknown())
    with pytest.raises(ValueError, match="constant torques, but got _Unknown"):
        manoeuvre_of(dataclasses.replace(paper[0].loop, plant=plant), paper[0].start)


def test_starts_and_intervals_are_checked(paper):
    with pytest.raises(ValueError, match="`starts` must be at least 1"):
        best_of_starts(paper[1], BoundObjective.TIME, 0, longest=100.0)
    with pytest.raises(ValueError, match="`intervals` must be positive"):
        BoundTranscription(paper[1], BoundObjective.TIME, 100.0, intervals=0)
    with pytest.raises(ValueError, match="at least one thruster"):
        dataclasses.replace(paper[1], torque_axes=np.zeros((3, 0)))


def test_thrusters_without_a_limit_are_told_with_their_key(capsys):
    with pytest.raises(SystemExit) as caught:
        main(["bound", "paper-rate"])
    assert caught.value.code == 2
    assert "spacecraft.torque_limit_N_m: must be given in N m" in capsys.readouterr().err


@pytest.mark.slow
def test_command_line(tmp_path, capsys):
    handler = signal.getsignal(signal.SIGTERM)
    quick = ["initial.w=[0.05, 0.0]", "initial.z_rad=0", "initial.omega_rad_s=[0, -0.0011, 0]"]
    sets = [token for change in quick for token in ("--set", change)]
    target, rest = tmp_path / "bound.json", ["--end", "rest"]
    with pytest.raises(SystemExit) as caught:
        main(["bound", "two-torque-free", "--starts", "1", *sets, *rest, "--out", str(target)])
    signal.signal(signal.SIGTERM, handler)
    out = capsys.readouterr().out
    assert caught.value.code == 0
    assert "not certified" in out
    record = json.loads(target.read_text())
    assert len(record["thrust_N_m"]) == 96
    assert record["value"] == pytest.approx(2 * np.sqrt(INERTIA[0] * 0.1 / 5.0), rel=0.02)
    assert record["end"] == "rest"
    assert "exactly at rest" in out


SKEW = [
    "spacecraft.thruster_torque_axes=[[0.8,0.5,0.331662479]]",
    "spacecraft.failed_thrusters=[]",
    "initial.omega_rad_s=[0.1,-0.11,0.1]",
    "initial.w=[0,0]",
]


def test_rates_alone_are_stopped_in_whatever_attitude():
    """A spin about the axis of the torque stops in J ω / T."""
    spin = dataclasses.replace(planar(0.3, 0.02), rates_only=True)
    found = best_of_starts(spin, BoundObjective.TIME, 2, longest=60.0, intervals=20)
    assert found.solution.value == pytest.approx(INERTIA[0] * 0.02 / 5.0, rel=1e-4)
    assert found.verification.angle > 0.2


@pytest.mark.slow
def test_one_torque_stops_the_rotation(paper):
    """The flight of another integrator ends at rest, and so does jaxsat's own loop."""
    scenario = load("acceptance-nominal", SKEW, purpose="motion")
    own, start = build_uncontrolled(scenario)
    manoeuvre = manoeuvre_of(own, start, rates_only=True)
    found = best_of_starts(manoeuvre, BoundObjective.TIME, 1, longest=300.0, intervals=60)
    assert found.solution.thrust.shape[1] == 1
    assert found.verification.rate < 1e-6
    assert found.verification.largest_thrust <= 5 * (1 + 1e-6)
    thrust = jnp.asarray(found.solution.thrust)
    controller = _Replayed(thrust, jnp.asarray(found.solution.duration / len(thrust)))
    actuators = dataclasses.replace(own.plant.effectors[0], thrust_map=jnp.ones((1, 1)))
    loop = SampledLoop(own.plant.with_effectors((actuators,)), controller, substeps=20)
    run = simulate(loop, start, controller.period * jnp.arange(len(thrust) + 1))
    assert np.linalg.norm(run.signals.omega[-1]) < 1e-6
