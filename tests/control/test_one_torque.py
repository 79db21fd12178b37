"""The law of one torque: its equations, its proof, and flights from any rates of any body."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp

from control.test_normal_form import any_inertia
from jaxsat.control.inertia_fit import InertiaFit, TorqueAxisFrame
from jaxsat.control.one_torque import OneTorqueMode
from jaxsat.core.allocation import allocation_matrix, plane_map, torque_axis
from jaxsat.core.inertia import torque_axis_frame
from jaxsat.scenario import ScenarioError, ScenarioWarning
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build

w, x, y = sympy.symbols("w x y", real=True)
alpha, gamma, delta, eta, zeta, p = sympy.symbols("alpha gamma delta eta zeta p", positive=True)
MOBILITY = sympy.Matrix([[alpha, 0, gamma], [0, delta, eta], [gamma, eta, zeta]])
COUPLING = (delta - alpha) * x**2 + 2 * eta * x * y + (zeta - alpha) * y**2


def drift():
    """dh/dt = h × J⁻¹h along (b, d, e)."""
    momentum = sympy.Matrix([w, x, y])
    return momentum.cross(MOBILITY * momentum)


def is_zero(expression):
    return sympy.simplify(sympy.expand(expression)) == 0


def test_equations_are_eulers():
    about, first, second = drift()
    assert is_zero(first - (-gamma * w**2 + w * ((alpha - zeta) * y - eta * x) + gamma * y**2))
    assert is_zero(second - (w * ((delta - alpha) * x + eta * y) - gamma * x * y))
    holding = (zeta - delta) * x * y + eta * (x**2 - y**2)
    assert is_zero(about - gamma * x * w - holding)


def test_held_momentum_turns_to_one_side():
    """w = 0: x² + y² stays, and V = (R - x) / (R + x) obeys dV/dt = -2γR V."""
    _, first, second = (part.subs(w, 0) for part in drift())
    assert is_zero(x * first + y * second)
    radius = sympy.sqrt(x**2 + y**2)
    measure = (radius - x) / (radius + x)
    change = sympy.diff(measure, x) * first + sympy.diff(measure, y) * second
    assert is_zero(change + 2 * gamma * radius * measure)


def test_turning_is_never_slower_than_that():
    """(x dy - y dx)/dt is convex in w for y > 0, and -γ y R² or less at 0 and at -C / (pγy)."""
    _, first, second = drift()
    turn = sympy.expand(x * second - y * first)
    assert is_zero(turn - (gamma * y * w**2 + COUPLING * w - gamma * y * (x**2 + y**2)))
    asked = -COUPLING / (p * gamma * y)
    rest = -(COUPLING**2) / (gamma * y) * (1 / p - 1 / p**2)
    assert is_zero(turn.subs(w, asked) - (rest - gamma * y * (x**2 + y**2)))


def test_brake_takes_y_down_as_a_power_of_x():
    """At the leading order in y: d ln y / d ln x = p under w = -(δ-α)x² / (pγy)."""
    _, first, second = drift()
    small = sympy.symbols("small", positive=True)
    asked = -(delta - alpha) * x**2 / (p * gamma * y)
    ratio = (second / y) / (first / x)
    power = sympy.limit(ratio.subs(w, asked).subs(y, small * y), small, 0)
    assert is_zero(power - p)


def test_damping_takes_energy():
    """d(hᵀJ⁻¹h / 2)/dt = u b·ω: the drift does no work."""
    momentum, u = sympy.Matrix([w, x, y]), sympy.symbols("u")
    rates = MOBILITY * momentum
    power = (rates.T * (drift() + sympy.Matrix([u, 0, 0])))[0]
    assert is_zero(power - u * (alpha * w + gamma * y))


def test_momentum_that_a_principal_axis_leaves():
    j1, j2, j3, w1, w2, w3 = sympy.symbols("j1 j2 j3 w1 w2 w3")
    kept = (j1 - j2) * j2 * w2**2 + (j1 - j3) * j3 * w3**2
    rate2, rate3 = (j3 - j1) * w3 * w1 / j2, (j1 - j2) * w1 * w2 / j3
    assert is_zero(sympy.diff(kept, w2) * rate2 + sympy.diff(kept, w3) * rate3)


@pytest.mark.slow
def test_frame_of_random_bodies():
    rng = np.random.default_rng(3)
    inertias = np.array([any_inertia(rng) for _ in range(50)])
    axes = rng.normal(size=(50, 3))
    axes = axes / np.linalg.norm(axes, axis=1, keepdims=True)
    found = jax.vmap(TorqueAxisFrame.of)(inertias, axes)
    for number, (inertia, axis) in enumerate(zip(inertias, axes, strict=True)):
        rows, mobility = torque_axis_frame(inertia, axis)
        np.testing.assert_allclose(found.axes[number], rows, atol=1e-9)
        np.testing.assert_allclose(rows @ rows.T, np.eye(3), atol=1e-12)
        scale = mobility[0, 0]
        names = ("alpha", "gamma", "delta", "eta", "zeta")
        entries = mobility[[0, 0, 1, 1, 2], [0, 2, 1, 2, 2]]
        ours = [getattr(found, name)[number] for name in names]
        np.testing.assert_allclose(np.array(ours) / scale, entries / scale, atol=1e-9)
        assert abs(mobility[0, 1]) < 1e-12 * scale
        assert mobility[0, 2] >= 0


@pytest.mark.slow
def test_inertia_is_found_in_flight():
    """From the model's error of a twelfth to a hundredth, on a flight by SciPy."""
    rng = np.random.default_rng(4)
    moments = np.array([1.0, 0.8, 0.6])
    axis = np.array([0.6, 0.48, 0.64])
    true = np.diag(moments * [1.06, 0.95, 1.08])
    true[0, 1] = true[1, 0] = 0.01
    lean = axis + 0.01 * np.array([0.64, 0.0, -0.6])
    fit = InertiaFit(moments, axis, 3e-5, 1e-4)
    memory, omega, period = fit.init(jnp.zeros(3)), np.array([0.2, -0.1, 0.15]), 0.1
    sample = jax.jit(lambda memory, omega: fit.sampled(memory, omega, jnp.asarray(period)))
    for number in range(300):
        memory = sample(memory, jnp.asarray(omega))
        torque = 0.02 * np.sin(0.1 * number * period)
        memory = memory._replace(torque=jnp.asarray(torque))

        def rate(_, rates, torque=torque):
            return np.linalg.solve(true, lean * torque - np.cross(rates, true @ rates))

        omega = solve_ivp(rate, (0, period), omega, rtol=1e-9, atol=1e-12).y[:, -1]
        omega = omega + 1e-6 * rng.normal(size=3)
    inertia, believed = fit.believed(memory)
    wanted = lean / np.linalg.norm(lean)
    along = np.linalg.norm(lean)
    assert np.abs(np.asarray(inertia) - true / along).max() < 0.01
    assert np.abs(np.asarray(believed) - wanted).max() < 0.002


