"""A single run of the compiled engine against diffrax, and what its details are."""

import dataclasses
import gc

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.simulation.engine import single
from jaxsat.simulation.engine.native import engine
from jaxsat.simulation.engine.single import TABLE, _program, fly, simulate
from jaxsat.simulation.methods import adaptive, fixed

SMOOTH = ("rate-limited", ["simulation.duration_s=30"], 3e-9)
"""The torque turns over at 18 s, where diffrax is 6e-10 of its size off a finer run."""
SAMPLED = ("two-torque-free", ["simulation.duration_s=30"], 1e-10)
CORNERS = ("paper-three-axis", ["simulation.duration_s=30"], 1e-9)
PULSES = ("pulsed-two-torque", ["simulation.duration_s=8", "simulation.save_every_s=0.4"], 1e-9)
FINE = ["simulation.solver.rtol=1e-11", "simulation.solver.atol=1e-12"]
WHEELS = ("two-wheel-telescope", ["simulation.duration_s=20", *FINE], 1e-8)
"""diffrax steps across the instants at which a motor leaves its limit."""
ROUNDED = ("switching-rounded", ["simulation.duration_s=20"], 1e-9)


def refuse(obstacle):
    raise AssertionError(obstacle)


def of(name, changes):
    return build(load(name, changes))


@pytest.mark.slow
@pytest.mark.parametrize(
    ("name", "changes", "tolerance"),
    [SMOOTH, SAMPLED, CORNERS, PULSES, WHEELS, ROUNDED],
)
def test_a_run_is_that_of_diffrax(name, changes, tolerance):
    run = of(name, changes)
    found = run.simulate(refuse)
    told = simulate(run.loop, run.start, run.times, method=run.method)
    kept = [
        jax.tree_util.tree_leaves_with_path(
            eqx.tree_at(_steps_and_effort, x, (0, 0, 0), is_leaf=lambda x: x is None)
        )
        for x in (found, told)
    ]
    assert [path for path, _ in kept[0]] == [path for path, _ in kept[1]]
    for (path, x), (_, y) in zip(*kept, strict=True):
        x, y = np.asarray(x, float), np.asarray(y, float)
        size = np.abs(y[np.isfinite(y)]).max(initial=1)
        where = jax.tree_util.keystr(path)
        np.testing.assert_allclose(x, y, rtol=0, atol=tolerance * size, err_msg=where)
    # diffrax sums |T| up by Simpson's rule, past corners as well
    efforts = found.assessment.effort, told.assessment.effort
    np.testing.assert_allclose(*efforts, rtol=2e-4, atol=1e-9 * float(jnp.max(efforts[1])))


@pytest.mark.slow
@pytest.mark.parametrize(("name", "settles"), [("rate-limited", False), ("two-torque-free", True)])
def test_a_run_does_not_depend_on_how_often_it_is_saved(name, settles):
    both = [
        of(name, ["simulation.duration_s=120", f"simulation.save_every_s={save}"]).simulate(refuse)
        for save in (1, 20)
    ]
    assert [len(one.times) for one in both] == [121, 7]
    assert np.isfinite(both[0].assessment.settled_from) == settles
    ends = [jax.tree.leaves((one.final, one.assessment)) for one in both]
    for x, y in zip(*ends, strict=True):
        np.testing.assert_allclose(x, y, rtol=0, atol=1e-9)


def _steps_and_effort(trajectory):
    assessment = trajectory.assessment
    return trajectory.steps, assessment.effort, assessment.constraint_effort


@pytest.mark.slow
def test_efforts_are_integrals_of_what_is_saved():
    changes = ["simulation.duration_s=10", "simulation.save_every_s=0.002"]
    found = of("paper-three-axis", changes).simulate(refuse)
    torque = np.abs(np.asarray(found.signals.torque))
    effort = np.trapezoid(torque, found.times, axis=0)
    np.testing.assert_allclose(found.assessment.effort, effort, rtol=3e-6)
    held = np.abs(np.asarray(found.signals.constraint_torque))
    held = np.trapezoid(held, found.times)
    np.testing.assert_allclose(found.assessment.constraint_effort, held, rtol=3e-6)


@pytest.mark.slow
def test_levels_and_torques_between_saved_times_are_those_of_all_samples():
    changes = ["simulation.duration_s=2.4"]
    each = of("pulsed-two-torque", [*changes, "simulation.save_every_s=0.1"]).simulate(refuse)
    some = of("pulsed-two-torque", [*changes, "simulation.save_every_s=0.4"]).simulate(refuse)
    levels = np.asarray(each.signals.parts["thrust_level"])
    assert levels.max() > 0
    mean = levels[:-1].reshape(6, 4, -1).mean(axis=1)
    np.testing.assert_allclose(some.signals.parts["thrust_level"][:-1], mean, rtol=1e-12)
    np.testing.assert_array_equal(some.signals.parts["thrust_level"][-1], levels[-1])
    least = np.asarray(each.torque_range.least)[:-1].reshape(6, 4, 3).min(axis=1)
    np.testing.assert_array_equal(some.torque_range.least[:-1], least)
    means = np.asarray(each.torque_range.mean)[:-1].reshape(6, 4, 3).mean(axis=1)
    np.testing.assert_allclose(some.torque_range.mean[:-1], means, rtol=1e-12, atol=1e-18)
    np.testing.assert_array_equal(some.signals.omega, each.signals.omega[::4])


