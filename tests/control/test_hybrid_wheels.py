"""The fault-tolerant law with wheels and thrusters: what both make together, and flights."""

import dataclasses
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.optimize import linprog, nnls

from helpers.thruster_layouts import canted
from jaxsat.control.diagnosis.isolation import DiagnosedKind
from jaxsat.control.diagnosis.residual import Reading
from jaxsat.control.reconfiguration import Rank, failed_set
from jaxsat.control.tolerant_actuators import Sample, TolerantMode
from jaxsat.control.tolerant_mix import Mix, MixMemory, Unloading
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.spacecraft.allocation import MomentumPrice
from jaxsat.spacecraft.effector import Reach
from jaxsat.store.dataset import trajectory_dataset

AXES = np.array([[1, 0, 1], [0, 1, 1], [-1, 0, 1], [0, -1, 1]]).T / np.sqrt(2)
TORQUE = canted()[0]
FULL = 0.5 * np.abs(TORQUE).max()
BEFORE = MixMemory.begin()._replace(three=jnp.array(False))


def mix(duty, usable, steady=(0.0, 0.0, 0.0), left=(False, False)):
    """Thrusters up to a duty each, and wheels up to a torque each."""
    duty, usable, none = (np.asarray(one, float) for one in (duty, usable, np.zeros(4)))
    thrusters = Reach(TORQUE, 0 * duty, duty, np.linalg.norm(TORQUE, axis=0))
    wheels = Reach(AXES, -usable, usable, none)
    reaches = jax.tree.map(jnp.asarray, (thrusters, wheels))
    truth = tuple(jnp.array(one) for one in left)
    alone = (jnp.array(False), jnp.array(False))
    steady = (jnp.asarray(steady), jnp.zeros(3))
    none = tuple(MomentumPrice(jnp.zeros((n, 3)), jnp.zeros(n)) for n in (8, 4))
    return Mix(reaches, steady, truth, alone, (False, True), none)


def feasible(duty, usable, torque):
    """Whether SciPy finds uses within the bounds that make a torque."""
    bounds = [*((0, one) for one in duty), *((-one, one) for one in usable)]
    scale = np.abs(TORQUE).max()
    columns = np.concatenate([TORQUE, AXES], axis=1) / scale
    return linprog(np.zeros(12), A_eq=columns, b_eq=torque / scale, bounds=bounds).status == 0


def test_three_axes_are_left_where_a_linear_programme_says_so():
    """Of two wheels or fewer and up to three thrusters that are left, alone and with a flow."""
    spans = jax.jit(lambda *given: mix_of(*given).spans(BEFORE))

    def mix_of(duty, usable, steady):
        one = mix(np.zeros(8), np.zeros(4))
        thrusters, wheels = one.reaches
        reaches = (thrusters._replace(high=duty), wheels._replace(low=-usable, high=usable))
        return one._replace(reaches=reaches, steady=(steady, jnp.zeros(3)))

    rng = np.random.default_rng(8)
    answers = []
    for wheels, thrusters in itertools.product((0, 1, 2), (1, 2, 3, 5)):
        for _ in range(4):
            usable = FULL * np.isin(np.arange(4), rng.choice(4, wheels, replace=False))
            duty = 1.0 * np.isin(np.arange(8), rng.choice(8, thrusters, replace=False))
            steady = 0.05 * rng.normal(size=3) * np.abs(TORQUE).max()
            columns = np.concatenate([TORQUE * duty, AXES * usable], axis=1)
            ways = [0.02 * way * np.abs(columns).max(axis=1) for way in (1, -1)]
            wanted = [steady + np.eye(3)[axis] * way for axis in range(3) for way in ways]
            expected = all(feasible(duty, usable, torque) for torque in wanted)
            expected = expected and np.all(np.abs(columns).max(axis=1) > 0)
            answers.append(expected)
            assert bool(spans(duty, usable, steady)) == expected, (wheels, thrusters)
    assert 5 < np.count_nonzero(answers) < len(answers) - 5