def test_allocation_of_one_torque():
    pair = np.array([[0.6, 0.8, 0.0], [-0.6, -0.8, 0.0]]).T
    np.testing.assert_allclose(torque_axis(pair), [0.6, 0.8, 0.0])
    np.testing.assert_allclose(allocation_matrix(pair, 1), [[0.5], [-0.5]])
    np.testing.assert_allclose(plane_map(pair, 1), [[0.6], [0.8], [0.0]])
    for axes in (np.eye(3)[:, :2], np.zeros((3, 0))):
        with pytest.raises(ValueError, match="one axis alone"):
            torque_axis(axes)


BASE = [
    "control.law=one-torque",
    "title=one",
    "spacecraft.thruster_torque_axes=[[0.8,0.5,0.331662479]]",
    "spacecraft.failed_thrusters=[]",
]


def flown(*changes, duration=600):
    """Rates and modes of a flight under a 5 N m torque about a skew axis."""
    overrides = [*BASE, f"simulation.duration_s={duration}", *changes]
    signals = build(load("acceptance-nominal", overrides)).simulate().signals
    return np.asarray(signals.omega), np.asarray(signals.mode)


@pytest.mark.parametrize("axis", ["[1,0,0]", "[0,1,0]", "[0,0,1]"])
def test_principal_axis_is_refused(axis):
    change = f"spacecraft.thruster_torque_axes=[{axis}]"
    with pytest.raises(ScenarioError, match="takes a torque axis that is no principal axis"):
        load("acceptance-nominal", [*BASE, change])


@pytest.mark.parametrize(
    ("axis", "told"),
    [((1, 0.05, 0.02), "at least a tenth of a radian"), (None, "turn a momentum against")],
)
def test_axes_that_stop_slowly_or_not_always_are_told(axis, told):
    """The second axis is about z across J: b1²/J1 + b2²/J2 = 1/J3."""
    moments = np.array([449.5, 264.6, 312.5])
    share = (1 / moments[2] - 1 / moments[1]) / (1 / moments[0] - 1 / moments[1])
    axis = axis or (share**0.5, (1 - share) ** 0.5, 0)
    change = f"spacecraft.thruster_torque_axes=[{list(map(float, axis))}]"
    with pytest.warns(ScenarioWarning, match=told):
        load("acceptance-nominal", [*BASE, change])


def test_more_than_one_axis_is_refused():
    with pytest.raises(ScenarioError, match="one axis alone"):
        load("acceptance-nominal", [*BASE, "spacecraft.thruster_torque_axes=[[1,0,0],[0,1,0]]"])


@pytest.mark.slow
def test_flight_comes_to_rest():
    omega, mode = flown()  # saved every half second
    assert set(mode) >= {OneTorqueMode.BRAKING, OneTorqueMode.RESTING}
    assert np.linalg.norm(omega[-100:], axis=1).max() < 1e-3


@pytest.mark.slow
def test_mass_and_time_may_be_of_any_unit():
    """J, T, d times 7; rates over 3 and torques over 9 with times three times as long."""
    sizes = {
        "spacecraft.inertia_kg_m2": ((449.5, 264.6, 312.5), 1, 0),
        "spacecraft.torque_limit_N_m": (5.0, 1, -2),
        "disturbance.amplitude_N_m": ((0.01, 0.02, 0.001), 1, -2),
        "disturbance.frequency_rad_s": ((0.7, 0.8, 0.1), 0, -1),
        "orbit.rate_rad_s": (0.0011, 0, -1),
        "initial.omega_rad_s": ((0.1, -0.11, 0.05), 0, -1),
        "control.rest_rate_rad_s": (8e-4, 0, -1),
        "control.period_s": (0.1, 0, 1),
        "simulation.save_every_s": (0.1, 0, 1),
        "simulation.duration_s": (60.0, 0, 1),
    }

    def motion(mass, time):
        scaled = {k: np.array(v) * mass**m * time**t for k, (v, m, t) in sizes.items()}
        changes = [f"{key}={value.tolist()!r}" for key, value in scaled.items()]
        signals = build(load("acceptance-nominal", [*BASE, *changes])).simulate().signals
        return np.asarray(signals.omega) * time, np.asarray(signals.mode)

    omega, mode = motion(1.0, 1.0)
    for factors in ((7.0, 1.0), (1.0, 3.0)):
        found = motion(*factors)
        np.testing.assert_allclose(found[0], omega, atol=1e-8)
        np.testing.assert_array_equal(found[1], mode)
