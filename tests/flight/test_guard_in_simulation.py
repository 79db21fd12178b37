"""At samples with invalid measurements, the simulation does what the exported guard does."""

from typing import Any

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.tools import needs
from jaxsat.compiler.llvm.mapped import compiled_over_cases
from jaxsat.control.sampled import Guard
from jaxsat.core.errors import ArgumentError
from jaxsat.flight import vectors
from jaxsat.flight.reference import rows_of
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from tests.flight.guarded import Guarded

HELD = 7
"""Samples for which commands are held."""

OUTAGES = [
    "gyro={noise_density_rad_s_sqrt_Hz=1e-5, bias_walk_rad_s2_sqrt_Hz=1e-8, bias_sigma_rad_s=1e-5,"
    "outage_start_s=1.9, outage_s=2}",
    "star_tracker={across_rad=1e-5, along_rad=1e-4, outage_start_s=3, outage_s=2}",
]


def _flown(run, count: int) -> tuple[list[Any], list[Any]]:
    """The loop's states, and the inputs and states of its controller at as many samples."""
    loop = vectors._recording(run.loop)
    period = float(np.asarray(loop.controller.period))

    def one(case):
        state, number = case
        following = vectors._after(loop, number, period, state)
        return following, vectors._observation(run.loop, number, state, following)

    def compiled(function, case):
        shapes = jax.tree.map(lambda x: jax.ShapeDtypeStruct(np.shape(x), x.dtype), case)
        return compiled_over_cases(lambda case, shared: function(case), shapes, contract=False)

    cases = jax.tree.map(lambda x: np.asarray(x)[None], run.start)
    states = [compiled(loop.start, run.start)(cases)]
    first = jax.tree.map(lambda x: x[0], states[0])
    step, observed = compiled(one, (first, np.zeros((), np.int32))), []
    for number in range(count):
        following, sample = step((states[-1], np.full(1, number, np.int32)))
        states.append(following)
        observed.append(sample)
    return states, observed


def _row(tree) -> np.ndarray:
    return rows_of(tree)[0]


@needs("gcc")
@pytest.mark.slow
@pytest.mark.parametrize("name", ["switching", "thruster-dies"])
def test_simulation_and_flight_code_agree_to_the_bit_in_outages(tmp_path, name):
    """Commands, pulses, and the memories of law, estimator and modulator, at every sample: a gap
    of the gyro longer than commands are held, and one of the tracker that begins within it."""
    run: Any = build(load(name, [*OUTAGES, f"sampling.hold_samples={HELD}"]))
    period = float(np.asarray(run.loop.controller.period))
    states, observed = _flown(run, round(6 / period))
    guarded = Guarded(tmp_path, run.loop, run.start)
    rate, bits = guarded.places("rate"), guarded.bits
    guarded.begin(0, HELD, attitude=states[0].navigation.memory.last_input.attitude.q[0])
    kinds = []
    for number, (now, _) in enumerate(observed):
        row = _row(now)
        since = number * period - 1.9
        if 0 <= since < 2:
            row[rate] = np.nan
        status, commands, state = guarded.step(0, row)
        kinds.append(status & (bits["HELD"] | bits["ZERO"]))
        if number + 1 < len(observed):
            np.testing.assert_array_equal(state[:-1], _row(observed[number + 1][1]))
        asked = _asked(states[number + 1])
        found = np.concatenate([commands[_places(guarded, name)] for name in asked])
        np.testing.assert_array_equal(found, np.concatenate([*asked.values()]))
    gap = round(2 / period)
    assert kinds.count(bits["HELD"]) == HELD
    assert kinds.count(bits["ZERO"]) == gap - HELD


WHEELS = """
title = "Wheels"

[spacecraft]
inertia_kg_m2 = [42.0, 38.0, 25.0]

[orbit]
rate_rad_s = 0.0

[initial]
quaternion = [0.8, 0.6, 0.0, 0.0]
omega_rad_s = [0.003, 0.001, -0.002]

[control]
law = "quaternion-feedback"
natural_frequency_rad_s = 0.3
damping = 0.7
period_s = 0.1

[sampling]
hold_samples = 7

[simulation]
duration_s = 10
"""

WHEEL = """
[[wheel]]
axis = {axis}
torque_limit_N_m = 0.4
tachometer_noise_N_m_s = 1e-3
rotor_inertia_kg_m2 = 0.01
viscous_friction_N_m_s = 1e-4
coulomb_friction_N_m = 0.01
"""


