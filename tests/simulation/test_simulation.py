"""`simulate`: outcomes, retracing, the three loops, gradients."""

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from helpers.paper import (
    PAPER_RATE,
    PAPER_THREE_AXIS,
    actuators,
    bodies,
    rate_loop,
    rate_start,
    three_axis_law,
    three_axis_loop,
    three_axis_start,
)
from jaxsat.control.controller import Coast
from jaxsat.core.attitude import Quaternion
from jaxsat.core.solvers import NamedSolver, class_name
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.error_coordinates import ErrorCoordinateLoop
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.simulation.methods import AdaptiveSteps, adaptive, default_method, fixed
from jaxsat.simulation.trajectory import Outcome
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.disturbances import AbstractDisturbance, ConstantTorque
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft

TIMES = jnp.linspace(0.0, 10.0, 11)


class CountingTorque(AbstractDisturbance):
    """Counts how often it is traced."""

    torque: Float[Array, "3"]
    counter: list = eqx.field(static=True)

    def __call__(self, t, attitude, inertia):
        self.counter.append(1)
        return self.torque


class Counter(list):
    """A list that JAX may use as a key of its cache."""

    def __hash__(self):
        return id(self)

    def __eq__(self, other):
        return self is other


def coasting():
    return ContinuousLoop(bodies(PAPER_THREE_AXIS)[0].with_effectors((actuators(),)), Coast())


@pytest.mark.slow
def test_nothing_retraces_when_only_numbers_change():
    counter = Counter()

    def run(scale, replace=np.asarray):
        body = RigidBody(
            Spacecraft([400.0 * scale, 300.0, 250.0]),
            ExactOrbit(0.0011 * scale),
            CountingTorque(jnp.full(3, 0.01 * scale), counter),
        )
        law = three_axis_law(PAPER_THREE_AXIS, saturation_width=scale)
        loop = ContinuousLoop(body.with_effectors((actuators(5.0 * scale),)), law)
        loop = eqx.tree_at(lambda loop: loop.controller.k3, loop, replace(0.05 * scale))
        start = PlantState(Quaternion([1.0, 0.1 * scale, 0.0, 0.0]), [0.01 * scale, 0.0, 0.0])
        method = adaptive(1e-6 * scale, 1e-6, min_step=1e-6 * scale)
        return simulate(loop, start, TIMES * scale, method=method, state_limit=1e5 * scale)

    run(1.0)
    traced = len(counter)
    assert traced > 0
    results = [run(scale).signals.omega for scale in (0.9, 0.8)]
    results.append(run(0.7, jnp.array).signals.omega)  # a weak type
    assert len(counter) == traced
    assert not np.allclose(*results[:2])
    assert not np.allclose(*results[1:])


@pytest.mark.slow
def test_a_run_that_diverges_is_coded_and_blank_from_there_on():
    """A torque of 1 N m on 1 kg m² passes a rate limit of 2.5 rad/s at 2.5 s."""
    body = RigidBody(Spacecraft([1.0, 1.0, 1.0]), ExactOrbit(0.0), ConstantTorque([1.0, 0, 0]))
    loop = ContinuousLoop(body.with_effectors((actuators(),)), Coast())
    start = PlantState(Quaternion([1.0, 0, 0, 0]), [0.0, 0.0, 0.0])
    result = simulate(loop, start, TIMES, method=fixed(0.01), state_limit=2.5)
    assert result.outcome is Outcome.STATE_LIMIT
    np.testing.assert_allclose(result.signals.omega[:3, 0], [0, 1, 2], atol=1e-12)
    assert np.all(np.isnan(result.signals.omega[3:]))
    assert np.all(np.isnan(result.signals.torque[3:]))


