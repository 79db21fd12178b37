"""The guard keeps invalid measurements from a controller, and changes nothing for valid ones."""

import equinox as eqx
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from helpers.tools import needs
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.laws import LAWS as ALL_LAWS
from jaxsat.flight.flight import flight_loop
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState
from tests.flight.guarded import Guarded, check_status, faulty_flights, pointing_errors
from tests.flight.laws import Clocked, Filtered, loop_of, start

FILTER = [
    "gyro.noise_density_rad_s_sqrt_Hz=1.5e-5",
    "star_tracker.across_rad=2.4e-5",
    "star_tracker.along_rad=1.2e-4",
    "star_tracker.latency_s=0.2",
]


@pytest.fixture(scope="module", params=[False, True], ids=["double", "single"])
def clocked(request, tmp_path_factory):
    """A law that commands the time, and the time times a rate."""
    folder = tmp_path_factory.mktemp("clocked")
    return Guarded(folder, loop_of(Clocked()), start(), single=request.param)


@pytest.fixture(scope="module")
def estimating(tmp_path_factory):
    """A law behind an estimator whose star tracker has a latency."""
    run = build(load("switching", FILTER))
    return Guarded(tmp_path_factory.mktemp("estimating"), run.loop, run.start)


def _row(number: int, first: int = 0, rate=(0.125, 0.25, 0.5)) -> list[float]:
    """A sample of a controller that is told the truth, half a second after the last."""
    return [first + number, 1.0, 0.0, 0.0, 0.0, *rate]


def _measured(rng, number: int) -> np.ndarray:
    """A sample of a controller with an estimator, in which an attitude has arrived."""
    q = np.array([1.0, 0, 0, 0]) + 1e-3 * rng.normal(size=4)
    return np.array([number, *(1e-3 * rng.normal(size=3)), *q / np.hypot.reduce(q), 1])


@needs("gcc")
@pytest.mark.parametrize("single", [False, True], ids=["double", "single"])
def test_valid_samples_are_those_of_the_controller_to_the_bit(tmp_path, single):
    guarded = Guarded(tmp_path, loop_of(Filtered(gain=[3.0, 2.0])), start(), single=single)
    rng = np.random.default_rng(0)
    guarded.begin(0)
    for number in range(200):
        row = _row(number, rate=rng.normal(size=3))
        status, *found = guarded.step(0, row)
        assert status == 0
        for one, other in zip(found, guarded.plain(0, number == 0, row), strict=True):
            np.testing.assert_array_equal(one, other)


@needs("gcc")
def test_an_invalid_attitude_is_an_outage_of_the_star_tracker(estimating):
    """To the bit as if none had arrived, which is what the simulation tells in an outage."""
    rng, bits = np.random.default_rng(0), estimating.bits
    seen, attitude = estimating.places("seen")[0], estimating.places("attitude")
    bad = [[0.0] * 4, [np.nan, 0, 0, 0], [np.inf] * 4, [2.0, 0, 0, 0]]
    estimating.begin(0)
    for number in range(60):
        row = _measured(rng, number)
        given, flagged = row.copy(), frozenset()
        if 20 <= number < 40:
            row[seen] = 0
            flagged = frozenset(["attitude"]) if number % 5 == 4 else flagged
            given[attitude] = given[attitude] if flagged else bad[number % 5]
        status, *found = estimating.step(0, given, flagged)
        assert status == (bits["INVALID_ATTITUDE"] if 20 <= number < 40 else 0)
        for one, other in zip(found, estimating.plain(0, number == 0, row), strict=True):
            np.testing.assert_array_equal(one, other)


@needs("gcc")
def test_the_estimator_coasts_while_the_rate_is_invalid(estimating):
    """With the last valid rate, and with the attitudes that arrive; the law's command is held."""
    rng, bits = np.random.default_rng(0), estimating.bits
    rate = estimating.places("rate")
    fields = estimating.program.structs["state"].fields
    parts = [field.path.split(".")[0] == "estimator" for field in fields]
    of_estimator = np.repeat(parts, [field.size for field in fields])
    estimating.begin(0)
    last, held = np.zeros(3), None
    for number in range(60):
        row = _measured(rng, number)
        given, gap = row.copy(), 20 <= number < 28
        if gap:
            given[rate], row[rate] = np.nan, last
        status, commands, state = estimating.step(0, given)
        full = estimating.plain(0, number == 0, row)[1]
        assert status == (bits["INVALID_RATE"] | bits["HELD"] if gap else 0)
        if number < 28:
            np.testing.assert_array_equal(state[of_estimator], full[of_estimator])
        if gap:
            np.testing.assert_array_equal(commands, held)
        else:
            held, last = commands, row[rate]


@needs("gcc")
def test_the_controller_begins_with_the_first_valid_measurements(estimating):
    rng, bits = np.random.default_rng(0), estimating.bits
    estimating.begin(0, attitude=[0.0, np.nan, 0.0, 0.0])
    seen = estimating.places("seen")[0]
    for number in range(3):
        row = _measured(rng, number)
        row[seen] = 0
        status, commands, _ = estimating.step(0, row)
        assert status == bits["ZERO"]
        assert not commands.any()
    row = _measured(rng, 3)
    status, *found = estimating.step(0, row)
    assert status == 0
    told = estimating.plain(0, True, row, row[estimating.places("attitude")])
    for one, other in zip(found, told, strict=True):
        np.testing.assert_array_equal(one, other)


