"""Angular-velocity stabilisation with two torques: equations (38) and (39)."""

import dataclasses
from collections.abc import Mapping
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.control.controller import AbstractBacksteppingLaw, LawContext, Memory
from jaxsat.core.array_types import BoolScalar, Pair, RealScalar
from jaxsat.core.checks import positive, require_positive
from jaxsat.core.declaration import LawDeclaration
from jaxsat.core.declaration.paper import RATE
from jaxsat.core.smooth import Width, as_width, root_abs, signed_root
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class RateLaw(AbstractBacksteppingLaw):
    """Drives all three rates to zero, steering ω3 through the gyroscopic torque.

    With the reference (38) the third rate obeys dω3/dt = -k1 |J1 - J2| / J3 · ω3 once the first
    two rates track. `k1` has the unit √(rad/s), `k2` is in 1/s, both positive. `width` (rad/s)
    rounds √|ω3| near zero; without one it is the printed law, whose reference has no derivative
    at ω3 = 0. `turning_right` holds that law on one side of ω3 = 0, see `smooth_piece`.
    """

    declaration: ClassVar[LawDeclaration] = RATE

    model: RigidBody
    k1: RealScalar = eqx.field(converter=positive("k1"))
    k2: RealScalar = eqx.field(converter=positive("k2"))
    width: Width = eqx.field(converter=as_width, default=None)
    turning_right: BoolScalar | None = None

    def __check_init__(self):
        if self.width is not None:
            require_positive("width", self.width)

    @classmethod
    def from_table(cls, values: Mapping[str, Any], context: LawContext) -> "RateLaw":
        """The law from a scenario's table."""
        return cls(context.model, values["k1"], values["k2"], values["omega3_width_rad_s"])

    def init(self, state: PlantState) -> Memory:
        """The memory at the start: the law has none."""
        return None

    def is_smooth(self) -> bool:
        """Whether the torque is smooth: with a width above zero."""
        return self.width is not None

    def event_functions(self, state: PlantState) -> Float[Array, " m"]:
        """ω3, where the printed reference has its corner."""
        return state.omega[2:] if self.width is None else state.omega[:0]

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "RateLaw":
        """The law restricted to ω3 > 0 or ω3 < 0."""
        return self if not signs.size else dataclasses.replace(self, turning_right=signs[0])

    def reference_rate(self, state: PlantState) -> Pair:
        """Equation (38): ω1a = -sgn(J1 - J2) sgn(ω3) √|ω3|, ω2a = k1 √|ω3|."""
        j1, j2, _ = self.model.spacecraft.moments
        omega3 = state.omega[2]
        omega1a = -jnp.sign(j1 - j2) * signed_root(omega3, self.width, self.turning_right)
        omega2a = self.k1 * root_abs(omega3, self.width, self.turning_right)
        return jnp.stack([omega1a, omega2a])

    def feedback(self, state: PlantState, rate_error: Pair, memory: Memory) -> Pair:
        """The first term of (39): -k2 J_i (ω_i - ω_ia)."""
        return -self.k2 * self.model.spacecraft.moments[:2] * rate_error

    def memory_rate(self, rate_error: Pair, memory: Memory) -> Memory:
        """The rate of the memory, which is empty."""
        return memory

    def lyapunov(
        self, state: PlantState, memory: Memory, unmodelled: Pair, unmodelled_rate: Pair
    ) -> RealScalar:
        """V1 = J3 ω3² / 2, J."""
        return self.model.spacecraft.moments[2] * state.omega[2] ** 2 / 2