@pytest.mark.slow
@pytest.mark.parametrize("method", [fixed(0.01), adaptive(1e-8, 1e-8)])
def test_a_run_that_turns_into_nan_is_coded(method):
    body = RigidBody(Spacecraft([1.0, 2.0, 3.0]), ExactOrbit(0.0), ConstantTorque([1.0, 0, 0]))
    loop = ContinuousLoop(body.with_effectors((actuators(),)), Coast())
    start = PlantState(Quaternion([1.0, 0, 0, 0]), [jnp.nan, 0.0, 0.0])
    result = simulate(loop, start, TIMES, method=method)
    assert result.outcome is not Outcome.SUCCESS
    assert np.all(np.isnan(result.signals.omega[1:]))
    assert result.outcome.explanation


@pytest.mark.slow
def test_a_run_out_of_steps_is_coded():
    method = adaptive(max_steps=16)
    result = simulate(coasting(), three_axis_start(PAPER_THREE_AXIS), TIMES * 20, method=method)
    assert result.outcome is Outcome.MAX_STEPS
    assert np.isnan(result.signals.z[-1])


@pytest.mark.slow
def test_a_bad_run_in_a_batch_spoils_no_other():
    loop, good = coasting(), three_axis_start(PAPER_THREE_AXIS)
    starts = jax.tree.map(lambda x: jnp.stack([x, x * jnp.nan, 0.5 * x]), good)
    method = adaptive(1e-8, 1e-8, max_steps=4096)
    batch = eqx.filter_vmap(lambda start: simulate(loop, start, TIMES, method=method))(starts)
    assert batch.code[0] == batch.code[2] == 0
    assert batch.code[1] != 0
    alone = simulate(loop, good, TIMES, method=method).signals
    np.testing.assert_allclose(batch.signals.w[0], alone.w, atol=1e-6)
    assert np.all(np.isfinite(batch.signals.w[2]))


@pytest.mark.parametrize("times", [[0.0], [0.0, 1.0, 1.0], [1.0, 0.0], [0.0, np.nan]])
def test_times_must_increase(times):
    with pytest.raises(ValueError, match="increasing"):
        simulate(
            three_axis_loop(PAPER_THREE_AXIS), three_axis_start(PAPER_THREE_AXIS), np.array(times)
        )


@pytest.mark.slow
def test_error_coordinates_and_torque_level_are_one_loop():
    """The smooth law needs no error coordinates: both forms integrate the same motion."""
    case = {**PAPER_THREE_AXIS, "third_rate": "free", "relation": "exact"}
    law = three_axis_law(case, saturation_width=1.0, tilt_width=0.2)
    plant, start = bodies(case)[0], three_axis_start(case)
    runs = [
        simulate(loop, start, TIMES * 3, method=adaptive(1e-11, 1e-11)).signals
        for loop in (
            ErrorCoordinateLoop(plant, law),
            ContinuousLoop(plant.with_effectors((actuators(),)), law),
        )
    ]
    for name in ("w", "z", "omega", "torque", "rate_error", "lyapunov"):
        np.testing.assert_allclose(getattr(runs[0], name), getattr(runs[1], name), atol=1e-8)


@pytest.mark.slow
def test_quaternion_and_wz_agree_until_z_leaves_its_range():
    """With a free third rate z winds up; the law sees it wrapped when the state is a quaternion."""
    case = {**PAPER_THREE_AXIS, "third_rate": "free"}
    loop, start = three_axis_loop(case), three_axis_start(case)
    times = jnp.linspace(0, 150, 151)
    method = adaptive(min_step=1e-10)
    wz = simulate(loop, start, times, method=method).signals
    turned = PlantState(start.attitude.as_quaternion(), start.omega)
    quaternion = simulate(loop, turned, times, method=method).signals
    assert jnp.abs(wz.z).max() < jnp.pi
    np.testing.assert_allclose(wz.omega, quaternion.omega, atol=1e-7)
    np.testing.assert_allclose(wz.w, quaternion.w, atol=1e-7)
    np.testing.assert_allclose(wz.z, quaternion.z, atol=1e-7)