def test_wheels_make_what_they_can_and_thrusters_the_rest():
    rng = np.random.default_rng(9)
    steady = np.array([0.1, -0.05, 0.02]) * FULL
    three = jnp.array(True)

    def shared(usable, torque, unloading):
        one = mix(np.ones(8), np.zeros(4), steady)
        wheels = one.reaches[1]._replace(low=-usable, high=usable)
        return one._replace(reaches=(one.reaches[0], wheels)).demands(
            torque, Unloading(jnp.zeros(3), unloading), three
        )[0]

    demands = jax.jit(shared)
    for count in (4, 2, 1):
        usable = FULL * (np.arange(4) < count)
        for torque in 0.3 * FULL * rng.normal(size=(6, 3)):
            thrusters, wheels = demands(usable, torque, np.zeros(3))
            total = np.asarray(thrusters.torque + wheels.torque)
            np.testing.assert_allclose(total, torque + steady, atol=1e-9 * FULL)
            assert np.all(np.abs(wheels.use) <= usable * (1 + 1e-12))
            np.testing.assert_allclose(TORQUE @ thrusters.use, thrusters.torque, atol=1e-12)
            if count == 4:
                np.testing.assert_array_equal(thrusters.use, 0)
    thrusters, wheels = demands(FULL * np.ones(4), np.zeros(3), np.array([0.0, 0.0, 0.2 * FULL]))
    np.testing.assert_allclose(thrusters.torque, [0, 0, 0.2 * FULL], atol=1e-9 * FULL)
    np.testing.assert_allclose(wheels.torque, steady - thrusters.torque, atol=1e-9 * FULL)


def test_momentum_is_taken_out_as_gently_as_errors_of_thrusts_are_borne():
    """The part of the thrusts by NumPy, beside what acts steadily, which is made in full."""
    three, zero = jnp.array(True), jnp.zeros(3)
    relief, steady = np.array([0.1, -0.05, 0.2]) * FULL, np.array([0.0, 0.04, -0.03]) * FULL
    one = mix(np.ones(8), FULL * np.ones(4))

    @jax.jit
    def demands(error, first):
        return one.demands(zero, Unloading(first, jnp.asarray(relief), error), three)[0]

    error = np.diag([1.0, 2.0, 3.0]) / FULL
    for first in (np.zeros(3), steady):
        whole = TORQUE * np.asarray(demands(jnp.zeros((3, 3)), first)[0].use)
        np.testing.assert_allclose(whole.sum(axis=1), first + relief, atol=1e-9 * FULL)
        wrong = np.sqrt(np.sum((error @ whole) ** 2))
        for size, part in ((0.9, 1.0), (4.0, 0.25), (10.0, 0.1)):
            thrusters, wheels = demands(jnp.asarray(size / wrong * error), first)
            made = first + part * relief
            np.testing.assert_allclose(TORQUE @ thrusters.use, made, atol=1e-9 * FULL)
            np.testing.assert_allclose(wheels.torque, -thrusters.torque, atol=1e-9 * FULL)


NEVER = 9000
"""After the end of all flights, s."""


def flight(failures, *changes):
    """A run of the scenario with four failures, the last of a thruster: one program for all."""
    listed = ", ".join(f"{{of='{part}', at_s={at}, kind={kind}}}" for part, at, kind in failures)
    return build(load("hybrid-wheels", [f"failure=[{listed}]", *changes], caution=print))


ONE_SIDED = [[-7, -1, -4], [1, 7, 4], [-1, 7, -4], [1, -7, -4]]
"""Axes of four thrusters, with a direction along which none pushes backwards."""


