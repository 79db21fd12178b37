"""Balance of the environmental torque about an undriven axis, and the motion about it.

With two wheels the body is held about the axes across the normal n of their plane, and turns about
n alone: n·Jn times its acceleration is the torque about n, whatever the wheels do.
"""

import math
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxsat.control.two_wheels import nearest_held
from jaxsat.controllability.cone import ROUNDING
from jaxsat.controllability.judgement import Judgement
from jaxsat.core.allocation import unit_columns
from jaxsat.core.array_types import Matrix, RealScalar
from jaxsat.core.attitude import DCM
from jaxsat.core.checks import as_float
from jaxsat.core.earth import EARTH_GRAVITY
from jaxsat.core.text import number_text
from jaxsat.scenario.build.actuator_set import all_actuators
from jaxsat.scenario.build.plant import build_plant, place_of
from jaxsat.scenario.build.run import build_start
from jaxsat.scenario.holding import missing_torque, nearest_balance, rotation
from jaxsat.scenario.parts.torque_makers import TorqueMakers
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.wheel_loads import fills_wheels, into_frame, thrusters_take_momentum
from jaxsat.spacecraft.dynamics import RigidBody
from jaxsat.spacecraft.environment.disturbances import (
    AbstractDisturbance,
    ConstantTorque,
    PeriodicTorque,
    terms_of,
)
from jaxsat.spacecraft.environment.ellipse import EllipticOrbit

PLACES = 24
"""Number of orbit positions over which torques are averaged."""

SLIGHT = 1e-3
"""Rotation (rad) over which the slope of a torque is taken."""

NOTHING = 1e-12
"""Torque that is treated as zero, relative to the largest torque in any attitude."""

BATCH = 512
"""Number of attitudes whose torques are computed together."""


class Balance(NamedTuple):
    """A body about the unit vector `normal` (body axes), which none of its `drivers` drives.

    `torque` (N m) is the orbit-mean environmental torque about the normal in the target attitude;
    `turn` the rotation vector (rad) from there to the nearest attitude in which it vanishes, None
    without one. There `stiffness` (N m/rad) drives a turn about the normal back, or away if it is
    negative, and `moment` (kg m²) is n·Jn.
    """

    normal: tuple[float, float, float]
    torque: float
    turn: tuple[float, float, float] | None
    stiffness: float
    moment: float
    drivers: str = "actuator"

    @property
    def rate(self) -> float:
        """√(|stiffness| / moment), rad/s: frequency of the swing, or rate of e-fold growth."""
        return float(np.sqrt(abs(self.stiffness) / self.moment))

    def lines(self) -> list[str]:
        """Return an explanation of the balance, one sentence per line."""
        axis = ", ".join(number_text(part, 3, scale=1.0) for part in self.normal)
        words = (
            f"No {self.drivers} makes a torque about ({axis}). The environment makes "
            f"{number_text(self.torque, 3)} N m about it in the target attitude."
        )
        if self.turn is None:
            return [words, "In no attitude does that torque vanish."]
        turn = ", ".join(number_text(part, 3, scale=1.0) for part in self.turn)
        away = number_text(np.degrees(np.linalg.norm(self.turn)), 3)
        place = f"It vanishes {away}° away, at the rotation vector ({turn}) rad, body axes"
        if self.rate == 0:
            return [words, f"{place}, and nearby."]
        if self.stiffness > 0:
            period = number_text(2 * np.pi / self.rate, 3)
            return [words, f"{place}: a stable balance, about which the body swings in {period} s."]
        time = number_text(1 / self.rate, 3)
        return [
            words,
            f"{place}: an unstable balance, from which errors about the axis grow e-fold in "
            f"{time} s.",
        ]


def held_with_momentum(scenario: Scenario, judgement: Judgement) -> str | None:
    """Sentence on the attitude nearest to the target at which two wheels rest with the initial
    momentum; None in a rotating frame, or if other effects decide."""
    turn = turn_to_held(scenario, judgement)
    if turn is None:
        return None
    words = ", ".join(number_text(part, 3, scale=1.0) for part in turn)
    away = number_text(np.degrees(np.linalg.norm(turn)), 3)
    return (
        f"With the momentum of the start, two wheels rest nearest to the target {away}° from it, "
        f"at the rotation vector ({words}) rad, body axes."
    )


def turn_to_held(scenario: Scenario, judgement: Judgement) -> Float[np.ndarray, "3"] | None:
    """Rotation vector (rad, body axes) from the target to the nearest attitude that two wheels hold
    with the initial momentum; None if other effects decide."""
    wheels, actuators = judgement.level_set, judgement.actuators
    if judgement.laws != "nearest attitude" or wheels is None:
        return None
    into_body = np.asarray(build_start(scenario).attitude.as_dcm().matrix)
    momentum, normal = into_body.T @ actuators.momentum, wheels.missing[:, 0]
    nearest = nearest_held(
        as_float(momentum), as_float(actuators.coasting), as_float(normal), as_float(0.0)
    )
    return 2 * np.asarray(nearest.attitude.q)[1:] / np.sinc(float(nearest.angle) / (2 * np.pi))


