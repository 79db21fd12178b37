"""Reduced-effort control of an axisymmetric spacecraft: Tsiotras and Luo, Automatica 36, 2000."""

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.declaration import LawDeclaration, number
from jaxsat.spacecraft.dynamics import RigidBody

Scalar = Float[Array, ""]

TILT = 1e-4
"""Least |w|² in η, which has no limit at w = 0: below it the turn about z fades."""


class ReducedEffortLaw(AbstractSampledController):
    """Brings an axisymmetric body that does not spin to rest in the orbit frame by two torques.

    With η = z / |w|² and T = atan(ρ (1 - η²)) the rates track ω_d = -κ w - i μ η w, where
    κ = 2 κc T / π and μ = μc T / π + μc / 2; the torque is J1 (dω_d/dt - α (ω - ω_d)).
    """

    declaration = LawDeclaration(
        summary="reduced-effort control of an axisymmetric body",
        keys=(
            number("kappa_c", "Gain κc on the tilt", "1/s", above=0, tunable=True),
            number("mu_c", "Gain μc on the turn", "1/s", above=0, tunable=True),
            number("rho", "Sharpness ρ of the change of the gains", above=0, default=2.0),
            number("alpha", "Gain α on the rate errors", "1/s", above=0, tunable=True),
            number("period_s", "Time between two runs", "s", at_least=1e-3, default=0.05),
        ),
        works_in_wz=True,
    )

    model: RigidBody
    kappa_c: Scalar = eqx.field(converter=jnp.asarray)
    mu_c: Scalar = eqx.field(converter=jnp.asarray)
    rho: Scalar = eqx.field(converter=jnp.asarray)
    alpha: Scalar = eqx.field(converter=jnp.asarray)
    period: Scalar = eqx.field(converter=jnp.asarray)

    @classmethod
    def from_table(cls, values, context):
        gains = [values[name] for name in ("kappa_c", "mu_c", "rho", "alpha", "period_s")]
        return cls(context.model, *gains)

    def init(self, state):
        return None

    def reference(self, attitude):
        """ω_d about x and y, rad/s."""
        wz = attitude.as_wz()
        (w1, w2), eta = wz.w, wz.z / jnp.maximum(jnp.sum(wz.w**2), TILT)
        share = jnp.arctan(self.rho * (1 - eta**2)) / jnp.pi
        kappa, mu = 2 * self.kappa_c * share, self.mu_c * (share + 0.5)
        return -kappa * wz.w - mu * eta * jnp.stack([-w2, w1])

    def step(self, t, state, memory):
        attitude = state.attitude
        rate = attitude.rate(self.model.relative_rate(state))
        reference, slope = jax.jvp(self.reference, (attitude,), (rate,))
        moments = self.model.spacecraft.moments[:2]
        return moments * (slope - self.alpha * (state.omega[:2] - reference)), memory

    def rate_error(self, state, memory):
        return state.omega[:2] - self.reference(state.attitude)