@pytest.fixture(scope="module")
def one_sided():
    """The law with these thrusters and what it commands: a function of the mask of working wheels,
    their momenta (N m s) and a torque (N m) that returns the torque of the thrusters."""
    tables = [f"{{torque_axis={axis}, torque_N_m=0.1, min_on_time_s=0.02}}" for axis in ONE_SIDED]
    run = flight([], f"thruster=[{', '.join(tables)}]")
    law, still = run.loop.controller, run.loop.plant.complete(run.start)
    still = dataclasses.replace(still, omega=jnp.zeros(3))
    columns = np.asarray(law.actuators[0].filter.thrusters.torque)
    left = failed_set(columns, ()).rank
    assert left == Rank.LESS
    memories = law.init(still).actuators
    pushes = memories[0]._replace(ability=memories[0].ability._replace(rank=jnp.array(left)))
    condition = memories[1].diagnosis.condition

    @jax.jit
    def made(working, each, torque):
        sample = Sample(jnp.zeros(()), still, Reading(jnp.zeros(3), each), law.healthy)
        found = law.actuators[1].allocation.find(condition._replace(failed=~working), each)
        kinds = list(zip(law.actuators, (pushes, memories[1]._replace(ability=found)), strict=True))
        unloading = Unloading(jnp.zeros(3), jnp.zeros(3))
        demands, unmade = law._mix(sample, kinds).demands(torque, unloading, jnp.array(True))
        return demands[0].torque, unmade

    return law, columns, made


def test_thrusters_that_empty_no_wheel_fill_wheels_little(one_sided):
    """Of torques to and fro about the axis without a wheel, which the cheapest thruster makes,
    against the least momentum that they leave, by SciPy's non-negative least squares."""
    law, columns, made = one_sided
    axes = np.asarray(law.actuators[1].filter.wheels.axes)
    normal = np.cross(axes[:, 0], axes[:, 1])
    normal = normal / np.linalg.norm(normal)
    along, across = normal @ columns, columns - np.outer(normal, normal @ columns)
    each, cheapest = np.zeros(4), np.zeros(3)
    for number in range(200):  # impulses of 0.1 N m s in turn
        torque = 0.01 * (-1) ** number * normal
        push, unmade = made(np.arange(4) < 2, each, torque)
        np.testing.assert_allclose(unmade, 0, atol=1e-9)
        each[:2] += 10 * np.linalg.lstsq(axes[:, :2], np.asarray(push) - torque)[0]
        side = along * (-1) ** number
        fired = int(np.argmax(side))
        cheapest += 0.1 / side[fired] * across[:, fired]
    rows = [np.hstack([across, across])]
    rows += [1e6 * np.kron(side, along)[None] for side in np.eye(2)]
    least = 100 * nnls(np.vstack(rows), 1e6 * np.array([0, 0, 0, 0.1, -0.1]))[1]
    assert least < np.linalg.norm(axes @ each) < 1.3 * least
    assert np.linalg.norm(cheapest) > 3 * least


def test_the_torque_that_turns_the_last_wheel_does_not_fill_it(one_sided):
    """The frame turns. With much momentum the thrusts are those that fill it least by SciPy, or do
    not fill it."""
    law, columns, made = one_sided
    axis = np.asarray(law.actuators[1].filter.wheels.axes)[:, 3]
    split, bounds, spares = np.hstack([columns, axis[:, None]]), [(0, 1)] * 4 + [(-0.4, 0.4)], []
    for momentum in (8.0, 16.0, -8.0, -16.0):  # N m s, of 20
        fills = np.sign(momentum) * axis
        for rate in 1e-3 * np.vstack([np.eye(3), -np.eye(3)]):
            torque = np.cross(rate, momentum * axis)
            push, unmade = made(np.arange(4) == 3, np.array([0, 0, 0, momentum]), torque)
            np.testing.assert_allclose(unmade, 0, atol=1e-9)
            least = linprog(np.r_[fills @ columns, 0], A_eq=split, b_eq=torque, bounds=bounds).fun
            spares.append(least < 0)
            assert fills @ np.asarray(push) < max(least, 0) + 1e-9
    assert any(spares)


LOST_WHEELS = [
    ("wheel A", 120, "'dead'"),
    ("wheel B", 360, "'stopped'"),
    ("wheel C", 700, "'dead'"),
]
STUCK = "'stuck-at', fraction=0.5"


