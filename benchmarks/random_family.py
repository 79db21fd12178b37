"""A published family of random spacecraft that have two torques left.

Spacecraft i of a seed is drawn from fold_in(seed, i) alone. The dispersions are those of the
scenario `acceptance-hard`, scaled with the spacecraft: rates by 1/τ, torques by the torque limit,
times by τ (`docs/laws.md`), so that they are as large for every spacecraft as for the paper's.
In low orbit gravity gradient acts as well.
"""

import itertools
import math
from typing import Any, NamedTuple

import jax
import numpy as np
from jaxtyping import Float

from jaxsat.core import noise
from jaxsat.core.allocation import torque_directions, usable_share
from jaxsat.core.declaration.settling import TUNED_LIMITS, TUNED_MOMENTS
from jaxsat.core.inertia import normal_axes
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.load import load
from jaxsat.scenario.holding import nearest_held, rotation

SEED = 20261122
SIZE = 200
"""Spacecraft of the published family."""

LARGEST_MOMENT = (0.05, 5e4)
"""kg m²: of a 3U CubeSat of 4 kg, and of a telescope of 10 t, 4 m across and 7 m long."""

LEAST_SECOND_MOMENT = 0.1
"""Of the mass along a principal axis, beside the largest that may be drawn."""

PRODUCT = 0.2
"""Largest product of inertia in parts of the least moment."""

LEAST_COUPLING = 0.1

LEAST_ANGLE = math.radians(30)
"""Between the two torque axes, either way."""

TORQUE = (0.2, 5.0)
"""In parts of the torque that turns the mean moment by 90° within a minute, rest to rest."""

QUARTER_TURN = 4 * (math.pi / 2) / 60**2
"""The angular acceleration of that torque, rad/s²."""

ORBIT_RATE = (9.0e-4, 1.16e-3)
"""rad/s, of circular orbits from 1500 to 300 km; half of the spacecraft point inertially."""

PERIOD = (0.0054, 0.0240)
"""Control period in parts of τ."""

PERIODS = 16000
"""Of a case, 86 to 384 τ; `acceptance-hard` is given 108, 144 and 240 τ at 1, 5 and 20 N m."""

LONGEST_PERIOD = 1.0
"""s, the longest between two instants that a scenario may save."""

REFERENCE_LIMIT = TUNED_LIMITS[1]
"""N m: where the dispersions of `acceptance-hard` are taken from."""

RATE_KEYS = ("disturbance.frequency_rad_s", "sampling.rate_noise_rad_s")
TORQUE_KEYS = ("disturbance.amplitude_N_m",)


class FamilyMember(NamedTuple):
    """One spacecraft: what was drawn, and what the laws make of it.

    `inertia` (kg m²) and the rows of `torque_axes` are in body axes, which are to be brought to the
    orbit frame; where the attitude drawn could not be held they are those of the nearest that can
    be, `turn` (rad) away. `unit` is τ (s), `period` the control period (s), `limit` the torque
    limit (N m) and `orbit_rate` in rad/s, zero for inertial pointing. `moments` are S1, S2, n·Jn.
    """

    number: int
    inertia: Float[np.ndarray, "3 3"]
    torque_axes: Float[np.ndarray, "2 3"]
    limit: float
    orbit_rate: float
    period: float
    unit: float
    turn: float
    moments: tuple[float, float, float]
    lean: tuple[float, float]

    @property
    def coupling(self) -> float:
        """c of the normal form."""
        return (self.moments[0] - self.moments[1]) / self.moments[2]

    def numbers(self) -> dict[str, float]:
        """What it is without dimension, and its unit of time `tau_s`: a row of a table."""
        first, second, third = self.moments
        return {
            "c": self.coupling,
            "S1": first / third,
            "S2": second / third,
            "lean": float(np.hypot(*self.lean)),
            "orbit_rate_tau": self.orbit_rate * self.unit,
            "period_over_tau": self.period / self.unit,
            "tau_s": self.unit,
        }


def family_member(
    number: int, seed: int = SEED, coupling: tuple[float, float] = (LEAST_COUPLING, math.inf)
) -> FamilyMember:
    """Spacecraft `number` of the family with this seed, drawn in 64 bits whatever the default.

    Its c lies between the two of `coupling`.
    """
    with jax.enable_x64(True):
        key = noise.fold_in(noise.key_of_seed(seed), number)
        drawn = (_drawn(number, noise.fold_in(key, attempt)) for attempt in itertools.count())
        return next(one for one in drawn if one and coupling[0] <= one.coupling <= coupling[1])


