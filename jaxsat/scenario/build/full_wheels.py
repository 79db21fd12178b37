"""Whether torques of the environment fill the wheels during a run: a caution before it."""

import math

import numpy as np

from jaxsat.core.attitude import DCM
from jaxsat.core.earth import EARTH_GRAVITY
from jaxsat.core.text import number_text
from jaxsat.scenario.actuator_cautions import fills_wheels, into_frame
from jaxsat.scenario.build.plant import build_plant, orbit_rate
from jaxsat.scenario.schema import Scenario
from jaxsat.spacecraft.environment.disturbances import (
    AbstractDisturbance,
    ConstantTorque,
    PeriodicTorque,
    terms_of,
)

PHASES, MOST_INSTANTS, MOST_JUDGED = 96, 100_000, 2000
"""Instants of a period of the fastest torque; most instants of a run, beyond which there is
no caution; and most of them at which the wheels are judged."""


def full_wheels_words(scenario: Scenario) -> str | None:
    """Caution if torques from outside fill the wheels before the end of a run, else None.

    The body is assumed at the target. No caution where the momentum at the start or a constant
    torque alone fills the wheels, nor where thrusters or magnetorquers take momentum out.
    """
    limited = any(one.momentum_limit_N_m_s is not None for one in scenario.wheel)
    if not limited or scenario.thruster or scenario.magnetorquer:
        return None
    plant = build_plant(scenario)
    terms = terms_of(plant.disturbance)
    if all(isinstance(term, ConstantTorque | PeriodicTorque) for term in terms):
        return None
    from jaxsat.compiler.llvm.mapped import compiled_over_cases  # slow

    rate, duration = orbit_rate(scenario), scenario.simulation.duration_s
    fastest = max(rate, _perigee_rate(scenario), *map(_frequency, terms))
    count = PHASES * max(math.ceil(fastest * duration / (2 * math.pi)), 1)
    if count > MOST_INSTANTS:
        return None
    times = np.linspace(0.0, duration, 1 + count)
    inertia = np.asarray(plant.spacecraft.inertia)

    def torque(t, inertia):
        return plant.disturbance(t, DCM(np.eye(3)), inertia)

    torques = np.asarray(compiled_over_cases(torque, times[0], inertia)(times, inertia))
    frames = into_frame(rate * times)
    inertial = np.einsum("nij,ni->nj", frames, torques)
    steps = np.diff(times)[:, None] * (inertial[1:] + inertial[:-1]) / 2
    given = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    few = np.unique(np.linspace(0, count, min(count, MOST_JUDGED) + 1).astype(int))
    given = np.einsum("nij,nj->ni", frames[few], given[few])
    full = fills_wheels(scenario, times[few], given)
    if full is None:
        return None
    return (
        "key wheel: should hold the momentum that torques from outside give a body at the target: "
        f"at most {number_text(full[1], 3)} times what they hold; they are full after "
        f"{number_text(full[0], 4)} s"
    )


def _perigee_rate(scenario: Scenario) -> float:
    """Rate (rad/s) of the position at perigee; 0 for a circular orbit."""
    ellipse = scenario.orbit.ellipse()
    if ellipse is None:
        return 0.0
    axis, eccentricity = ellipse
    return math.sqrt(EARTH_GRAVITY / axis**3 * (1 + eccentricity) / (1 - eccentricity) ** 3)


def _frequency(term: AbstractDisturbance) -> float:
    """Largest frequency (rad/s) of a periodic torque; 0 for others."""
    if not isinstance(term, PeriodicTorque):
        return 0.0
    acts = np.asarray(term.amplitude) != 0
    return float(np.max(np.abs(np.asarray(term.frequency)), where=acts, initial=0.0))
