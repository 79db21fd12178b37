"""Margins of requirements, against an evaluation of every instant at once in NumPy."""

import jax
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from helpers.derivatives import Derivatives
from helpers.every_law import PLACES
from jaxsat.core.attitude import Quaternion
from jaxsat.core.declaration.requirements import Inequality, Junction, Negation, Temporal
from jaxsat.scenario.formulas import parse
from jaxsat.simulation.requirements import compared, saved_margin
from jaxsat.spacecraft.environment.orbit import CircularOrbit
from jaxsat.spacecraft.environment.orbital_torques import Sunlight

END = 60.0
FAILURES = (12.0, 31.5, 80.0)

FORMULAS = [
    "always rate_x < 1 rad/s",
    "eventually[10 s, 20 s] rate_y > 100 deg/s",
    "always[10.3 s, 20.2 s] propellant < 300 g",
    "always[end - 10.2 s, end] rate_x >= -1 rad/s and not eventually propellant > 0.8 kg",
    "within 8 s of failure (rate_x < 0.1 rad/s and rate_y < 3 rpm or propellant > 0.9 kg)",
    "always[failure + 20.1 s, failure + 35 s] rate_y < 1 rad/s",
    "rate_x < 1.5 rad/s until[5 s, 40 s] (propellant < 0.3 kg and rate_y > 0 rad/s)",
    "rate_x < 1.5 rad/s until[5.1 s, 17.3 s] propellant < 0.3 kg",
    "(not (rate_x > 0.5 rad/s until rate_y > 1 rad/s) or always[0 s, 0 s] propellant < 1 kg)",
    "always[50.1 s, 50.2 s] rate_x < 0 rad/s",
    "not eventually[100 s, 200 s] rate_x > 0.1 rad/s",
    "not within 8 s of failure rate_x > 5 rad/s",
]


def at_each(formula, values):
    """Margins of a formula without windows at all instants."""
    if isinstance(formula, Inequality):
        margin = values[formula.signal] - formula.limit
        return -margin if formula.below else margin
    if isinstance(formula, Negation):
        return -at_each(formula.part, values)
    parts = [at_each(part, values) for part in formula.parts]
    return np.min(parts, axis=0) if formula.every else np.max(parts, axis=0)


def by_all_instants(formula, times, values, failures):
    if isinstance(formula, Negation):
        whole = by_all_instants(formula.part, times, values, failures)
        return whole if whole == np.inf else -whole
    if isinstance(formula, Junction):
        parts = [by_all_instants(part, times, values, failures) for part in formula.parts]
        return min(parts) if formula.every else max(parts)
    assert isinstance(formula, Temporal)
    results = [np.inf]
    for at in failures if formula.after_failure else (0.0,):
        anchors = {"start": 0.0, "end": times[-1], "failure": at}
        begin, end = (anchors[one.anchor] + one.offset for one in (formula.begin, formula.end))
        if begin > times[-1]:
            continue
        end = min(end, times[-1])
        grid = np.unique(np.concatenate([times, [begin, end]]))
        on_grid = {name: np.interp(grid, times, one) for name, one in values.items()}
        inside, held = (begin <= grid) & (grid <= end), at_each(formula.held, on_grid)
        if formula.until is not None:
            until = at_each(formula.until, on_grid)
            at_times = [min(until[i], held[:i].min(initial=np.inf)) for i in np.flatnonzero(inside)]
            results.append(max(at_times))
        elif formula.kind == "always":
            results.append(held[inside].min())
        else:
            results.append(held[inside].max())
    return min(results)


@pytest.mark.parametrize("text", FORMULAS)
def test_margins_are_those_of_all_instants_at_once(text):
    times, formula = np.arange(121) * 0.5, parse(text)
    for seed in range(3):
        walk = np.random.default_rng(seed).normal(size=(4, times.size)).cumsum(axis=1) * 0.3
        signals = {"omega": walk[:3].T, "propellant": np.abs(walk[3])}
        values = {"rate_x": walk[0], "rate_y": walk[1], "propellant": np.abs(walk[3])}
        found = saved_margin(formula, times, signals, np.array(FAILURES))
        wanted = by_all_instants(formula, times, values, FAILURES)
        assert float(found.value) == pytest.approx(wanted, abs=1e-12)