@pytest.mark.slow
def test_three_wheels_fail_and_thrusters_take_their_axes():
    run = flight([*LOST_WHEELS, ("thruster 3", NEVER, STUCK)])
    trajectory = run.simulate()
    signals, times = trajectory.signals, np.asarray(trajectory.times)
    mode, kind = np.asarray(signals.mode), np.asarray(signals.parts["diagnosed_kind"])
    dead, stopped = DiagnosedKind.DEAD, DiagnosedKind.STOPPED
    assert kind[-1].tolist() == [-1] * 8 + [dead, stopped, dead, -1]
    assert set(mode) == {TolerantMode.THREE_AXES, TolerantMode.ALARM, TolerantMode.REALLOCATED}
    propellant = np.asarray(signals.parts["propellant"])
    assert np.all(propellant[times < 360] == 0)  # three wheels do without
    assert 0 < propellant[-1] < 5e-3
    assert float(trajectory.assessment.settled_from) < 600
    size = 2 * np.linalg.norm(np.asarray(signals.quaternion)[times > 900, 1:], axis=1)
    assert size.max() < 5e-4
    data = trajectory_dataset(trajectory, modes=run.modes)
    assert data["diagnosed_kind"].dims == ("time", "actuator")
    assert data["actuator"].values[[0, 8]].tolist() == ["thruster 1", "wheel 1"]


def wheels(momentum):
    each = "torque_limit_N_m=0.4, momentum_limit_N_m_s=20, tachometer_noise_N_m_s=2e-3, "
    each += f"coulomb_friction_N_m=0.01, momentum_N_m_s={momentum}"
    axes = zip("ABCD", (AXES.T * np.sqrt(2)).tolist(), strict=True)
    return "wheel=[" + ", ".join(f"{{name='{n}', axis={axis}, {each}}}" for n, axis in axes) + "]"


@pytest.mark.slow
def test_thrusters_take_momentum_out_of_wheels_that_are_full():
    """45 N m s about z, 1.2 times what wheels hold where the slew ends: it ends as without."""
    changes = [wheels(16.0), "initial.omega_rad_s=[0, 0, 0]", "simulation.duration_s=800"]
    sound = [(part, NEVER, kind) for part, _, kind in LOST_WHEELS]
    trajectory = flight([*sound, ("thruster 3", NEVER, STUCK)], *changes).simulate()
    signals, times = trajectory.signals, np.asarray(trajectory.times)
    momentum = np.asarray(signals.parts["wheel_momentum"])
    assert np.abs(momentum[-1]).max() < 6.0
    assert not np.any(np.asarray(signals.parts["diagnosed_kind"]) >= 0)
    propellant = np.asarray(signals.parts["propellant"])
    assert propellant[-1] == propellant[times > 400][0] > 0  # the dead band
    assert float(trajectory.assessment.settled_from) < 650


@pytest.mark.slow
def test_unloading_is_that_of_an_integration_by_hand():
    """Three wheels, one nearly full, of a body at rest: 0.2 of the natural frequency times its
    momentum, at most half of its torque, until a fifth of its limit is left. Throttled thrusters
    make it, and the body does not turn."""
    axes = ("[1,0,0]", "[0,1,0]", "[0,0,1]")
    limit, most, frequency, period, start = 6.0, 0.05, 0.05, 0.1, 5.4
    each = f"torque_limit_N_m={most},momentum_limit_N_m_s={limit},momentum_N_m_s="
    held = zip(axes, (start, 0.0, 0.0), strict=True)
    rows = ",".join(f"{{axis={axis},{each}{momentum}}}" for axis, momentum in held)
    ways = (*axes, *(axis.replace("1", "-1") for axis in axes))
    jets = ",".join(f"{{torque_axis={way},torque_N_m=0.2}}" for way in ways)
    changes = [
        f"wheel=[{rows}]",
        f"thruster=[{jets}]",
        "modulation={kind='ideal'}",
        "failure=[]",
        "initial={quaternion=[1,0,0,0],omega_rad_s=[0,0,0]}",
        f"control.natural_frequency_rad_s={frequency}",
        "control.torque_uncertainty=1e-6",
        f"control.period_s={period}",
        "simulation.duration_s=240",
        "simulation.save_every_s=20",
    ]
    trajectory = build(load("hybrid-wheels", changes)).simulate()
    momentum = np.asarray(trajectory.signals.parts["wheel_momentum"])
    told, now = [start], start
    for sample in range(2400):
        if now > 0.2 * limit:
            now -= period * min(0.2 * frequency * now, 0.5 * most)
        if (sample + 1) % 200 == 0:
            told.append(now)
    np.testing.assert_allclose(momentum[:, 0], told, atol=2e-3)
    np.testing.assert_allclose(momentum[:, 1:], 0, atol=2e-3)
    assert told[-1] < 0.2 * limit


