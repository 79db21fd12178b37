"""The oscillatory law: averaged equations against exact motion, closed loop against both."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.integrate import solve_ivp

from control.cases import ORBIT_RATE, C, actuators, form, paper_fit, ripple_filter_of
from control.laws import OscillatoryLaw
from jaxsat.control.demands import MorinSamson, TwoChannel
from jaxsat.control.estimators import ThirdAxis, ThirdAxisEstimator
from jaxsat.control.normal_form import tilt_of
from jaxsat.control.oscillatory import Oscillation, Oscillator, Slow
from jaxsat.core.attitude import WZ, Quaternion
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState

NU = 0.3
FORM = form()
STRAIGHT = jnp.array([1.0, 0.0])
DEMANDS = {"morin-samson": MorinSamson(0.01, 0.85), "two-channel": TwoChannel(0.02, 0.012)}


def oscillator(demand="morin-samson", orbit_rate=ORBIT_RATE, **options):
    gains = {"frequency": NU, "tilt_gain": 0.5, "rate_gain": 2.0}
    limits = {"largest_amplitude": 0.1, "ratio": 2.0}
    model = form(orbit_rate=orbit_rate)
    return Oscillator(model, DEMANDS[demand], **{**gains, **limits, **options})


def known(omega3, model=FORM):
    zero = jnp.zeros_like(omega3)
    products = jnp.zeros(6).at[0].set(C)
    return ThirdAxis(
        omega3,
        jnp.zeros(2),
        jnp.array(C),
        STRAIGHT,
        zero,
        zero,
        products,
        jnp.zeros(3),
        model.orbit_rate,
        model.rest,
        zero,
    )


def drifting_oscillation(alpha, beta, rho, orbit_rate, slow_rate, slow_turn, q=1.0):
    """(36) and dω3/dt = c ω1 ω2 by SciPy, the rates relative to the orbit frame prescribed.

    Starts on the oscillation, so that s and ẑ begin at `slow_rate` and `slow_turn`. The sines of a
    flat-topped oscillation are those of a phase whose tangent is 1/q times as large.
    """
    periods, samples = 12, 50
    part = (1 + q) / 2
    longer = 1.0 if q == 1 else np.arccos(q) / np.sqrt(1 - q**2)

    def relative(t):
        s, c = np.sin(NU * t), np.cos(NU * t)
        s = np.sin(np.arctan2(s, q * c))
        return rho * s, (alpha * part * s + beta * c) / rho

    def rate(t, y):
        w1, w2, z, omega3 = y
        tilt = np.array(
            [
                [1 + w1**2 - w2**2, 2 * w1 * w2],
                [2 * w1 * w2, 1 - w1**2 + w2**2],
                [2 * w2, -2 * w1],
            ]
        ) / (1 + w1**2 + w2**2)
        frame = -orbit_rate * tilt @ [np.sin(z), np.cos(z)]
        r1, r2 = relative(t)
        r3 = omega3 - frame[2]
        return [
            r3 * w2 + (1 + w1**2 - w2**2) * r1 / 2 + w1 * w2 * r2,
            -r3 * w1 + (1 - w1**2 + w2**2) * r2 / 2 + w1 * w2 * r1,
            r3 + w1 * r2 - w2 * r1,
            C * (r1 + frame[0]) * (r2 + frame[1]),
        ]

    phi, theta = -rho / NU * longer, -alpha * part / (NU * rho) * longer
    root = np.sqrt(4 - phi**2 - theta**2)  # |w|² = |(φ, θ)|² / (4 - |(φ, θ)|²)
    turn = slow_turn + C * alpha / (8 * NU**2)
    turn = turn - (1 - C) * orbit_rate / NU**2 * np.sin(turn) * beta / rho
    by_frame = C * orbit_rate * (phi * np.cos(turn) + theta * np.sin(turn))
    omega3 = slow_rate - C * beta / (4 * NU) - by_frame
    times = np.linspace(0, 2 * np.pi * periods / NU, periods * samples + 1)
    start = [phi / root, theta / root, turn, omega3]
    return times, solve_ivp(rate, times[[0, -1]], start, t_eval=times, rtol=1e-9, atol=1e-13).y.T


@pytest.mark.parametrize(("orbit_rate", "begin"), [(0.0, 0.1), (ORBIT_RATE, 0.1), (ORBIT_RATE, -2)])
@pytest.mark.parametrize(
    ("alpha", "beta", "q"), [(4e-5, 0.0, None), (-2e-5, 6e-5, None), (4e-5, 0.0, 0.2)]
)
def test_averaged_equations(alpha, beta, q, orbit_rate, begin):
    """s and ẑ are free of ripple and drift at cα/2 + c ω0² sin z cos z and s - β/2ν."""
    rho, slow_rate = 0.006, 1e-4
    shape = 1.0 if q is None else q
    times, states = drifting_oscillation(alpha, beta, rho, orbit_rate, slow_rate, begin, shape)
    law = oscillator(orbit_rate=orbit_rate)
    roundness = None if q is None else jnp.array(q)
    last = Oscillation(jnp.array(alpha), jnp.array(beta), jnp.array(rho), STRAIGHT, roundness)

    @jax.jit
    @jax.vmap
    def slow(t, y):
        return law.slow(t, tilt_of(WZ(y[:2], y[2])), known(y[3], law.form), last)

    found = slow(jnp.array(times), jnp.array(states))
    rate, turn = solve_ivp(
        lambda t, y: [
            C * alpha / 2 + C * orbit_rate**2 * np.sin(2 * y[1]) / 2,
            y[0] - beta / (2 * NU),
        ],
        times[[0, -1]],
        [slow_rate, begin],
        t_eval=times,
        rtol=1e-9,
    ).y
    ripple = np.std(states[:, 3] - np.polyval(np.polyfit(times, states[:, 3], 1), times))
    assert np.abs(found.rate - rate).max() < 0.15 * ripple
    moved = np.abs(turn - begin).max()
    assert moved > 0.01
    assert np.abs(found.turn - turn).max() < 0.02 * moved + 1e-4


@pytest.mark.slow
@pytest.mark.parametrize("demand", list(DEMANDS))
def test_closed_loop_follows_the_averaged_equations(demand):
    """A free body from z = 0.05: ẑ(t) by the whole loop against the linear equation solved."""
    law = oscillator(demand, largest_amplitude=1.0)
    model = law.form.model
    controller = OscillatoryLaw(law, ThirdAxisEstimator(law.form, None, None), jnp.inf, 0.02)
    loop = SampledLoop(model.with_effectors((actuators(),)), controller)
    start = PlantState(WZ([0.0, 0.0], 0.05), [0.0, -ORBIT_RATE, 0.0])
    times = jnp.linspace(0, 400, 401)
    run = simulate(loop, start, times).signals
    if demand == "morin-samson":
        system = np.array([[0, -(0.01**2)], [1, 0]]) + np.array([[-2 * 0.85 * 0.01, 0], [0, 0]])
    else:
        system = np.diag([-0.02, -0.012])
    # After the oscillation has started up, from what it is then.
    begin = 60
    window = 21  # a period of the oscillation is 20.9 s
    mean = np.convolve(np.asarray(run.z), np.ones(window) / window, "same")
    mean_rate = np.convolve(np.asarray(run.omega[:, 2]), np.ones(window) / window, "same")
    at = np.asarray(times)[begin:-window]
    exact = solve_ivp(
        lambda t, y: system @ y,
        (at[0], at[-1]),
        [mean_rate[begin], mean[begin]],
        t_eval=at,
        rtol=1e-8,
        atol=1e-12,
    ).y[1]
    assert np.abs(mean[begin]) > 0.01
    np.testing.assert_allclose(mean[begin:-window], exact, atol=0.05 * np.abs(exact).max())
    assert np.abs(exact[-1]) < 0.2 * np.abs(exact[0])


def test_demand_is_cut_at_the_largest_amplitude():
    """h <= r ρm², the direction kept, the amplitudes then ρm and r ρm."""
    law = oscillator("two-channel")
    for rate, turn in ((1.0, -2.0), (1e-7, 1e-6)):
        wanted = law.oscillation(_slow(rate, turn), known(jnp.zeros(())))
        raw = law.demand(jnp.array(rate), jnp.array(turn), jnp.array(C), jnp.array(NU))
        size, most = np.hypot(*raw), 2.0 * 0.1**2
        reached = np.hypot(wanted.alpha, wanted.beta)
        assert reached == pytest.approx(min(size, most), rel=1e-6)
        np.testing.assert_allclose(wanted.alpha * raw[1], wanted.beta * raw[0], rtol=1e-9)
        assert reached / wanted.amplitude**2 == pytest.approx(2.0, rel=1e-3)
    assert law.oscillation(_slow(1.0, 1.0), known(jnp.zeros(()))).amplitude < 0.1 + 1e-8


def test_tilt_is_finite_upside_down_and_agrees_with_wz():
    tilt = tilt_of(Quaternion([0.0, 0.6, 0.8, 0.0]))
    assert np.all(np.isfinite(tilt))
    near = tilt_of(Quaternion([0.0, 0.6, 0.8, 1e-9]))
    assert np.hypot(near.phi, near.theta) == pytest.approx(2.0, abs=1e-6)
    wz = WZ([0.4, -1.3], 2.1)
    tilt = tilt_of(wz)
    norm = np.hypot(0.4, 1.3)
    np.testing.assert_allclose(
        tilt, [0.8 / np.hypot(1, norm), -2.6 / np.hypot(1, norm), 2.1, norm], rtol=1e-12
    )


@pytest.mark.parametrize("field", ["frequency", "tilt_gain", "ratio"])
def test_impossible_gains_are_refused(field):
    with pytest.raises(ValueError, match=f"`{field}` must be positive"):
        oscillator(**{field: 0.0})


def _slow(rate, turn):
    return Slow(jnp.array(rate), jnp.array(turn))


def test_new_gains_compile_nothing():
    """Numbers are leaves: a second law runs in the first one's program."""
    traced = []

    @eqx.filter_jit
    def first_step(law, state):
        traced.append(None)
        controller = OscillatoryLaw(
            law, ThirdAxisEstimator(law.form, ripple_filter_of(0.1), paper_fit()), jnp.inf, 0.1
        )
        return controller.step(jnp.zeros(()), state, controller.init(state))[0]

    state = PlantState(WZ([0.1, 0.1], 0.1), [0.0, 0.0, 0.01])
    first = first_step(oscillator(), state)
    second = first_step(oscillator(tilt_gain=0.7), state)
    assert len(traced) == 1
    assert not np.allclose(first, second)


