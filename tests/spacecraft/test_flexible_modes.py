"""Flexible modes: against Lagrange's equations in SciPy, closed forms, energy and momentum."""

import diffrax
import jax.numpy as jnp
import numpy as np
import pytest
import sympy
from scipy.integrate import solve_ivp
from scipy.spatial.transform import Rotation

from jaxsat.control.controller import Coast
from jaxsat.core.attitude import Quaternion
from jaxsat.core.declaration.wheels import WheelFailureKind
from jaxsat.simulation.engine.single import simulate
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.simulation.methods import adaptive
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.flexible_modes import FlexibleModes, ModeStates
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.spacecraft.steering import Steered
from jaxsat.spacecraft.wheel_failures import WheelFailures
from jaxsat.spacecraft.wheels import WheelMomenta, Wheels, wheel_momentum

INERTIA = np.array([[50.0, 2.0, -1.0], [2.0, 60.0, 3.0], [-1.0, 3.0, 40.0]])
COUPLINGS = np.array([[3.0, 0.5], [-1.0, 2.0], [0.5, 3.5]])
SIZES = np.linalg.norm(COUPLINGS, axis=0)
FREQUENCY, DAMPING = np.array([0.9, 1.7]), np.array([0.02, 0.01])
OMEGA = np.array([0.1, -0.15, 0.08])
ANGLES = np.array([0.02, -0.01])
TIMES = np.linspace(0.0, 30.0, 7)


def flown(inertia, couplings, frequency, damping, omega, angles, times=TIMES):
    modes = FlexibleModes(couplings, np.linalg.norm(couplings, axis=0), frequency, damping)
    body = RigidBody(Spacecraft(inertia), ExactOrbit(0.0), effectors=(modes,))
    own = ModeStates(angles, np.zeros(modes.count))
    start = PlantState(Quaternion([1.0, 0, 0, 0]), omega, (own,))
    loop = ContinuousLoop(body, Coast(), Steered())
    found = simulate(loop, start, times, method=adaptive(1e-11, 1e-12, diffrax.Dopri8()))
    assert int(found.code) == 0
    return found


def lagrange():
    """d/dt of (ω, η, dη/dt) by Lagrange's equations in quasi-coordinates.

    With T = ωᵀJω/2 + Σ η' d·ω + Σ η'²/2: d/dt ∂T/∂ω + ω × ∂T/∂ω = 0 for the body, and for each
    mode d/dt ∂T/∂η' = -Ω² η - 2ζΩ η'.
    """
    omega, speeds = sympy.Matrix(sympy.symbols("w:3")), sympy.Matrix(sympy.symbols("v:2"))
    amplitudes = sympy.Matrix(sympy.symbols("n:2"))
    inertia, couplings = sympy.Matrix(INERTIA), sympy.Matrix(COUPLINGS)
    kinetic = (omega.T * inertia * omega)[0] / 2 + (speeds.T * speeds)[0] / 2
    kinetic += (omega.T * couplings * speeds)[0]
    motion = sympy.Matrix([*omega, *speeds])
    momenta = sympy.Matrix([kinetic]).jacobian(motion).T
    mass = momenta.jacobian(motion)
    turning = -omega.cross(sympy.Matrix(momenta[:3]))
    springs = [
        -(FREQUENCY[k] ** 2) * amplitudes[k] - 2 * DAMPING[k] * FREQUENCY[k] * speeds[k]
        for k in range(2)
    ]
    force = sympy.Matrix([*turning, *springs])
    symbols = (*omega, *amplitudes, *speeds)
    both = sympy.lambdify([symbols], (mass, force))

    def rate(t, state):
        matrix, right = both(state)
        second = np.linalg.solve(matrix, right)[:, 0]
        return [*second[:3], *state[5:], *second[3:]]

    return rate


@pytest.mark.slow
def test_body_and_modes_move_by_lagranges_equations():
    found = flown(INERTIA, COUPLINGS, FREQUENCY, DAMPING, OMEGA, ANGLES)
    first = [*OMEGA, *(ANGLES * SIZES), 0.0, 0.0]
    exact = solve_ivp(lagrange(), (0, 30), first, "DOP853", TIMES, rtol=1e-12, atol=1e-13).y
    np.testing.assert_allclose(found.signals.omega, exact[:3].T, atol=1e-10)
    angles = np.asarray(found.signals.parts["mode_angle"])
    np.testing.assert_allclose(angles * SIZES, exact[3:5].T, atol=1e-9)
    np.testing.assert_array_equal(found.signals.torque, np.zeros((7, 3)))