def test_tables_are_no_numbers_of_the_case():
    """Machine code would grow with a table of gains that it copies number by number."""
    run = of("rods-only", [])
    program, (numbers, tables) = _program(run.loop, run.start, 2.0, 1, None)
    law = jax.tree.leaves(run.loop.controller)
    assert [x.shape for x in tables] == [x.shape for x in law if x.size > TABLE]
    assert len(tables) == 1
    case = program.case_factory(numbers, tables)
    found, expected = (jax.tree.leaves(x) for x in ((case.loop, case.start), (run.loop, run.start)))
    assert all(x is y for x, y in zip(found, expected, strict=True))


@pytest.mark.slow
def test_other_numbers_compile_nothing(monkeypatch):
    monkeypatch.setattr(engine, "_kernels", {})
    first = of(*SMOOTH[:2]).simulate(refuse)
    longer = ["simulation.duration_s=50", "control.k1=0.06", "initial.omega_rad_s=[0.1,0.2,0.1]"]
    second = of(SMOOTH[0], longer).simulate(refuse)
    assert len(engine._kernels) == 1
    assert len(second.times) > len(first.times)
    assert not np.allclose(second.signals.omega[0], first.signals.omega[0])


def test_a_run_does_not_search_for_dead_cycles(monkeypatch):
    """One search of the objects of JAX takes as long as a short flight."""
    searching = []

    def plan(*_):
        searching.append(gc.isenabled())
        raise LookupError

    monkeypatch.setattr(single, "_plan", plan)
    with pytest.raises(LookupError):
        of(*SMOOTH[:2]).simulate()
    assert searching == [False]
    assert gc.isenabled()


@pytest.mark.slow
def test_what_the_engine_cannot_run_is_told_and_run_by_diffrax():
    run = of(*SMOOTH[:2])
    told = []
    unbounded = adaptive(1e-9, 1e-9)
    found = fly(run.loop, run.start, run.times[:6], unbounded, told.append)
    assert "smallest step" in told.pop()
    assert found.outcome == 0
    uneven = jnp.array([0.0, 1.0, 3.0])
    found = fly(run.loop, run.start, uneven, run.method, told.append)
    assert "even" in told.pop()
    every = fly(run.loop, run.start, jnp.arange(4.0), run.method, told.append)
    assert not told
    np.testing.assert_allclose(found.signals.omega[2], every.signals.omega[3], rtol=1e-9)


@pytest.mark.slow
def test_a_point_without_derivative_is_passed_as_by_diffrax():
    run, remarks = of("paper-rate", ["simulation.duration_s=60"]), []
    rates = run.simulate(remarks.append).signals.omega
    (remark,) = remarks
    change = float(remark.split("at most ")[1].split()[0])
    assert change < 1e-8
    reference = simulate(run.loop, run.start, run.times, method=run.method).signals.omega
    assert 0 < np.abs(rates - reference).max() < 1e-8


@pytest.mark.slow
def test_a_run_that_depends_on_its_tolerances_is_told_since_when():
    short = ["simulation.duration_s=200"]
    remarks = []
    finer = of("free-third-rate", short).simulate(remarks.append).signals.omega
    fine = ["simulation.solver.name=dopri8"]
    fine += [f"simulation.solver.{key}=1e-12" for key in ("rtol", "atol")]
    fine += ["simulation.solver.min_step_s=1e-5"]
    exact = of("free-third-rate", short + fine).simulate(remarks.append).signals.omega
    parted = float(remarks[0].split(" from ")[1].split()[0])
    assert 150 < parted < 200
    row = int(parted / 0.5)
    assert np.abs(finer[:row] - exact[:row]).max() < 1e-4
    assert len(remarks) == 1


@pytest.mark.slow
def test_a_run_is_differentiated_by_diffrax():
    run = of(SMOOTH[0], ["simulation.duration_s=3"])
    told = []

    def last(rate):
        start = dataclasses.replace(run.start, omega=run.start.omega.at[0].set(rate))
        return dataclasses.replace(run, start=start).simulate(told.append).signals.omega[-1, 0]

    rate, step = run.start.omega[0], 1e-5
    slope = jax.jit(jax.grad(last))(rate)
    assert all(remark.endswith("JAX traces its numbers") for remark in told)
    assert len(told) == 1
    change = (last(rate + step) - last(rate - step)) / (2 * step)
    np.testing.assert_allclose(slope, change, rtol=1e-7)


@pytest.mark.slow
def test_steps_are_somewhat_shorter_where_times_ask_for_it():
    run = of(*SMOOTH[:2])
    coarse = dataclasses.replace(run, method=fixed(0.3)).simulate(refuse)
    assert int(coarse.steps) == 4 * (len(run.times) - 1)  # saved every second


@pytest.mark.slow
def test_a_run_that_diverges_tells_until_when():
    run = of(*SMOOTH[:2])
    fast = dataclasses.replace(run.start, omega=jnp.array([1e7, 0.0, 0.0]))
    found = dataclasses.replace(run, start=fast).simulate(refuse)
    assert found.outcome.name == "STATE_LIMIT"
    assert np.isnan(found.signals.omega[-1]).all()
    assert np.isnan(found.assessment.effort).all()
    assert np.isinf(found.assessment.at_rest_from)
