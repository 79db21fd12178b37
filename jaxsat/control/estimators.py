"""What a law should believe of the third axis, from observer and least squares together.

No torque acts about the third axis, so what cannot be cancelled there must be known: the ripple
of the periodic d3, and the errors through which torques meant for the first two axes reach it.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.checks import as_float
from jaxsat.control.least_squares import Fit, RecursiveLeastSquares
from jaxsat.control.normal_form import NormalForm
from jaxsat.control.ripple import AbstractRippleEstimator, ThirdRate

RealScalar = Float[Array, ""]

MIN_COUPLING, MIN_SHARE = 0.2, 0.5
"""A |c + δc| below both the first and this share of the model's |c| is not believed: the laws
divide by it."""


LEAST_TURN = 0.02
"""rad: an attitude as far from the wanted one is left to the end game, which finds it by itself."""


class ThirdAxis(NamedTuple):
    """What a law is told of the third axis.

    `rate` is s less its value at rest in the orbit frame (rad/s), `lean` are the (ε1, ε2) by which
    the turn about n is that of s, p1 and p2, `coupling` is c, and the ripples of rate (rad/s) and
    turn (rad) are those to ignore. `products` are the six factors of ds/dt, c the first of them,
    `drift` is ds/dt (rad/s²) at rest in the orbit frame in the wanted attitude, zero where that can
    be held, and `stiffness` its derivative by the turn (1/s²).
    """

    rate: RealScalar
    lean: Float[Array, "2"]
    coupling: RealScalar
    rate_ripple: RealScalar
    turn_ripple: RealScalar
    products: Float[Array, "6"]
    drift: RealScalar
    stiffness: RealScalar

    def change(self, omega: Float[Array, "3"]) -> RealScalar:
        """ds/dt (rad/s²) at the rates (p1, p2, s), rad/s."""
        return jnp.sum(self.products * _products(omega))


class EstimatorMemory(NamedTuple):
    """Memories of the observer and the fit, each `None` without one, and the last rates."""

    ripple: PyTree
    fit: Fit | None
    omega: Float[Array, "3"]
    started: Bool[Array, ""]


class ThirdAxisEstimator(eqx.Module):
    """Observer and fit together; without either the third axis is what the model says it is.

    The observer predicts the measured ω3 with the fitted errors in it, so that a new estimate
    does not look like a disturbance. A drift of s at rest below `least_drift` (rad/s²), or
    one that a turn of `LEAST_TURN` takes away, is none.
    """

    form: NormalForm
    observer: AbstractRippleEstimator | None = None
    least_squares: RecursiveLeastSquares | None = eqx.field(default_factory=RecursiveLeastSquares)
    least_drift: RealScalar = eqx.field(converter=as_float, default=0.0)

    def init(self, omega: Float[Array, "3"]) -> EstimatorMemory:
        """Nothing known yet but (p1, p2, s), rad/s."""
        return EstimatorMemory(
            None if self.observer is None else self.observer.init(omega[2]),
            None if self.least_squares is None else self.least_squares.init(omega),
            omega,
            jnp.array(False),
        )

    def forget_ripple(self, memory: EstimatorMemory, when: Bool[Array, ""]) -> EstimatorMemory:
        """The disturbance estimate set back to zero where `when` holds."""
        if self.observer is None:
            return memory
        return memory._replace(ripple=self.observer.forget(memory.ripple, when))

    def update(
        self, omega: Float[Array, "3"], memory: EstimatorMemory, period: RealScalar
    ) -> tuple[ThirdAxis, EstimatorMemory]:
        """One sample: what to believe now of (p1, p2, s), and the next memory; `period` in s."""
        c, started = self.form.coupling, memory.started
        factors = self.form.other_products.at[0].add(c)
        memory = jax.tree.map(lambda x, y: jnp.where(started, x, y), memory, self.init(omega))
        span = jnp.where(started, period, 0.0)
        products = span * _mean_products(memory.omega, omega)
        errors = jnp.zeros(8, omega.dtype) if memory.fit is None else memory.fit.estimate
        ripple, fit = memory.ripple, memory.fit
        if self.observer is not None:
            known = jnp.concatenate([(omega - memory.omega)[:2], products])
            change = jnp.sum(factors * products) + jnp.sum(known * errors)
            ripple = self.observer.advance(ripple, omega, change, span)
            ripple = self.observer.correct(ripple, omega, period)
        if self.least_squares is not None and fit is not None:
            fit = self.least_squares.update(fit, omega, products, factors)
            errors = fit.estimate
        following = EstimatorMemory(ripple, fit, omega, jnp.array(True))
        return self._believed(omega, ripple, errors, factors), following

    def _believed(self, omega, ripple, errors, factors) -> ThirdAxis:
        zero, c = jnp.zeros_like(omega[2]), factors[0]
        known = ThirdRate(omega[2], zero, zero)
        if self.observer is not None:
            known = self.observer.believed(ripple, omega[2])
        rest = self.form.rest
        by_others = jnp.sum(errors[:2] * (omega - rest)[:2]) + rest[2]
        least = jnp.minimum(MIN_COUPLING, MIN_SHARE * jnp.abs(c))
        fitted = c + errors[2]
        fitted = jnp.where(fitted < 0, -1.0, 1.0) * jnp.maximum(jnp.abs(fitted), least)
        # Without a fit the model's own value is used, however small.
        believed = c if self.least_squares is None else fitted
        products = (factors + errors[2:]).at[0].set(believed)
        o1, o2, _ = self.form.orbit_rate
        lean1, lean2 = self.form.lean
        # The derivative of the orbit frame's (p1, p2, s) by the turn.
        turning = jnp.stack([o2, -o1, lean2 * o1 - lean1 * o2])
        ahead, behind = (jnp.sum(products * _products(rest + s * turning)) for s in (1, -1))
        drift, stiffness = jnp.sum(products * _products(rest)), (ahead - behind) / 2
        least = jnp.maximum(self.least_drift, LEAST_TURN * jnp.abs(stiffness))
        return ThirdAxis(
            known.rate - by_others,
            self.form.lean + errors[:2],
            believed,
            known.rate_ripple,
            known.turn_ripple,
            products,
            jnp.where(jnp.abs(drift) < least, 0.0, drift),
            stiffness,
        )


def _mean_products(before: Float[Array, "3"], after: Float[Array, "3"]) -> Float[Array, "6"]:
    """Means of the six products over a period in which the rates change linearly."""
    middle = (before + after) / 2
    # Simpson's rule, exact for squares of straight lines.
    return (_products(before) + 4 * _products(middle) + _products(after)) / 6


def _products(omega: Float[Array, "3"]) -> Float[Array, "6"]:
    x, y, z = omega
    return jnp.stack([x * y, x**2 - y**2, y * z, x * z, x**2 + y**2, z**2])
