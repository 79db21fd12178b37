"""Authority of magnetorquers about rest near the orbit frame, analysed over an orbit.

A dipole m makes the torque m × B, so at one instant no magnetorquer turns the body about the
Earth's field B. As B turns along the orbit the missing direction turns with it, and the linear
system with the inputs a × B(t) can be controllable over an orbit where it is not at any instant
(Bhat, IEEE Trans. Automatic Control 50, 2005, pages 1725-1735). The Gramian decides, as brackets at
one instant do not include the field's future.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jaxsat.control.linear_motion import LinearMotion
from jaxsat.control.periodic_gain import floquet_multipliers, periodic_gain
from jaxsat.controllability.layout import TOLERANCE
from jaxsat.controllability.linear import orbital_motion
from jaxsat.spacecraft.environment.orbit import EARTH_ROTATION, AbstractMagneticField

DAY = 2 * np.pi / EARTH_ROTATION  # s
STEPS = 128  # per orbit
HARDLY = 0.99  # largest fraction of an error left after an orbit
DEGREE = np.pi / 180


@dataclass(frozen=True, eq=False)
class MagneticAuthority:
    """Authority of magnetorquers at rest near the orbit frame, without thrusters and wheels.

    - `field`: smallest and largest size of B within a day, T.
    - `torque`: the mean over a day of the largest torque about body x, y, z, N m.
    - `largest`: the largest torque about one of them at any instant, N m.
    - `effort`: to remove one degree about body x, y, z within one orbit, the root mean square of
      the dipoles over their limits; infinite where it cannot be removed.
    """

    field: tuple[float, float]
    torque: Float[np.ndarray, "3"]
    largest: float
    effort: Float[np.ndarray, "3"]


def magnetic_authority(
    inertia: Float[np.ndarray, "3 3"],
    axes: Float[np.ndarray, "3 k"],
    limits: Float[np.ndarray, " k"],
    field: AbstractMagneticField,
    to_body: Float[np.ndarray, "3 3"],
) -> MagneticAuthority:
    """Analyse magnetorquers along `axes` with dipole `limits` (A m²) in a `field`.

    Axes and `inertia` (kg m²) are in body axes, and the body rests at the attitude `to_body`. A
    singular value of the linear system below `TOLERANCE` times the largest is zero.
    """
    rate = float(field.circle.rate)
    orbit = 2 * np.pi / rate
    at_rest = to_body.T @ inertia @ to_body  # in axes along those of the orbit frame
    state = orbital_motion(at_rest, rate)
    to_rates = np.concatenate([np.zeros((3, 3)), np.linalg.inv(at_rest)])
    count = max(round(DAY / orbit * STEPS), STEPS)
    instants = (np.arange(count) + 0.5) * orbit / STEPS
    there = field.sampled(instants, EARTH_ROTATION * instants)
    units = to_body.T @ axes / np.linalg.norm(axes, axis=0)
    torques = np.cross((units * limits).T[None], there[:, None])  # instants, magnetorquers, orbit
    about = np.abs(torques @ to_body.T).sum(axis=1)
    factor = _factor(state, to_rates, torques[:STEPS], rate)
    sizes = np.linalg.norm(there, axis=1)
    return MagneticAuthority(
        field=(float(sizes.min()), float(sizes.max())),
        torque=about.mean(axis=0),
        largest=float(about.max()),
        effort=_effort(factor, to_body),
    )


def _factor(
    state: Float[np.ndarray, "6 6"],
    to_rates: Float[np.ndarray, "6 3"],
    torques: Float[np.ndarray, "instants k 3"],
    rate: float,
) -> Float[np.ndarray, "6 n"]:
    """Return e^{-At} B(t) √(step) at each instant side by side, a factor of the Gramian.

    Time is in units of 1/ω0, angles are in rad, and the mean square of each input over its limit
    in an orbit is the sum of its squares over one orbit of unit length.
    """
    from scipy.linalg import expm  # slow

    units = np.array([1.0] * 3 + [1 / rate] * 3)
    scaled_state = units[:, None] * state / units / rate
    length = 2 * np.pi / STEPS
    back, half = expm(-scaled_state * length), expm(-scaled_state * length / 2)
    inputs = units[:, None] * to_rates / rate * np.sqrt(2 * np.pi * length)
    blocks, power = [], half
    for one in torques:
        blocks.append(power @ inputs @ one.T)
        power = power @ back
    return np.concatenate(blocks, axis=1)


def _effort(
    factor: Float[np.ndarray, "6 n"], to_body: Float[np.ndarray, "3 3"]
) -> Float[np.ndarray, "3"]:
    """Return the least root mean square of the inputs to remove one degree about each body axis."""
    directions, values, _ = np.linalg.svd(factor, full_matrices=False)
    solid = values > TOLERANCE * values.max()
    efforts = np.full(3, np.inf)
    for axis in range(3):
        parts = DEGREE * to_body[axis] @ directions[:3]
        if np.linalg.norm(parts[~solid]) <= 1e-9 * DEGREE:
            efforts[axis] = np.linalg.norm(parts[solid] / values[solid])
    return efforts


def magnetic_words(authority: MagneticAuthority, thruster: float, wheels: bool) -> list[str]:
    """Return sentences on magnetorquers beside wheels and thrusters.

    A thruster makes up to `thruster` N m, zero if unknown.
    """
    low, high = (f"{size * 1e6:.3g}" for size in authority.field)
    beside = f", {authority.largest / thruster:.2g} of a thruster's" if thruster else ""
    torques, efforts = (
        ", ".join(f"{one:.2g}" for one in row) for row in (authority.torque, 100 * authority.effort)
    )
    unload = "; they unload wheel momentum perpendicular to the field" if wheels else ""
    return [
        f"Magnetorquers: at rest near the orbit frame at most {authority.largest:.2g} N m{beside}, "
        f"and on average {torques} N m about body x, y, z, in a field of {low} to {high} µT; none "
        f"about the field itself{unload}",
        f"Magnetorquers alone remove one degree about x, y, z within an orbit by {efforts} % of "
        "their limits (rms), in the linear system about that rest without gravity gradient",
    ]


def magnetic_law_words(motion: LinearMotion, weight: float, wheel_weight: float = 1.0) -> str:
    """Return a sentence on small errors under the law `magnetic` with gains of these weights."""
    gain = periodic_gain(motion, weight, wheel_weight)
    if gain is None:
        return "The law magnetic has no gains that hold all axes: no Riccati solution is periodic"
    sizes = np.abs(floquet_multipliers(motion, gain)[:, 0])
    least, most = (f"{100 * one:.3g}" for one in (sizes.min(), sizes.max()))
    sentence = f"Under the law magnetic small errors fall to {least} to {most} % in an orbit"
    if sizes.max() < HARDLY:
        return f"{sentence}, as the Earth turns (Floquet multipliers)"
    return (
        f"{sentence} (Floquet multipliers): while the field hardly turns in the orbit, a part of "
        "each day, they hardly fall"
    )
