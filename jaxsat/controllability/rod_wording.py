"""Verdicts as text where magnetorquers decide."""

import numpy as np

from jaxsat.controllability.judgement import Judgement, OrbitRank
from jaxsat.core.text import number_text

ALIGNED = 0.01
"""Angle (degrees) to the orbit frame below which a body counts as at rest in it."""

LITTLE = 0.1
"""Part (%) of the limits of magnetorquers below which the text gives no number."""


def rod_torques(orbit: OrbitRank) -> str:
    """Return the torques of magnetorquers, and of wheels beside them, as text."""
    few = "one torque" if orbit.rods == 1 else "two torques"
    beside = f" and those about {orbit.wheels} axes of wheels" if orbit.wheels > 1 else ""
    beside = " and that of a wheel" if orbit.wheels == 1 else beside
    return f"{few} across the field{beside}"


def rod_sentence(judgement: Judgement, orbit: OrbitRank) -> str:
    """Return the verdict as text where magnetorquers decide."""
    makers = "Magnetorquers and wheels" if orbit.wheels else "Magnetorquers alone"
    if not orbit.rests:
        return (
            f"Not decided: {makers[0].lower()}{makers[1:]} make {rod_torques(orbit)} at an "
            "instant, but no attitude near the orbit frame is an equilibrium, about which jaxsat "
            "analyses the motion over an orbit, and the torque there is too large to hold it by "
            "magnetorquers."
        )
    low, high = (number_text(one, 2) for one in orbit.margin)
    rank = f"rank {orbit.rank} of {orbit.dimension}"
    if judgement.verdict == "uncontrollable":
        return (
            f"{makers} do not control all axes: {rank} over an orbit, however the field turns."
            f"{_rest_words(orbit)}"
        )
    torques = f"by {rod_torques(orbit)} at any instant"
    how = f"{torques}: {rank}, margin {low} to {high} as the Earth turns"
    if judgement.verdict == "borderline":
        return (
            f"Borderline: {makers[0].lower()}{makers[1:]} control all axes over an orbit, but at "
            f"times of a day hardly, {how}.{_rest_words(orbit)}"
        )
    text = f"{makers} control all axes over an orbit, as the field turns, {how}."
    text += _rest_words(orbit)
    return text if judgement.laws != "none" else f"{text} No law of jaxsat is made for them."


def _rest_words(orbit: OrbitRank) -> str:
    """Return a sentence on the angle to the orbit frame at which the body rests, if it shows, or on
    the torque that magnetorquers oppose in the orbit frame."""
    if orbit.opposing:
        percent = 100 * orbit.opposing
        part = f"less than {LITTLE}" if percent < LITTLE else f"up to {number_text(percent, 2)}"
        return (
            " No attitude near the orbit frame is an equilibrium; magnetorquers hold the body in "
            f"it with {part} % of their limits."
        )
    degrees = np.degrees(orbit.turn)
    if degrees < ALIGNED:
        return ""
    return (
        f" Without control torque the body rests {number_text(degrees, 3)}° from the orbit frame."
    )


def rods_lost(judgement: Judgement, orbit: OrbitRank) -> str:
    """Return the lost authority as text where magnetorquers decide."""
    if not orbit.rests:
        return "torque along the field; rest near the orbit frame"
    if judgement.verdict == "uncontrollable":
        return f"control over an orbit: rank {orbit.rank} of {orbit.dimension}"
    words = (
        "torque along the field" if not orbit.wheels else "direct torque about one axis at times"
    )
    if judgement.verdict == "borderline":
        return f"{words}; nearly all authority about one axis, at times of a day at least"
    words += ", reached as the field turns"
    return words if judgement.laws != "none" else f"{words}, by no law"