def test_the_deciding_comparison_and_time_give_the_margin():
    times = np.arange(11.0)
    signals = {"omega": np.stack([times, -times, 0 * times], axis=1), "propellant": times / 2}
    formula = parse("always[2 s, 8 s] (rate_x < 7 rad/s and propellant < 20 kg)")
    found = saved_margin(formula, times, signals, np.zeros(0))
    assert (float(found.value), int(found.comparison), float(found.time)) == (-1.0, 0, 8.0)


def test_a_run_that_ended_early_has_no_margin_after_its_end():
    times = np.arange(11.0)
    signals = {"propellant": np.where(times < 6, 1.0, np.nan)}
    for text, has_margin in (
        ("always[0 s, 5 s] propellant < 2 kg", True),
        ("always propellant < 2 kg", False),
        ("eventually[4 s, 8 s] propellant < 2 kg", False),
    ):
        margin = float(saved_margin(parse(text), times, signals, np.zeros(0)).value)
        assert np.isfinite(margin) == has_margin
    after_the_end = parse("always[failure, end] propellant < 2 kg")
    assert saved_margin(after_the_end, times, signals, np.array([20.0])).value == np.inf


def test_what_no_failure_has_tried_is_not_violated():
    """A window that has not begun is not judged, whatever its formula says of it."""
    times, signals = np.arange(11.0), {"omega": np.ones((11, 3))}
    for text in (
        "within 5 s of failure rate < 0.1 rad/s",
        "not within 5 s of failure rate > 0.1 rad/s",
        "not (within 5 s of failure rate > 0.1 rad/s and always[20 s, 30 s] rate > 0.1 rad/s)",
    ):
        for failures, untried in ((np.zeros(0), True), (np.array([20.0]), True), ([2.0], False)):
            margin = float(saved_margin(parse(text), times, signals, np.asarray(failures)).value)
            assert (margin == np.inf) == untried
            assert untried or margin == pytest.approx(0.1 - np.sqrt(3.0))


def test_signals_are_those_of_other_libraries():
    turn = Rotation.from_rotvec([0.4, -0.3, 0.9])
    q = np.roll(turn.inv().as_quat(), 1)  # from orbit to body axes: its rows are body axes
    light = Sunlight(np.array([1.0, 2.0, 0.5]), CircularOrbit(1e-3, 0.9, 0.4, 0.2, 0.0))
    t = jax.numpy.asarray(700.0)
    formula = parse(
        "always (pointing_error < 0 rad and tilt < 0 rad and sun_angle(1, 2, 2) < 0 rad and "
        "rate < 0 rad/s and wheel_momentum < 0 N m s)"
    )
    signals = {"quaternion": q, "omega": np.array([3.0, 4.0, 12.0])}
    signals["wheel_momentum"] = np.array([0.1, -0.7, 0.2])
    found = -np.asarray(compared(formula, signals, light(t)[0]))
    sun = np.asarray(light.orbit.axes(t)) @ [1.0, 2.0, 0.5]
    body = np.asarray(Rotation.from_quat(np.roll(q, -1)).as_matrix()).T @ sun
    third = Rotation.from_quat(np.roll(q, -1)).as_matrix()[2, 2]
    cosine = body @ [1, 2, 2] / 3 / np.linalg.norm(body)
    wanted = [turn.magnitude(), np.arccos(third), np.arccos(cosine), 13.0, 0.7]
    np.testing.assert_allclose(found, wanted, rtol=1e-12)


ANGLES = parse(
    "always (pointing_error < 0 rad and tilt < 0 rad and sun_angle(1, 2, 2) < 0 rad and "
    "rate < 0 rad/s)"
)


def margins_beside(x, quaternion):
    turned = quaternion + Quaternion(quaternion).rate(x[:3]).q
    signals = {"quaternion": Quaternion(turned).normalised().q, "omega": x[3:]}
    return compared(ANGLES, signals, jax.numpy.array([0.6, 0.0, 0.8]))


@pytest.mark.parametrize("place", PLACES)
def test_derivatives_of_margins_are_finite_and_equal_to_differences(place):
    """Angles and sizes have a corner at the target and half a turn from it."""
    derivatives = Derivatives(margins_beside, ["φ", "θ", "ψ", "ω1", "ω2", "ω3"])
    quaternion = np.array(PLACES[place])
    assert derivatives.at(np.zeros(6), quaternion).wrong == []
    moving = derivatives.at([0.1, -0.2, 0.05, 0.1, -0.3, 0.2], quaternion)
    assert moving.wrong == []
    assert moving.compared == set(derivatives.names)
