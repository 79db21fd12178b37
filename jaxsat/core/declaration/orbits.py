"""Parts whose torque depends on where the spacecraft is in its orbit."""

from collections.abc import Iterator
from typing import Any

from jaxsat.core.declaration.keys import Finding, Rule

RATE_AT_GROUND = 0.00124
"""rad/s; of a circular orbit at the Earth's surface."""


def needs_orbit(key: str, what: str) -> Rule:
    """The rule that the orbit is above the ground where the value of `key` is not zero or empty."""

    def check(rate: float | None, value: Any) -> Iterator[Finding]:
        acts = any(value) if isinstance(value, tuple) else value
        if acts and rate is not None and not 0 < rate <= RATE_AT_GROUND:
            yield Finding(
                "orbit.rate_rad_s",
                "must be that of an orbit above the ground, greater than 0 and at most "
                f"{RATE_AT_GROUND:g} rad/s, with {what}, got {rate}",
            )

    return Rule(("orbit.rate_rad_s", key), check)
