"""The cost's bounds and its derivatives: what tuning rests on."""

import diffrax
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from helpers.paper import PAPER_THREE_AXIS, actuators, three_axis_start
from jaxsat.control.controller import AbstractFeedbackLaw
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.attitude import WZ
from jaxsat.core.tolerances import Tolerances
from jaxsat.simulation.engine.adaptive import AdaptiveStepper, Tolerance
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.program import program_of
from jaxsat.simulation.engine.progress import RunningCost, Unsettled
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.error_coordinates import ErrorCoordinateLoop
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.simulation.methods import Method, adaptive
from jaxsat.simulation.sampled_loop import SampledLoop
from simulation.engine.examples import KICKS, Kicked, smooth_law

DURATION = 6.0
COST = RunningCost(settling=2.0, unsettled=Unsettled(Tolerances(0.5, 0.5, 0.1)), limit=3.0)


class Damped(AbstractFeedbackLaw):
    """Torque against rates and attitude: quicker to compile than the three-axis law."""

    k3: Float[Array, ""]

    def torque(self, t, state):
        stiffness = 3.0 + 0.3 * jnp.sin(t)
        return -self.k3 * (300.0 * state.omega[:2] + stiffness * state.attitude.w)


def damped_loop():
    plant, _ = smooth_law()
    loop = ContinuousLoop(plant.with_effectors((actuators(),)), Damped(jnp.array(1.0)))
    return loop, three_axis_start(PAPER_THREE_AXIS)


def error_loop():
    return ErrorCoordinateLoop(*smooth_law()), three_axis_start(PAPER_THREE_AXIS)


class Held(AbstractSampledController):
    """The same, held over each period."""

    k3: Float[Array, ""]
    period: Float[Array, ""]

    def init(self, state):
        return None

    def step(self, t, state, memory):
        return Damped(self.k3).torque(t, state), memory


def sampled_loop():
    loop, begin = damped_loop()
    return SampledLoop(loop.plant, Held(jnp.array(1.0), jnp.array(0.1)), substeps=1), begin


LOOPS = {
    "damped": damped_loop,
    "sampled": sampled_loop,
}
ENGINES = {
    "scan": ScanEngine(FixedStepper(), 2),
    "adaptive": ScanEngine(AdaptiveStepper(tolerance=Tolerance(1e-11, 1e-11)), 2),
    "diffrax": ReferenceEngine(adaptive(1e-11, 1e-11, diffrax.Tsit5()), batch_size=2),
    "direct": ReferenceEngine(
        Method(diffrax.Tsit5(), diffrax.ConstantStepSize(), jnp.array(0.02), 400),
        2,
        diffrax.DirectAdjoint(),
    ),
}


def program(loop, begin, cost=COST):
    return program_of(Kicked(loop, begin), loop, DURATION, cost=cost)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("kind", "engine", "mode"),
    [
        ("damped", "scan", "reverse"),
        ("damped", "adaptive", "forward"),
        ("damped", "diffrax", "forward"),
        ("damped", "direct", "reverse"),
        ("sampled", "scan", "reverse"),
    ],
)
def test_both_modes_against_central_differences(kind, engine, mode):
    """Each engine and mode, and reverse mode, which transposes forward mode, of both steppers."""
    prog, engine, step = program(*LOOPS[kind]()), ENGINES[engine], 1e-5
    gain = jnp.array(1.0)
    found = engine.gradient(prog, KICKS[:2], gain, mode)
    plain = engine.evaluate(prog, KICKS[:2], gain)
    np.testing.assert_allclose(found.outputs.cost, plain.cost, rtol=1e-9)
    costs = [engine.evaluate(prog, KICKS[:2], gain + shift).cost for shift in (step, -step)]
    expected = (costs[0] - costs[1]) / (2 * step)
    size = np.abs(expected).max()
    assert size > 1e-3
    np.testing.assert_allclose(found.derivatives, expected, atol=2e-5 * size)


def test_adaptive_steps_of_the_scan_engine_have_no_reverse_mode():
    prog = program(*error_loop())
    with pytest.raises(ValueError, match='must be "forward" with adaptive steps'):
        ENGINES["adaptive"].gradient(prog, KICKS[:1], jnp.array(1.0), "reverse")


@pytest.mark.slow
@pytest.mark.parametrize("engine", ["scan", "diffrax"])
def test_a_failed_run_is_charged_for_the_time_it_lacks(engine):
    """Two cases that fail at once, as no state may be as large as theirs."""
    loop, begin = damped_loop()
    kicks = np.array([[np.nan, 0, 0], [1e7, 0, 0]])
    outputs = ENGINES[engine].evaluate(program(loop, begin), kicks, jnp.array(1.0))
    assert np.all(outputs.code != 0)
    np.testing.assert_allclose(outputs.cost, 3.0 * DURATION, rtol=0.2)
    assert np.all(outputs.cost <= 3.0 * DURATION * (1 + 1e-12))
    without = program(loop, begin, RunningCost())
    assert np.all(np.isnan(ENGINES[engine].evaluate(without, kicks, jnp.array(1.0)).cost))


