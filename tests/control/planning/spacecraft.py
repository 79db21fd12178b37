"""Bodies with two torques, and flights of their plans by SciPy."""

import jax.numpy as jnp
import numpy as np

from jaxsat.control.planning.planner import Planner
from jaxsat.core.attitude import Quaternion
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.environment.orbit import ExactOrbit
from jaxsat.spacecraft.spacecraft import Spacecraft
from jaxsat.synthesis.optima.manoeuvre import Manoeuvre
from jaxsat.synthesis.optima.search import propagate
from jaxsat.synthesis.optima.transcription import Solution

PAPER = np.diag([449.5, 264.6, 312.5])
XY = np.eye(3)[:, :2]
ZERO = np.zeros(3)


def planner(inertia=PAPER, axes=XY, limit=5.0, orbit_rate=0.0, **keys) -> Planner:
    body = RigidBody(Spacecraft(jnp.asarray(inertia)), ExactOrbit(orbit_rate))
    return Planner(body, jnp.asarray(axes), limit, **keys)


def state(quaternion, omega) -> PlantState:
    quaternion = np.asarray(quaternion, float)
    return PlantState(
        Quaternion(jnp.asarray(quaternion / np.linalg.norm(quaternion))), jnp.asarray(omega)
    )


def turned_about_x(angle, rate) -> PlantState:
    return state([np.cos(angle / 2), np.sin(angle / 2), 0, 0], [rate, 0.0, 0.0])


def flown(made: Planner, start: PlantState, plan):
    """The end of a plan's flight by DOP853 with direction cosines."""
    manoeuvre = Manoeuvre(
        np.asarray(made.model.spacecraft.inertia),
        np.asarray(made.torque_axes),
        float(made.limit),
        float(made.model.orbit.rate),
        np.asarray(start.attitude.as_quaternion().q),
        np.asarray(start.omega),
        ZERO,
        ZERO,
        ZERO,
        ZERO,
    )
    duration = float(plan.duration)
    states = np.concatenate([plan.quaternion, plan.omega], axis=1)
    return propagate(manoeuvre, Solution(duration, duration, np.asarray(plan.torque), states))


def random_body(random: np.random.Generator):
    """Any inertia that a body can have, two torques 30 to 150 degrees apart, a limit, a start."""
    turn, _ = np.linalg.qr(random.normal(size=(3, 3)))
    parts = random.uniform(0.3, 1.0, 3)
    moments = (parts.sum() - parts) * 10 ** random.uniform(-1, 3)
    inertia = turn @ np.diag(moments) @ turn.T
    first, across = np.linalg.qr(random.normal(size=(3, 2)))[0].T
    angle = np.radians(random.uniform(30, 150))
    axes = np.stack([first, np.cos(angle) * first + np.sin(angle) * across], axis=1)
    limit = moments.mean() * 10 ** random.uniform(-3, -1)
    rate = np.sqrt(limit / moments.mean())
    start = state(random.normal(size=4), random.uniform(-0.8, 0.8, 3) * rate)
    return (inertia + inertia.T) / 2, axes, limit, start