@needs("gcc")
@pytest.mark.parametrize("first", [0, 20_000, 1_600_000_000, 2**31 - 20])
@pytest.mark.parametrize("hold", [0, 3])
def test_commands_are_held_then_zero_and_the_law_resumes_at_its_time(clocked, first, hold):
    """Times of 0, 1e4 and 8e8 s, and a counter that wraps."""
    bits = clocked.bits
    clocked.begin(0, hold)
    bad = [np.nan, np.inf, -np.inf, 1e30]
    for number in range(40):
        row = _row(number, first)
        row[0] = (row[0] + 2**31) % 2**32 - 2**31
        gap = 10 <= number < 18
        if gap:
            row[clocked.places("omega")[number % 3]] = bad[number % 4]
        status, commands, state = clocked.step(0, row)
        t = 0.5 * number
        if gap:
            held = number < 10 + hold
            assert status == bits["INVALID_OMEGA"] | bits["HELD" if held else "ZERO"]
            t = 0.5 * 9 if held else 0.0
        else:
            assert status == 0
        np.testing.assert_array_equal(commands[:2], [t, 0.25 * t])
        passed = min(number, 9) if gap else number
        steps = [n for n in range(passed + 1) if not 10 <= n < 18]
        assert state[0] == sum(0.5 * n for n in steps)  # the law's memory: the sum of times


@needs("gcc")
def test_skipped_and_repeated_samples_are_told(clocked):
    bits = clocked.bits
    clocked.begin(0, 2)
    told = {}
    for call, number in enumerate([0, 1, 4, 4, 5, 3, 3, 3, 6]):
        told[call] = clocked.step(0, _row(number))
    status = [told[call][0] for call in range(9)]
    held, zero = bits["REPEATED"] | bits["HELD"], bits["REPEATED"] | bits["ZERO"]
    assert status == [0, 0, bits["SKIPPED"], held, 0, held, held, zero, 0]
    assert [told[call][1][0] for call in range(9)] == [0, 0.5, 2, 2, 2.5, 2.5, 2.5, 0, 3]


@needs("gcc")
def test_measurements_that_the_caller_flags_are_not_used(clocked):
    clocked.begin(0)
    clocked.step(0, _row(0))
    for group in ("attitude", "omega"):
        clocked.step(0, _row(1))
        before = clocked.step(0, _row(2))[2]
        status, _, state = clocked.step(0, _row(3), frozenset([group]))
        assert status == clocked.bits[f"INVALID_{group.upper()}"] | clocked.bits["HELD"]
        np.testing.assert_array_equal(state, before)
        clocked.begin(0)


class _Rooted(AbstractSampledController):
    """It commands a number only where the rate is positive."""

    period: Float[Array, ""] = eqx.field(converter=as_float, default=0.5)

    def init(self, state: PlantState):
        """Nothing."""
        return jnp.zeros_like(state.omega[0])

    def step(self, t, state, memory):
        """The root of the rate."""
        return jnp.sqrt(state.omega[:2]), memory + state.omega[0]


@needs("gcc")
def test_commands_that_are_no_numbers_are_not_used(tmp_path):
    guarded = Guarded(tmp_path, loop_of(_Rooted()), start())
    guarded.begin(0)
    guarded.step(0, _row(0))
    status, commands, state = guarded.step(0, _row(1, rate=(-1.0, 0.25, 0.5)))
    assert status == guarded.bits["REJECTED"] | guarded.bits["HELD"]
    np.testing.assert_array_equal(commands[:2], np.sqrt([0.125, 0.25]))
    assert state[0] == 0.125
    assert guarded.step(0, _row(2))[0] == 0


NEAR = ["initial.quaternion=[0.98,0.1,-0.1,0.14]", "initial.omega_rad_s=[0.001,-0.002,0.001]"]

LAWS = [
    ("two-torque-free", [], 180, 2.0),
    ("oscillatory-dispersed", [], 200, 2.0),
    ("switching", [], 300, 2.0),
    ("cubesat-12u", NEAR, 200, 2.0),
    ("wheels-fail", NEAR, 200, 2.0),
    ("one-torque-damping", [], 500, None),
    ("two-torque-free", ["control.law=planned"], 300, 2.0),
]
"""Every law of the library: scenario, changes, duration (s), largest final error (deg); one law
damps rates alone."""


def test_each_law_that_can_become_flight_code_is_among_these():
    """`magnetic` takes orbits to settle, and the other laws of the library run in continuous
    time."""
    flown = {load(name, keys).law.name for name, keys, *_ in LAWS}
    sampled = {name for name, law in ALL_LAWS.items() if law.declaration.sampled}
    assert flown == sampled - {"magnetic"}


@needs("gcc")
@pytest.mark.slow
@pytest.mark.parametrize(("name", "keys", "duration", "degrees"), LAWS)
def test_every_law_recovers_from_invalid_measurements(tmp_path, name, keys, duration, degrees):
    """One flight without faults, and others with one fault each, after 10 s."""
    run = build(load(name, keys))
    loop = flight_loop(run.loop, run.start)
    guarded = Guarded(tmp_path, loop, run.start)
    assert isinstance(loop, SampledLoop)
    flown = faulty_flights(loop, run.start, guarded, duration)
    check_status(flown, guarded, float(np.asarray(loop.controller.period)))
    assert (np.linalg.norm(np.asarray(flown.plant.omega), axis=1) < 0.05).all()
    if degrees is not None:
        errors = pointing_errors(flown.plant)
        assert (errors < degrees).all(), errors
