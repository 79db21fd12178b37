"""Verified domain of a law in dimensionless numbers, and results of sweeps beyond it."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import NamedTuple

from jaxsat.core.package_files import data_of

ENOUGH = 0.98
"""Fraction of the cases of a sweep that must settle for its value to count as verified."""


class DimensionlessNumber(NamedTuple):
    """Meaning of a dimensionless number, and the key of a scenario that mainly determines it."""

    meaning: str
    key: str


NUMBERS: Mapping[str, DimensionlessNumber] = MappingProxyType(
    {
        "coupling": DimensionlessNumber("c = (S1 - S2) / Jn", "spacecraft.inertia_kg_m2"),
        "moment_ratio": DimensionlessNumber("√(S1 S2) / Jn", "spacecraft.inertia_kg_m2"),
        "lean": DimensionlessNumber(
            "|ε| (products of inertia with n over Jn)", "spacecraft.inertia_kg_m2"
        ),
        "axes_angle": DimensionlessNumber(
            "the angle between the two torques (rad)", "spacecraft.thruster_torque_axes"
        ),
        "orbit_rate": DimensionlessNumber("the orbit rate times τ", "orbit.rate_rad_s"),
        "period": DimensionlessNumber("the control period over τ", "control.period_s"),
        "rate_noise": DimensionlessNumber("the rate noise times τ", "sampling.rate_noise_rad_s"),
        "attitude_noise": DimensionlessNumber(
            "the attitude noise (rad)", "sampling.attitude_noise_rad"
        ),
        "disturbance": DimensionlessNumber(
            "the periodic disturbance over torque limit", "disturbance.amplitude_N_m"
        ),
        "disturbance_rate": DimensionlessNumber(
            "the rate that the periodic disturbance makes over that which counts as settled",
            "disturbance.amplitude_N_m",
        ),
        "constant_disturbance": DimensionlessNumber(
            "the constant disturbance about n over torque limit", "disturbance.constant_N_m"
        ),
    }
)
"""Dimensionless numbers by name; S1, S2, Jn, ε and τ are those of docs/laws.md."""


@dataclass(frozen=True)
class Sweep:
    """Fraction of settled cases over values of one number, with all others those of a reference.

    `number` is one of `NUMBERS`, `reference` its value there, and `settled` has pairs of value and
    fraction, sorted by value.
    """

    number: str
    reference: float
    settled: tuple[tuple[float, float], ...]

    def __post_init__(self):
        values = [value for value, _ in self.settled]
        if self.number not in NUMBERS or values != sorted(values):
            raise ValueError(f"Argument `settled` must be sorted, but got {self.number}, {values}.")

    @property
    def verified(self) -> tuple[float, float]:
        """Range about the reference in which at least `ENOUGH` settled at every value."""
        low = high = self.reference
        for value, fraction in self.settled:
            if value >= self.reference:
                if fraction < ENOUGH:
                    break
                high = value
        for value, fraction in reversed(self.settled):
            if value <= self.reference:
                if fraction < ENOUGH:
                    break
                low = value
        return low, high

    def beyond(self, value: float) -> tuple[float, float] | None:
        """Return the nearest value measured outside the range on this side, and its fraction."""
        low, high = self.verified
        outside = [one for one in self.settled if (one[0] < low if value < low else one[0] > high)]
        return min(outside, key=lambda one: abs(one[0] - value), default=None)


_SWEEPS = data_of("jaxsat.core.declaration", "verified.toml")


def sweeps_of(law: str) -> tuple[Sweep, ...]:
    """Return the sweeps of one of jaxsat's laws, in the order of the data file."""
    return tuple(
        Sweep(number, row["reference"], tuple(map(tuple, row["settled"])))
        for number, row in _SWEEPS[law].items()
    )