@pytest.mark.slow
def test_a_stuck_thruster_and_two_lost_wheels_are_isolated_and_settle():
    lost = [LOST_WHEELS[0], LOST_WHEELS[1], ("wheel C", NEVER, "'dead'")]
    trajectory = flight([*lost, ("thruster 3", 250, STUCK)]).simulate()
    parts = trajectory.signals.parts
    momentum = np.asarray(parts["wheel_momentum"])[np.asarray(trajectory.times) > 270]
    assert np.abs(momentum).max() < 5.0  # thrusters oppose it, not wheels
    kind = np.asarray(parts["diagnosed_kind"])[-1]
    assert np.flatnonzero(kind >= 0).tolist() == [2, 8, 9]
    assert kind[[2, 8, 9]].tolist() == [
        DiagnosedKind.STUCK_AT, DiagnosedKind.DEAD, DiagnosedKind.STOPPED
    ]  # fmt: skip
    assert float(trajectory.assessment.settled_from) < 1080


@pytest.mark.slow
def test_a_thruster_that_opposes_a_stuck_one_is_known_as_weak_by_gaps_and_used():
    """Of six, one is stuck on, and one that pushes for 0.86 of the time against it makes 0.4: as
    far as pulses tell, it would push all the time whatever it is commanded."""
    arms = [[-4, 28, -16], [4, -28, -16], [-28, -4, -16], [-28, 4, 16], [4, 28, 16], [28, -4, 16]]
    each = ", torque_N_m=1.0, min_on_time_s=0.02}"
    jets = ", ".join(f"{{torque_axis={arm}{each}" for arm in arms)
    stuck = "{of='thruster 2', at_s=30, kind='stuck-on'}"
    weak = "{of='thruster 5', at_s=65, kind='degraded', fraction=0.4}"
    changes = [f"thruster=[{jets}]", f"failure=[{stuck}, {weak}]", "simulation.duration_s=200"]
    changes += ["initial.quaternion=[1, 0, 0, 0]", "initial.omega_rad_s=[0, 0, 0]"]
    trajectory = build(load("hybrid-wheels", changes, caution=print)).simulate()
    parts, times = trajectory.signals.parts, np.asarray(trajectory.times)
    kinds = [-1, DiagnosedKind.STUCK_ON, -1, -1, DiagnosedKind.DEGRADED, *[-1] * 5]
    assert np.all(np.asarray(parts["diagnosed_kind"])[times > 70] == kinds)
    thrusts = np.asarray(parts["thrust_level"])
    assert thrusts[times > 150].mean(axis=0)[4] == pytest.approx(0.4, abs=0.01)
    assert np.abs(np.asarray(parts["wheel_momentum"])[-1]).max() < 2.0
    assert float(trajectory.assessment.settled_from) < 80


@pytest.mark.slow
def test_cases_of_any_attitude_recover_without_a_false_alarm():
    columns = build_study(load("hybrid-wheels"), 12, seed=2).values(np.arange(12))
    assert np.all(np.isfinite(columns["settling_time"]))
    assert not columns["false_alarms"].any()
    assert not columns["isolated_kind"][:, :8].any()
    assert np.all(columns["isolated_kind"][:, [8, 9, 10]] > 0)