def test_a_turn_at_rest_is_left_to_the_end_game():
    """Within ± rest the area channel is silent; beyond it begins at zero."""
    rate, coupling, frequency = jnp.array(1e-4), jnp.array(C), jnp.array(NU)
    plain, resting = TwoChannel(0.02, 0.012), TwoChannel(0.02, 0.012, 0.01)

    def asked(demand, turn):
        return np.array(demand(rate, jnp.array(turn), coupling, frequency))

    alpha = -2 / C * 0.02 * 1e-4
    np.testing.assert_allclose(asked(resting, 0.0099), [alpha, 0.0])
    np.testing.assert_allclose(asked(resting, -0.0099), [alpha, 0.0])
    near, far = asked(resting, 0.010001)[1], asked(resting, 3.0)[1]
    assert 0 < near < 1e-7
    assert far == pytest.approx(2 * NU * (0.012 * 2.99 + 1e-4 * 2.99 / 3.0))
    np.testing.assert_allclose(asked(plain, 0.0)[1], 2 * NU * 1e-4)

    plain, resting = MorinSamson(0.01, 0.85), MorinSamson(0.01, 0.85, 0.02)
    np.testing.assert_allclose(asked(resting, 0.05), asked(plain, 0.03))
    np.testing.assert_allclose(asked(resting, -0.01), asked(plain, 0.0))


@pytest.mark.parametrize("demand", list(DEMANDS))
def test_what_belongs_to_the_dead_zone_is_not_asked_for(demand):
    """|(α, β)| is less by that of the dead zone's slow rate, its direction the same."""
    plain, law = oscillator(demand), oscillator(demand, dead_zone=2e-5)
    third = known(jnp.array(0.0))

    def asked(law, rate):
        found = law.oscillation(Slow(jnp.array(rate), jnp.array(0.0)), third)
        return np.array([found.alpha, found.beta]), float(found.amplitude)

    left = np.linalg.norm(asked(plain, 2e-5)[0])
    wanted, amplitude = asked(law, 1e-4)
    whole, _ = asked(plain, 1e-4)
    np.testing.assert_allclose(wanted, whole * (1 - left / np.linalg.norm(whole)), rtol=1e-6)
    assert amplitude == pytest.approx(np.sqrt(np.linalg.norm(wanted) / 2.0), rel=1e-3)
    assert asked(law, 1.9e-5)[1] < 1e-8
    slope = jax.grad(lambda rate: law.oscillation(Slow(rate, jnp.array(0.0)), third).amplitude)
    assert np.isfinite(slope(1.9e-5))
    assert np.isfinite(slope(0.0))