def undriven_balance(scenario: Scenario) -> Balance | None:
    """Environmental balance about the axis that no working wheel or, without wheels, no actuator
    drives, at rest in inertial axes; None without such an axis, or without a torque.

    In a rotating frame, wheels absorb such a torque and return it.
    """
    if scenario.orbit.rate() != 0:
        return None
    axes = wheels = TorqueMakers.of(scenario).axes
    if not wheels.size:
        actuators, working = all_actuators(scenario)
        axes = unit_columns(actuators.only(working).torques)
    if axes.shape[1] < 2:
        return None
    directions, sizes, _ = np.linalg.svd(axes)
    if np.sum(sizes > ROUNDING * sizes[0]) != 2:
        return None
    normal = np.where(np.abs(directions[:, 2]) < NOTHING, 0.0, directions[:, 2])
    normal = normal * np.sign(normal[np.argmax(np.abs(normal))])
    balance = balance_about(scenario, normal)
    drivers = "wheel" if wheels.size else "actuator"
    return None if balance is None else balance._replace(drivers=drivers)


def balance_about(scenario: Scenario, normal: Float[np.ndarray, "3"]) -> Balance | None:
    """Environmental balance about an axis (body, unit); None if the environment makes no torque.

    Periodic torques, as (2), have no mean.
    """
    from scipy.spatial.transform import Rotation  # slow to import, and seldom needed

    plant = build_plant(scenario)
    inertia, square = np.asarray(plant.spacecraft.inertia), scenario.orbit.rate() ** 2
    torque = _torque_about(plant, normal, _times(scenario))

    def missing(turn: Float[np.ndarray, "*n 3"]) -> Float[np.ndarray, "*n"]:
        gyroscopic = square * missing_torque(inertia, normal, turn, False)
        return np.asarray(gyroscopic - torque(rotation(turn)))

    scale = float(np.abs(missing(np.random.default_rng(0).normal(size=(BATCH, 3)))).max())
    if scale == 0:
        return None
    turn, moment = nearest_balance(missing, scale), float(normal @ inertia @ normal)
    stiffness = 0.0
    if turn is not None:
        turn = np.where(np.abs(turn) < NOTHING, 0.0, turn)
        balanced = Rotation.from_rotvec(turn)
        about = (balanced * Rotation.from_rotvec(sign * SLIGHT * normal) for sign in (1, -1))
        ahead, behind = (float(missing(one.as_rotvec())) for one in about)
        slope = (ahead - behind) / (2 * SLIGHT)
        stiffness = slope if abs(slope) > SLIGHT * NOTHING * scale else 0.0
    hold_torque = -float(missing(np.zeros(3)))
    return Balance(
        _plain(normal), hold_torque, None if turn is None else _plain(turn), stiffness, moment
    )


def _torque_about(
    plant: RigidBody, normal: Float[np.ndarray, "3"], times: Float[np.ndarray, " k"]
) -> Callable[[Float[np.ndarray, "*n 3 3"]], Float[np.ndarray, "*n"]]:
    """Return the mean torque (N m) about an axis over times (s), of matrices into body axes."""
    lasting = (one for one in terms_of(plant.disturbance) if not isinstance(one, PeriodicTorque))
    terms, inertia = tuple(lasting), plant.spacecraft.inertia

    @jax.jit
    @jax.vmap
    def torque(matrix: Matrix) -> RealScalar:
        def at(t: RealScalar) -> RealScalar:
            each = [one(t, DCM(matrix), inertia) for one in terms]
            return sum(each, jnp.zeros(3)) @ normal

        return jnp.mean(jax.vmap(at)(jnp.asarray(times)))

    def given(matrices: Float[np.ndarray, "*n 3 3"]) -> Float[np.ndarray, "*n"]:
        flat = matrices.reshape(-1, 3, 3)
        count = -(-len(flat) // BATCH) * BATCH
        padded = np.resize(flat, (count, 3, 3))
        batches = [np.asarray(torque(padded[at : at + BATCH])) for at in range(0, count, BATCH)]
        return np.concatenate(batches)[: len(flat)].reshape(matrices.shape[:-2])

    return given


def _times(scenario: Scenario) -> Float[np.ndarray, " k"]:
    place, rate = place_of(scenario.orbit), scenario.orbit.rate()
    if isinstance(place, EllipticOrbit):
        rate = float(np.sqrt(EARTH_GRAVITY / place.semi_major_axis**3))
    return np.arange(PLACES) * (2 * np.pi / rate / PLACES) if rate else np.zeros(1)


def _plain(vector: Float[np.ndarray, "3"]) -> tuple[float, float, float]:
    x, y, z = vector.tolist()
    return x, y, z


PHASES, MOST_INSTANTS, MOST_JUDGED = 96, 100_000, 2000
"""Instants of a period of the fastest torque; most instants of a run, beyond which there is
no caution; and most of them at which the wheels are judged."""


def full_wheels_words(scenario: Scenario) -> str | None:
    """Caution if torques from outside fill the wheels before the end of a run, else None.

    The body is assumed at the target. No caution where the momentum at the start or a constant
    torque alone fills the wheels, nor where magnetorquers, or thrusters that push all ways, take
    momentum out.
    """
    limited = any(one.momentum_limit_N_m_s is not None for one in scenario.wheel)
    if not limited or scenario.magnetorquer or thrusters_take_momentum(scenario):
        return None
    plant = build_plant(scenario)
    terms = terms_of(plant.disturbance)
    if all(isinstance(term, ConstantTorque | PeriodicTorque) for term in terms):
        return None
    from jaxsat.compiler.llvm.mapped import compiled_over_cases  # slow

    rate, duration = scenario.orbit.rate(), scenario.simulation.duration_s
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
    momenta = np.concatenate([np.zeros((1, 3)), np.cumsum(steps, axis=0)])
    few = np.unique(np.linspace(0, count, min(count, MOST_JUDGED) + 1).astype(int))
    momenta = np.einsum("nij,nj->ni", frames[few], momenta[few])
    full = fills_wheels(scenario, times[few], momenta)
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