def _drawn(number: int, key: noise.Key) -> FamilyMember | None:
    """The spacecraft of a key; None if it lies outside the family."""
    u = np.asarray(noise.uniform(key, 17), float)
    second = LEAST_SECOND_MOMENT + (1 - LEAST_SECOND_MOMENT) * u[:3]
    moments = second.sum() - second  # of a body of positive mass: the triangle inequality
    moments *= _between(u[3], LARGEST_MOMENT) / moments.max()
    xy, xz, yz = PRODUCT * (2 * u[4:7] - 1) * moments.min()
    inertia = np.diag(moments) + np.array([[0, xy, xz], [xy, 0, yz], [xz, yz, 0]])
    axes = np.column_stack([_direction(u[7:9]), _direction(u[9:11])])
    away = math.acos(abs(float(np.clip(axes[:, 0] @ axes[:, 1], -1, 1))))
    low, middle, high = np.linalg.eigvalsh(inertia)
    if away < LEAST_ANGLE or low + middle < high:
        return None
    low_orbit = bool(u[11] < 0.5)
    orbit_rate = float(ORBIT_RATE[0] + u[12] * (ORBIT_RATE[1] - ORBIT_RATE[0])) * low_orbit
    into_body = _held_attitude(inertia, axes) if low_orbit else np.eye(3)
    if into_body is None:
        return None
    inertia, axes = into_body.T @ inertia @ into_body, into_body.T @ axes
    frame, reduced = normal_axes(inertia, torque_directions(axes))
    limit = _between(u[13], TORQUE) * QUARTER_TURN * float(np.trace(inertia)) / 3
    unit = math.sqrt(math.sqrt(reduced[0] * reduced[1]) / (limit * usable_share(axes, frame[:2])))
    across = frame @ inertia @ frame[2]
    return FamilyMember(
        number,
        (inertia + inertia.T) / 2,
        axes.T,
        limit,
        orbit_rate,
        min(_between(u[14], PERIOD) * unit, LONGEST_PERIOD),
        unit,
        math.acos(min(1.0, (float(np.trace(into_body)) - 1) / 2)),
        reduced,
        (-float(across[0] / across[2]), -float(across[1] / across[2])),
    )


def _between(u: float, ends: tuple[float, float]) -> float:
    """Even in logarithms."""
    return float(ends[0] * (ends[1] / ends[0]) ** u)


def _direction(u: Float[np.ndarray, "2"]) -> Float[np.ndarray, "3"]:
    """Uniform on the sphere."""
    z, angle = 2 * u[0] - 1, 2 * math.pi * u[1]
    across = math.sqrt(1 - z * z)
    return np.array([across * math.cos(angle), across * math.sin(angle), z])


def _held_attitude(
    inertia: Float[np.ndarray, "3 3"], axes: Float[np.ndarray, "3 2"]
) -> Float[np.ndarray, "3 3"] | None:
    """From the nearest attitude that can be held under gravity gradient to the axes drawn.

    It is searched for from the attitude drawn, then from that with n along the orbit's normal.
    """
    directions = torque_directions(axes)
    normal = np.cross(directions[:, 0], directions[:, 1])
    orbit_normal = np.array([0.0, math.copysign(1.0, normal[1]), 0.0])
    axis = np.cross(orbit_normal, normal)
    size = float(np.sqrt(axis @ axis))
    along = rotation(axis / size * math.atan2(size, float(orbit_normal @ normal)))
    for begin in (np.eye(3), along):
        turn = nearest_held(begin.T @ inertia @ begin, begin.T @ normal, gravity_gradient=True)
        if turn is not None:
            return begin @ rotation(turn)
    return None


def family_scenario(member: FamilyMember, law: str) -> Scenario:
    """The scenario of one spacecraft under a law with the gains of its preset."""
    moment = math.sqrt(TUNED_MOMENTS[0] * TUNED_MOMENTS[1])
    slower = math.sqrt(moment / REFERENCE_LIMIT) / member.unit
    weaker = math.sqrt(member.moments[0] * member.moments[1]) / moment * slower**2
    base = load("acceptance-hard", purpose="text")
    data = base.model_dump(exclude_none=True)
    _scale(data, RATE_KEYS, slower)
    _scale(data, TORQUE_KEYS, weaker)
    rates = data["dispersion"]["omega_rad_s"]
    rates |= {"low": rates["low"] * slower, "high": rates["high"] * slower}
    data["title"] = f"Family, spacecraft {member.number}, {law}"
    data["description"] = "One of the family of random spacecraft with two torques left."
    data["spacecraft"] = {
        "inertia_kg_m2": member.inertia.tolist(),
        "thruster_torque_axes": member.torque_axes.tolist(),
        "torque_limit_N_m": member.limit,
        "third_rate": "free",
    }
    data["orbit"]["rate_rad_s"] = member.orbit_rate
    data["disturbance"]["gravity_gradient"] = member.orbit_rate > 0
    data["initial"]["omega_rad_s"] = [rate * slower for rate in data["initial"]["omega_rad_s"]]
    data["control"] = {"law": law, "period_s": member.period}
    data["simulation"]["duration_s"] = PERIODS * member.period
    data["simulation"]["save_every_s"] = member.period
    return Scenario.model_validate(data)


def _scale(data: dict[str, Any], keys: tuple[str, ...], factor: float) -> None:
    for key in keys:
        table, name = key.split(".")
        value = data[table][name]
        data[table][name] = (
            value * factor if isinstance(value, float) else [one * factor for one in value]
        )