@needs("gcc")
@pytest.mark.slow
def test_the_law_makes_no_step_in_an_outage_of_a_tachometer(tmp_path):
    """To the bit, with the estimator at work: a gap of one wheel's tachometer alone, and one in
    which the gyro's begins."""
    tables = [WHEEL.format(axis=axis) for axis in np.eye(3).tolist()]
    tables[1] += "tachometer_outage_start_s = 0.5\ntachometer_outage_s = 1.0\n"
    tables[2] += "tachometer_outage_start_s = 2.5\ntachometer_outage_s = 1.0\n"
    gyro, tracker = OUTAGES[0].replace("outage_start_s=1.9", "outage_start_s=3"), OUTAGES[1]
    place = tmp_path / "wheels.toml"
    place.write_text(WHEELS + "".join(tables))
    run: Any = build(load(place, [gyro, tracker]))
    states, observed = _flown(run, 60)
    guarded = Guarded(tmp_path, run.loop, run.start)
    rate, momentum, bits = *map(guarded.places, ("rate", "wheel_momentum")), guarded.bits
    guarded.begin(0, HELD, attitude=states[0].navigation.memory.last_input.attitude.q[0])
    told = []
    for number, (now, _) in enumerate(observed):
        row, flagged = _row(now), frozenset[str]()
        if 5 <= number < 15:
            row[momentum[1]] = np.nan
        elif 25 <= number < 35:
            flagged = frozenset(["wheel_momentum"])
        if 30 <= number < 50:
            row[rate] = np.inf
        status, commands, state = guarded.step(0, row, flagged)
        told.append(status)
        if number + 1 < len(observed):
            np.testing.assert_array_equal(state[:-1], _row(observed[number + 1][1]))
        asked = np.asarray(states[number + 1].guard.last.uses[0])[0]
        np.testing.assert_array_equal(commands[_places(guarded, "wheel_torque")], asked)
    gaps = np.array(told)
    without_momentum = (gaps & bits["INVALID_WHEEL_MOMENTUM"]) != 0
    assert np.flatnonzero(without_momentum).tolist() == [*range(5, 15), *range(25, 35)]
    held = np.flatnonzero(gaps & bits["HELD"])
    assert held.tolist() == [*range(5, 12), *range(25, 32)]
    zero = np.flatnonzero(gaps & bits["ZERO"])
    assert zero.tolist() == [*range(12, 15), *range(32, 50)]


VECTORS = [
    "orbit.inclination_deg=97",
    "magnetometer={noise_T=1e-7, outage_start_s=1.1, outage_s=1.5}",
    "sun_sensor={noise_rad=1e-3, outage_start_s=2.1, outage_s=1.2}",
]


@needs("gcc")
@pytest.mark.slow
@pytest.mark.parametrize("tracker", [True, False])
def test_invalid_vectors_are_missing_ones_to_the_bit(tmp_path, tracker):
    """A magnetometer with numbers that are none or flagged, and a Sun sensor without a direction,
    beside a star tracker and without one."""
    sensors = [OUTAGES[0], *([OUTAGES[1]] if tracker else []), *VECTORS]
    run: Any = build(load("switching", [*sensors, f"sampling.hold_samples={HELD}"]))
    period = float(np.asarray(run.loop.controller.period))
    states, observed = _flown(run, round(5 / period))
    guarded = Guarded(tmp_path, run.loop, run.start)
    places = {name: guarded.places(name) for name in ("rate", "magnetometer", "sun_sensor")}
    *field, field_seen = places["magnetometer"]
    *sun, sun_seen = places["sun_sensor"]
    guarded.begin(0, HELD, attitude=_first_estimate(states[0]))
    told = []
    for number, (now, _) in enumerate(observed):
        row, flagged, t = _row(now), frozenset[str](), number * period
        if 1.9 <= t < 3.9:
            row[places["rate"]] = np.nan
        if 1.1 <= t < 2.6:
            assert not row[field_seen]
            row[field_seen] = 1.0
            if number % 3 == 0:
                flagged = frozenset(["magnetometer"])
            row[field[number % 3]] = [0.0, np.nan, np.inf][number % 3]
        if 2.1 <= t < 3.3:
            assert not row[sun_seen]
            row[sun_seen] = 1.0
            row[sun[:3] if number % 2 else sun[3:]] = 0.0
        status, _, state = guarded.step(0, row, flagged)
        told.append(status)
        if number + 1 < len(observed):
            np.testing.assert_array_equal(state[:-1], _row(observed[number + 1][1]))
    for name, (begin, end) in {"MAGNETOMETER": (1.1, 2.6), "SUN_SENSOR": (2.1, 3.3)}.items():
        wrong = np.flatnonzero(np.array(told) & guarded.bits[f"INVALID_{name}"]) * period
        assert len(wrong) == round((end - begin) / period)
        assert begin - 1e-9 <= wrong[0] < wrong[-1] < end


def _first_estimate(state) -> np.ndarray:
    """The quaternion that the estimator begins with."""
    return np.asarray(state.navigation.memory.memory.belief.q)[0]


def _asked(state) -> dict[str, np.ndarray]:
    """The torque of the last period, or its pulses, by the names of commands."""
    (use,), (memory,) = state.guard.last.uses, state.effectors
    if memory is None:
        return {"torque": np.asarray(use)[0]}
    names = ("valve_on", "valve_off", "level")
    return {name: np.ravel(part) for name, part in zip(names, memory.pulses, strict=True)}


def _places(guarded: Guarded, name: str) -> np.ndarray:
    """Where a field of commands is among their numbers."""
    fields = guarded.program.structs["output"].fields
    names = np.repeat([field.path for field in fields], [field.size for field in fields])
    return np.flatnonzero(names == name)


def test_a_guard_holds_for_as_many_samples_as_it_is_told():
    guard = Guard(2)
    asked, state = jnp.array([3.0, -4.0]), guard.init(jnp.zeros(2))
    found = []
    for valid in (1, 0, 0, 0, 0, 1, 0):
        chosen, state = guard.command(guard.decide(jnp.array(valid == 1), state), asked, state)
        found.append(float(chosen[1]))
        asked = asked + 1
    assert found == [-4.0, -4.0, -4.0, 0.0, 0.0, 1.0, 1.0]
    with pytest.raises(ArgumentError, match="hold_samples"):
        Guard(-1)