def test_the_cost_saturates_and_never_exceeds_its_limit():
    signals = (jnp.array([0.3, 0.4]), jnp.array(0.2), jnp.zeros(3), jnp.ones(3))
    plain = RunningCost(attitude="wz")(*signals)
    np.testing.assert_allclose(plain, 0.25 + 0.04 + 3e-3)
    bounded = RunningCost(limit=2.0, attitude="wz")
    np.testing.assert_allclose(bounded(*signals), plain / (1 + plain / 2.0))
    far = (1e5 * signals[0], *signals[1:])
    assert 1.999 < bounded(*far) < 2.0


def attitude_cost(w, z, attitude="rotation"):
    still = jnp.zeros(3)
    return RunningCost(w=0.7, z=1.3, attitude=attitude)(
        jnp.asarray(w), jnp.asarray(z), still, still
    )


@pytest.mark.slow
def test_the_attitude_costs_what_its_quaternion_says():
    """w (q1² + q2²) + 4 z q3², the same for z and z + 2π, and never more than w or 4 z."""
    rng = np.random.default_rng(0)
    w, z = rng.normal(size=(200, 2)) * 3, rng.uniform(-9, 9, 200)
    q = jax.vmap(lambda w, z: WZ(w, z).as_quaternion().q)(jnp.asarray(w), jnp.asarray(z))
    expected = 0.7 * (q[:, 1] ** 2 + q[:, 2] ** 2) + 1.3 * 4 * q[:, 3] ** 2
    found = jax.vmap(attitude_cost)(jnp.asarray(w), jnp.asarray(z))
    np.testing.assert_allclose(found, expected, rtol=1e-12, atol=1e-14)
    assert np.all(found <= 4 * 1.3)
    np.testing.assert_allclose(jax.vmap(attitude_cost)(jnp.asarray(w), z + 2 * jnp.pi), found)
    assert attitude_cost([3e8, -4e8], 1.0) == pytest.approx(0.7)


@pytest.mark.slow
def test_near_the_target_both_costs_of_the_attitude_are_equal_to_second_order():
    for attitude in ("rotation", "wz"):
        slope = jax.grad(lambda x: attitude_cost(x[:2], x[2], attitude))  # noqa: B023
        assert not np.any(slope(jnp.zeros(3)))
        curvature = jax.jacfwd(slope)(jnp.zeros(3))
        np.testing.assert_allclose(curvature, np.diag([1.4, 1.4, 2.6]), atol=1e-12)
    for size in (1e-2, 1e-3):
        one = attitude_cost([size, -size], size)
        other = attitude_cost([size, -size], size, "wz")
        assert abs(float(one - other)) < 10 * size**4


def test_the_cost_of_the_attitude_has_the_derivative_that_differences_have():
    for x in ([0.3, -0.2, 1.0], [30.0, 20.0, 2.5], [0.0, 0.0, 3.1], [2.0, 0.0, -40.0]):
        x, step = jnp.array(x), 1e-6
        found = jax.grad(lambda x: attitude_cost(x[:2], x[2]))(x)
        shifts = step * np.eye(3)
        expected = [
            (attitude_cost((x + s)[:2], (x + s)[2]) - attitude_cost((x - s)[:2], (x - s)[2])) / 2e-6
            for s in shifts
        ]
        np.testing.assert_allclose(found, expected, atol=1e-8)


def test_the_smooth_settling_time_is_near_the_true_one():
    """An exponential decay of the attitude crosses the tolerance at a known time."""
    decay, initial, limits = 0.05, 0.6, Tolerances(0.05, 0.05, 1e-3)
    times = np.linspace(0, 300, 30001)
    w = jnp.stack([initial * jnp.exp(-decay * times), 0 * times], axis=1)
    rate = jax.vmap(lambda w: Unsettled(limits)(w, jnp.array(0.0), jnp.zeros(3)))(w)
    true = np.log(initial / 0.05) / decay
    np.testing.assert_allclose(np.trapezoid(rate, times), true, rtol=0.02)


@pytest.mark.parametrize(
    "wrong", [{"limit": 0.0}, {"settling": -1.0}, {"settling": 1.0}, {"attitude": "w"}]
)
def test_bounds_of_the_cost_are_checked(wrong):
    with pytest.raises((ValueError, TypeError), match=next(iter(wrong))):
        RunningCost(**wrong)
