"""Oscillations of passive parts with the body free: frequencies, and cautions on excitation."""

import math
from collections.abc import Iterator
from typing import NamedTuple

import numpy as np

from jaxsat.core.declaration.flexible_modes import FLEXIBLE_MODE
from jaxsat.scenario.errors import Issue, Location
from jaxsat.scenario.parts.named import names_of
from jaxsat.scenario.quantities import inertia_matrix
from jaxsat.scenario.schema import Scenario

SEPARATION = 5.0
"""Smallest recommended ratio of the lowest oscillation frequency to a law's natural frequency."""

NEAR_HARMONIC = 0.05
"""Relative distance from a multiple of the sampling rate within which pulses excite a mode."""

MOST_HARMONICS = 10
"""Number of harmonics of the sampling rate that pulses are assumed to excite."""


class StructuralMode(NamedTuple):
    """An oscillation: the part `of` it, its `frequency` with the body free (rad/s), and its key.

    `clamped_frequency` (rad/s) is the frequency with the body held.
    """

    of: str
    frequency: float
    clamped_frequency: float
    location: Location


def oscillations(scenario: Scenario) -> list[StructuralMode]:
    """Return the undamped oscillations of all parts with the body free, the slowest first.

    With d² η/dt² + Ω² η = -Dᵀ dω/dt and J dω/dt = -D d²η/dt² they are the eigenvalues of Ω (1 - Dᵀ
    J⁻¹ D)⁻¹ Ω. Each is named by the part with most of its motion.
    """
    modes = scenario.flexible_mode
    if not modes:
        return []
    inertia = inertia_matrix(scenario.spacecraft.inertia_kg_m2)
    couplings = np.array([one.coupling_sqrt_kg_m for one in modes], float).T
    frequencies = np.array([one.frequency_rad_s for one in modes])
    mobility = np.linalg.inv(
        np.eye(frequencies.size) - couplings.T @ np.linalg.solve(inertia, couplings)
    )
    squares, shapes = np.linalg.eigh(frequencies[:, None] * mobility * frequencies)
    names, places = names_of(modes), np.argmax(np.abs(shapes), axis=0)
    return [
        StructuralMode(
            f"{FLEXIBLE_MODE.called} {names[place]}",
            float(math.sqrt(max(square, 0.0))),
            float(frequencies[place]),
            (FLEXIBLE_MODE.name, int(place), "frequency_rad_s"),
        )
        for square, place in zip(squares, places, strict=True)
    ]


def flexibility_cautions(scenario: Scenario) -> Iterator[Issue]:
    """Yield cautions about oscillations that the law's bandwidth or its pulses excite."""
    modes = oscillations(scenario)
    bandwidth = getattr(scenario.control, "natural_frequency_rad_s", None)
    if modes and bandwidth is not None and modes[0].frequency < SEPARATION * bandwidth:
        yield Issue(
            ("control", "natural_frequency_rad_s"),
            f"should be at most 1/{SEPARATION:g} of {_told(modes[0])}, got {bandwidth:.4g}: the "
            f"oscillation is {modes[0].frequency / bandwidth:.3g} times as fast as the law, which "
            "does not know of it",
            (modes[0].location,),
        )
    period = getattr(scenario.control, "period_s", None)
    if not scenario.thruster or period is None:
        return
    for one in modes:
        turns = one.frequency * period / (2 * math.pi)
        harmonic = round(turns)
        if 1 <= harmonic <= MOST_HARMONICS and abs(turns / harmonic - 1) < NEAR_HARMONIC:
            yield Issue(
                ("control", "period_s"),
                f"should be away from a whole number of cycles of {_told(one)}, as pulses "
                f"would excite it each time: a period has {turns:.3g} cycles, got {period:.4g} s",
                (one.location,),
            )


def _told(one: StructuralMode) -> str:
    return (
        f"the frequency of {one.of}, {one.frequency:.4g} rad/s with the body free "
        f"({one.clamped_frequency:.4g} rad/s with it held)"
    )
