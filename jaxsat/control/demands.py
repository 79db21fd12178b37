"""Demanded oscillation of the two driven axes, from the errors of the third one.

With ω - e ≈ (ρ S, (α S + β C) / ρ), e the orbit frame's rate in body axes, S = sin νt and
C = cos νt, the slow rate s and slow turn ẑ (ω3 and z without their ripple) obey on average
    ds/dt = c α / 2,    dẑ/dt = s - β / 2ν.
After Morin and Samson, IEEE Trans. Robotics and Automation 13(4), 1997; see docs/laws.md.
"""

import abc

import equinox as eqx
import jax.numpy as jnp

from jaxsat.core.array_types import RealScalar
from jaxsat.core.checks import not_negative, positive
from jaxsat.core.quotients import reciprocal

TINY = 1e-12
"""Keeps a quotient of two zeros finite."""


class AbstractDemand(eqx.Module):
    """Demanded oscillation for a slow rate s (rad/s) and slow turn ẑ (rad)."""

    @abc.abstractmethod
    def __call__(
        self, rate: RealScalar, turn: RealScalar, coupling: RealScalar, frequency: RealScalar
    ) -> tuple[RealScalar, RealScalar]:
        """(α, β) in (rad/s)²; `coupling` is c, `frequency` ν in rad/s."""


def beyond(turn: RealScalar, rest: RealScalar) -> RealScalar:
    """The part of a turn (rad) outside ± `rest`."""
    return turn - jnp.clip(turn, -rest, rest)


class MorinSamson(AbstractDemand):
    """The product of the rates alone: d²ẑ/dt² + 2ζ k3 dẑ/dt + k3² ẑ = 0 on average.

    A turn within ± `rest` (rad) is left to the end game.
    """

    k3: RealScalar = eqx.field(converter=positive("k3"))
    damping: RealScalar = eqx.field(converter=positive("damping"))
    rest: RealScalar = eqx.field(converter=not_negative("rest"), default=0.0)

    def __call__(
        self, rate: RealScalar, turn: RealScalar, coupling: RealScalar, frequency: RealScalar
    ) -> tuple[RealScalar, RealScalar]:
        """α = -(2 / c)(k3² ẑ + 2ζ k3 s), β = 0, with the part of ẑ outside ± `rest`."""
        correction = self.k3**2 * beyond(turn, self.rest) + 2 * self.damping * self.k3 * rate
        alpha = -2 * reciprocal(coupling) * correction
        return alpha, jnp.zeros_like(alpha)


class TwoChannel(AbstractDemand):
    """Product and area: ds/dt = -k3 s and dẑ/dt = -kz ẑ on average, each on its own channel.

    A turn within ± `rest` (rad) is left to the end game, and so is its drift.
    """

    k3: RealScalar = eqx.field(converter=positive("k3"))
    kz: RealScalar = eqx.field(converter=positive("kz"))
    rest: RealScalar = eqx.field(converter=not_negative("rest"), default=0.0)

    def __call__(
        self, rate: RealScalar, turn: RealScalar, coupling: RealScalar, frequency: RealScalar
    ) -> tuple[RealScalar, RealScalar]:
        """α = -(2 / c) k3 s, β = 2ν (kz ẑ + s), of ẑ the part outside ± `rest`, and s only
        there."""
        excess = beyond(turn, self.rest)
        share = jnp.where(self.rest > 0, jnp.abs(excess) / (jnp.abs(excess) + self.rest + TINY), 1)
        alpha = -2 * reciprocal(coupling) * self.k3 * rate
        return alpha, 2 * frequency * (self.kz * excess + share * rate)