@pytest.mark.slow
def test_without_damping_energy_and_momentum_stay():
    found = flown(INERTIA, COUPLINGS, FREQUENCY, np.zeros(2), OMEGA, ANGLES)
    body = RigidBody(
        Spacecraft(INERTIA),
        ExactOrbit(0.0),
        effectors=(FlexibleModes(COUPLINGS, SIZES, FREQUENCY),),
    )

    def of(omega, own, quaternion):
        momentum = np.array(body.total_momentum(PlantState(Quaternion(quaternion), omega, own)))
        (state,) = own
        stored = momentum - INERTIA @ omega
        springs = np.sum(SIZES**2 * (state.rate**2 + FREQUENCY**2 * state.angle**2)) / 2
        energy = omega @ INERTIA @ omega / 2 + stored @ omega + springs
        turned = Rotation.from_quat(np.asarray(quaternion), scalar_first=True)
        return turned.apply(momentum), energy

    last = found.final.plant
    before = of(OMEGA, (ModeStates(ANGLES, np.zeros(2)),), [1.0, 0, 0, 0])
    after = of(np.asarray(last.omega), last.effectors, last.attitude.q)
    np.testing.assert_allclose(after[0], before[0], rtol=1e-10)
    np.testing.assert_allclose(after[1], before[1], rtol=1e-10)


@pytest.mark.slow
def test_with_the_body_free_a_mode_is_faster_by_the_inertia_that_it_takes():
    """About one axis Ω_free = Ω / √(1 - d²/J), and the body swings against the panel."""
    inertia, size, frequency = 10.0, 2.5, 1.3
    free = frequency / np.sqrt(1 - size**2 / inertia)
    times = np.linspace(0.0, 20.0, 41)
    axis = np.array([[0.0], [0.0], [1.0]])
    found = flown(
        np.diag([8.0, 9.0, inertia]),
        size * axis,
        [frequency],
        [0.0],
        np.zeros(3),
        [0.05],
        times,
    )
    swing = 0.05 * np.cos(free * times)
    np.testing.assert_allclose(found.signals.parts["mode_angle"][:, 0], swing, atol=1e-10)
    back = size**2 / inertia * 0.05 * free * np.sin(free * times)
    np.testing.assert_allclose(found.signals.omega[:, 2], back, atol=1e-10)


@pytest.mark.parametrize(
    ("changes", "message"),
    [
        ({"coupling": 0.0}, "`coupling` must be"),
        ({"frequency": -1.0}, "`frequency` must be"),
        ({"axes": np.zeros((3, 2))}, "axes"),
    ],
)
def test_modes_that_cannot_be_are_refused(changes, message):
    arguments = {"axes": COUPLINGS, "coupling": SIZES, "frequency": FREQUENCY}
    with pytest.raises(ValueError, match=message):
        FlexibleModes(**arguments | changes)


def test_more_than_the_body_is_refused():
    with pytest.raises(ValueError, match="inertia less that of all rotors"):
        RigidBody(
            Spacecraft([1.0, 1.0, 1.0]),
            ExactOrbit(0.0),
            effectors=(FlexibleModes(COUPLINGS, SIZES, FREQUENCY),),
        )


def test_a_wheel_that_seizes_excites_the_modes():
    """Impulses between the bodies leave ∂T/∂ω, ∂T/∂η' and ∂T/∂Ω of the other wheel as they were.

    T = ωᵀJω/2 + Σ η' d·ω + Σ η'²/2 + Σ J_w Ω a·ω + Σ J_w Ω²/2, in which the first wheel seizes.
    """
    axes, rotors = np.array([[0.6, 0.0], [0.0, 1.0], [0.8, 0.0]]), np.array([0.8, 0.5])
    momenta, rates = np.array([4.0, -2.0]), np.array([0.01, -0.03])
    failures = WheelFailures([0], [5.0], [WheelFailureKind.STOPPED], [0.0])
    wheels = Wheels(axes, rotor_inertia=rotors, failures=failures)
    modes = FlexibleModes(COUPLINGS, SIZES, FREQUENCY, DAMPING)
    body = RigidBody(Spacecraft(INERTIA), ExactOrbit(0.0), effectors=(modes, wheels))
    own = (ModeStates(ANGLES, rates), WheelMomenta(momenta))
    start = PlantState(Quaternion([1.0, 0.0, 0.0, 0.0]), OMEGA, own)

    mass = np.eye(7)
    mass[:3, :3], mass[:3, 3:5], mass[:3, 5:] = INERTIA, COUPLINGS, axes * rotors
    mass[5:, 5:] = np.diag(rotors)
    mass = np.triu(mass) + np.triu(mass, 1).T
    before = np.array([*OMEGA, *(rates * SIZES), *(momenta / rotors)])
    kept = [0, 1, 2, 3, 4, 6]  # all but the wheel that seizes
    after = np.linalg.solve(mass[np.ix_(kept, kept)], (mass @ before)[kept])

    for _ in range(2):  # a second time nothing changes
        start = body.after_failures(start, (jnp.zeros(0, bool), jnp.array([True])))
        np.testing.assert_allclose(start.omega, after[:3], rtol=1e-13)
        left = start.find(ModeStates)
        np.testing.assert_allclose(left.rate * SIZES, after[3:5], rtol=1e-13)
        np.testing.assert_array_equal(left.angle, ANGLES)
        momentum = wheel_momentum(start)
        np.testing.assert_allclose(momentum, [0.0, after[5] * rotors[1]], rtol=1e-13)