@pytest.mark.parametrize(
    "change",
    [
        {"inertia": (450.0, 264.6, 312.5)},
        {"orbit_rate": 0.001},
        {"relation": "exact"},
        {"third_rate": "free"},
    ],
)
def test_error_coordinates_are_refused_where_law_and_plant_differ(change):
    with pytest.raises(ValueError, match=r"[Ll]aw and plant|third rate"):
        ErrorCoordinateLoop(
            bodies({**PAPER_THREE_AXIS, **change})[0], three_axis_law(PAPER_THREE_AXIS)
        )


def test_default_methods_suit_their_loops():
    assert class_name(default_method(three_axis_loop(PAPER_THREE_AXIS)).solver) == "Dopri8"
    for width in (0.0, 1e-4):
        loop = rate_loop(PAPER_RATE, width=width)
        assert isinstance(default_method(loop).step_size, AdaptiveSteps)
        low = default_method(loop, NamedSolver("heun"))
        assert isinstance(low.step_size, type(None) if width else AdaptiveSteps)


def terminal_cost(gains, loop_of, start, times, adjoint):
    run = simulate(loop_of(gains), start, times, adjoint=adjoint).signals
    return jnp.sum(run.w[-1] ** 2) + run.z[-1] ** 2 + 100 * jnp.sum(run.omega[-1] ** 2)


def central_differences(cost, gains, step=1e-5):
    values = []
    for i in range(len(gains)):
        shift = step * gains[i] * np.eye(len(gains))[i]
        values.append((cost(gains + shift) - cost(gains - shift)) / (2 * step * gains[i]))
    return np.array(values)


THREE_AXIS_GAINS = {"k3": 0.05, "mu": 1.0, "a": 0.1, "k4": 0.01}
RATE_GAINS = {"k1": 5.0, "k2": 10.0}


def printed_three_axis(gains):
    return three_axis_loop({**PAPER_THREE_AXIS, **dict(zip(THREE_AXIS_GAINS, gains, strict=True))})


def smooth_three_axis(gains):
    *gains, tilt_width = gains
    case = {**PAPER_THREE_AXIS, **dict(zip(THREE_AXIS_GAINS, gains, strict=True))}
    law = three_axis_law(case, saturation_width=1.0, tilt_width=tilt_width)
    return ContinuousLoop(bodies(case)[0].with_effectors((actuators(),)), law)


def printed_rate(gains):
    return rate_loop({**PAPER_RATE, **dict(zip(RATE_GAINS, gains, strict=True))})


def smooth_rate(gains):
    return rate_loop({**PAPER_RATE, **dict(zip(RATE_GAINS, gains, strict=True))}, width=1e-3)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("loop_of", "gains", "end", "tolerance"),
    [
        (smooth_three_axis, {**THREE_AXIS_GAINS, "tilt_width": 0.1}, 60.0, 1e-6),
        (smooth_rate, RATE_GAINS, 5.0, 1e-6),
        (printed_three_axis, THREE_AXIS_GAINS, 10.0, 1e-6),
        # From here on sat has switched next to w = 0, and a step that straddles the corner costs
        # derivatives more than it costs the state.
        (printed_three_axis, THREE_AXIS_GAINS, 60.0, 1e-2),
        (printed_rate, RATE_GAINS, 1.0, 1e-6),
    ],
)
def test_gradient_of_a_terminal_cost(loop_of, gains, end, tolerance):
    """All gains of each law against central differences, in forward mode."""
    values, times = jnp.array(list(gains.values())), jnp.linspace(0.0, end, 3)
    start = rate_start(PAPER_RATE) if gains is RATE_GAINS else three_axis_start(PAPER_THREE_AXIS)
    forward = diffrax.ForwardMode()
    exact = central_differences(
        jax.jit(lambda g: terminal_cost(g, loop_of, start, times, forward)), values
    )
    found = jax.jit(jax.jacfwd(terminal_cost), static_argnums=(1, 4))(
        values, loop_of, start, times, forward
    )
    logarithmic = np.abs(values * exact).max()  # gains differ in size: compare per relative change
    np.testing.assert_allclose(values * found, values * exact, rtol=0, atol=tolerance * logarithmic)
