"""Estimate of the third axis, from observer and least squares together.

No torque acts about the third axis, so what cannot be cancelled there must be known: the ripple of
the periodic d3, and the errors through which torques meant for the first two axes reach it.
"""

from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxsat.control.least_squares import Fit, RecursiveLeastSquares
from jaxsat.control.normal_form import NormalForm, leaned
from jaxsat.control.ripple import RippleFilter, ThirdRate
from jaxsat.core.array_types import BoolScalar, Matrix, RealScalar, Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.core.checks import as_float, numpy_if_known
from jaxsat.core.quotients import SMALLEST, reciprocal
from jaxsat.core.trees import choose

MIN_COUPLING, MIN_SHARE = 0.2, 0.2
"""Smallest credible coupling, absolute and relative to the model's c: the laws divide by it."""


MOST_TILT, MOST_TURN = 0.06, 0.03
"""Largest departure of the laws from an attitude that cannot be held, as tilt of the body's third
axis alone and as turn about it alone, rad. The tolerances are 0.05 of z and of |w|, which is half
of the tilt, both of the body's axes whatever the plane of the torques."""


class ThirdAxis(NamedTuple):
    """Estimate of the third axis for a law.

    `rate` is s less its value at rest in the orbit frame (rad/s), `lean` are the (ε1, ε2) by which
    the turn about n is that of s, p1 and p2, and the ripples of rate (rad/s) and turn (rad) are to
    be ignored. `products` are the six factors of ds/dt. The first two, a of p1 p2 and b of p1² -
    p2², follow from one product `coupling` = √(a² + 4b²) of the rates about the axes of the reduced
    inertia; `axes` is (cos, sin) of the angle about n from x and y to these. Where the target
    attitude cannot be held, the laws go to the nearest that can be, at most `MOST_TILT` or
    `MOST_TURN` away: `turn` is the rotation vector to it along (x, y, n) (rad), `orbit_rate` and
    `rest` are the orbit frame's rate along (x, y, n) and (p1, p2, s) at rest there (rad/s), and
    `drift` is the remaining ds/dt (rad/s²).
    """

    rate: RealScalar
    lean: Float[Array, "2"]
    coupling: RealScalar
    axes: Float[Array, "2"]
    rate_ripple: RealScalar
    turn_ripple: RealScalar
    products: Float[Array, "6"]
    turn: Vector
    orbit_rate: Vector
    rest: Vector
    drift: RealScalar

    def change(self, omega: Vector) -> RealScalar:
        """ds/dt (rad/s²) at the rates (p1, p2, s), rad/s."""
        return jnp.sum(self.products * products_of(omega))


class ThirdAxisBelief(NamedTuple):
    """Consequences of the fitted errors alone, see `ThirdAxis`.

    They are recomputed only after a change of these, as this takes roots and quotients.
    """

    coupling: RealScalar
    axes: Float[Array, "2"]
    turn: Vector
    drift: RealScalar


class EstimatorMemory(NamedTuple):
    """Memories of observer and fit and its belief, each `None` without one; the last rates."""

    ripple: PyTree
    fit: Fit | None
    belief: ThirdAxisBelief | None
    omega: Vector
    started: BoolScalar


class ThirdAxisEstimator(eqx.Module):
    """Observer and fit together; without either the third axis is that of the model.

    The observer predicts the measured ω3 with the fitted errors, so that a new estimate does not
    look like a disturbance. A drift at rest within ± `balanced` (rad/s²), unless that is None, does
    not move the attitude from the target. `gradient` is √3 ω0 times the direction to the Earth's
    centre along (x, y, n) in the target attitude (rad/s), None without gravity gradient: its torque
    3 ω0² o × J o is that of -ω × J ω at ω = √3 ω0 o with the other sign, so it changes s by the
    same products. If it `balances_steady`, the observer's steady acceleration is part of the drift
    at rest: the residual of errors of the products. `most_turn` (rad) is the largest turn of the
    held attitude about n alone.
    """

    form: NormalForm
    observer: RippleFilter | None
    least_squares: RecursiveLeastSquares | None
    balanced: RealScalar | None = None
    gradient: Vector | None = None
    balances_steady: bool = eqx.field(static=True, default=False)
    most_turn: RealScalar = eqx.field(converter=as_float, default=MOST_TURN)

    def init(self, omega: Vector) -> EstimatorMemory:
        """The memory with the rates (p1, p2, s), rad/s, and no errors."""
        return EstimatorMemory(
            None if self.observer is None else self.observer.init(omega[2]),
            None if self.least_squares is None else self.least_squares.init(omega),
            None if self.least_squares is None else self._no_belief(omega),
            omega,
            jnp.array(False),
        )

    @staticmethod
    def _no_belief(omega: Vector) -> ThirdAxisBelief:
        """Placeholder until the first sample computes a belief."""
        zero = jnp.zeros_like(omega[0])
        return ThirdAxisBelief(zero, jnp.zeros_like(omega[:2]), jnp.zeros_like(omega), zero)

    def update(
        self,
        omega: Vector,
        memory: EstimatorMemory,
        period: RealScalar,
        attitude: Quaternion | None = None,
        thrust: Float[Array, " k"] | None = None,
    ) -> tuple[ThirdAxis, EstimatorMemory]:
        """The estimate from one sample of (p1, p2, s), and the next memory; `period` in s.

        `attitude` is that of `NormalState`; without it gravity gradient is ignored. `thrust` are
        regressors of the fit beside its eight.
        """
        c, lean, started = self.form.coupling, self.form.lean, memory.started
        factors = self.form.other_products.at[0].add(c)
        last = jnp.where(started, memory.omega, omega)
        span = jnp.where(started, period, 0.0)
        products = integrated_products(last, omega, span)
        if self.gradient is not None and attitude is not None:
            gradient = leaned(in_body(attitude, self.gradient), lean)
            products = products - products_of(gradient) * span
        errors = jnp.zeros(8, omega.dtype) if memory.fit is None else memory.fit.estimate
        ripple, fit = memory.ripple, memory.fit
        if self.observer is not None:
            terms = [(omega - last)[:2], products, *([] if thrust is None else [thrust])]
            change = jnp.sum(factors * products) + jnp.sum(jnp.concatenate(terms) * errors)
            # Period, not span, so that sine and cosine are uniform over all cases.
            advanced = self.observer.advance(ripple, omega, change, period)
            first = self.observer.init(omega[2])
            ripple = choose(started, advanced, first)
            ripple = self.observer.correct(ripple, omega)
        if self.least_squares is not None and fit is not None:
            fit = fit._replace(first_omega=jnp.where(started, fit.first_omega, omega))
            regressors = products if thrust is None else jnp.concatenate([products, thrust])
            fit = self.least_squares.update(fit, omega, regressors, factors)
            errors, old = fit.estimate, memory.belief
            of_errors = factors + errors[2:8]
            steady = self._balanced_steady(ripple)
            belief = jax.lax.cond(
                fit.samples == 0, lambda: self._belief(of_errors, c, lean, steady), lambda: old
            )
            following = EstimatorMemory(ripple, fit, belief, omega, jnp.array(True))
        else:
            belief = self._belief(factors, c, lean, self._balanced_steady(ripple))
            following = EstimatorMemory(ripple, None, None, omega, jnp.array(True))
        return self._third_axis(omega, ripple, errors, factors, lean, belief), following

    def _balanced_steady(self, ripple: PyTree) -> RealScalar | None:
        """The steady acceleration (rad/s²) that the attitude balances, if any."""
        if self.observer is None or not self.balances_steady:
            return None
        return self.observer.believed(ripple).steady

    def _belief(
        self,
        products: Float[Array, "6"],
        c: RealScalar,
        lean: Float[Array, "2"],
        steady: RealScalar | None,
    ) -> ThirdAxisBelief:
        """The belief from the estimated factors of ds/dt; `c` and `lean` are the model's own,
        `steady` (rad/s²) is balanced by the attitude beside the products."""
        coupling, axes = _main_axes(products[0], products[1])
        if self.least_squares is not None:  # else the model's own value, however small
            coupling = jnp.maximum(coupling, jnp.minimum(MIN_COUPLING, MIN_SHARE * jnp.abs(c)))
        turn = self._balance(products, lean, steady)
        drift = jnp.sum(products * products_of(leaned(self._orbit_rate(turn), lean)))
        if self.gradient is not None:
            gradient = leaned(seen_turned(self.gradient, turn), lean)
            drift = drift - jnp.sum(products * products_of(gradient))
        return ThirdAxisBelief(coupling, axes, turn, drift)

    def _orbit_rate(self, turn: Vector) -> Vector:
        """`orbit_rate` of `ThirdAxis`, a `turn` (rad) from the orbit frame."""
        return seen_turned(self.form.orbit_rate, turn)

    def _third_axis(
        self,
        omega: Vector,
        ripple: PyTree,
        errors: Float[Array, " n"],
        factors: Float[Array, "6"],
        lean: Float[Array, "2"],
        belief: ThirdAxisBelief,
    ) -> ThirdAxis:
        zero = jnp.zeros_like(omega[2])
        estimate = ThirdRate(omega[2], zero, zero)
        if self.observer is not None:
            estimate = self.observer.believed(ripple)
        orbit_rate = self._orbit_rate(belief.turn)
        rest = leaned(orbit_rate, lean)
        return ThirdAxis(
            estimate.rate - rest[2] - jnp.sum(errors[:2] * (omega - rest)[:2]),
            lean + errors[:2],
            belief.coupling,
            belief.axes,
            estimate.rate_ripple,
            estimate.turn_ripple,
            factors + errors[2:8],
            belief.turn,
            orbit_rate,
            rest,
            belief.drift if estimate.steady is None else belief.drift + estimate.steady,
        )

    def _balance(
        self, products: Float[Array, "6"], lean: Float[Array, "2"], steady: RealScalar | None
    ) -> Vector:
        """The smallest turn (rad) from the orbit frame to where s stays, measured by `_reach`,
        where it is at most 1."""
        drift, by_turn = _drift(products, lean, self.form.orbit_rate)
        if self.gradient is not None:
            less, slope = _drift(products, lean, self.gradient)
            drift, by_turn = drift - less, by_turn - slope
        if steady is not None:
            drift = drift + steady
        if self.balanced is not None:
            drift = drift - jnp.clip(drift, -self.balanced, self.balanced)
        steepest = self._reach @ by_turn
        change = jnp.sum(by_turn * steepest) + SMALLEST
        share = -drift * reciprocal(change)
        size = jnp.sqrt(share**2 * change + SMALLEST)
        return share * jnp.minimum(1 / size, 1.0) * steepest

    @property
    def _reach(self) -> Matrix:
        """W: turns δ along (x, y, n) with δ·W⁻¹δ ≤ 1 are permitted to the laws, rad².

        An ellipsoid with `MOST_TILT` along the body's first two axes and `MOST_TURN` along its
        third, compressed along n until it reaches `most_turn` there, where the end game turns.
        """
        _, axes, about_n = numpy_if_known(self.form.axes, self.most_turn)
        turn, tilt = MOST_TURN**2, MOST_TILT**2
        ellipsoid = axes @ np.diag((tilt, tilt, turn)) @ axes.T
        along, most = ellipsoid[2], ellipsoid[2, 2]
        return as_float(
            ellipsoid - along[:, None] * along[None, :] * ((most - about_n**2) / most**2)
        )


def _drift(
    products: Float[Array, "6"], lean: Float[Array, "2"], rate: Vector
) -> tuple[RealScalar, Vector]:
    """ds/dt at the orbit's rate along (x, y, n) (rad/s), and its derivative by a body turn."""
    change = jax.value_and_grad(lambda rates: jnp.sum(products * products_of(rates)))
    drift, slope = change(leaned(rate, lean))
    return drift, jnp.cross(slope.at[:2].add(-lean * slope[2]), rate)


def seen_turned(vector: Vector, turn: Vector) -> Vector:
    """A vector of the orbit frame along (x, y, n) of a body that is a small `turn` (rad) away."""
    across = jnp.cross(turn, vector)
    return vector - across + jnp.cross(turn, across) / 2


def in_body(attitude: Quaternion, vector: Vector) -> Vector:
    """A vector of the orbit frame turned like (x, y, n), along the axes of an attitude."""
    scalar, along = attitude.q[0], attitude.q[1:]
    cross = jnp.cross(along, vector)
    return vector + 2 * (jnp.cross(along, cross) - scalar * cross)


def _main_axes(a: RealScalar, b: RealScalar) -> tuple[RealScalar, Float[Array, "2"]]:
    """`coupling` and `axes` of `ThirdAxis`: half of the angle of (a, -2b), by half-angles."""
    along = jnp.abs(a) + SMALLEST
    coupling = jnp.sqrt(along**2 + 4 * b**2)
    large = jnp.sqrt((1 + along / coupling) / 2)
    small = -b * reciprocal(coupling * large)
    side = jnp.where(b >= 0, -1.0, 1.0)
    axes = jnp.where(a < 0, jnp.stack([side * small, side * large]), jnp.stack([large, small]))
    return coupling, axes


def integrated_products(before: Vector, after: Vector, span: RealScalar) -> Float[Array, "6"]:
    """Integrals of the six products over a span (s) in which the rates change linearly."""
    # Simpson's rule, exact for squares of straight lines; the middle counts four times, as does the
    # square of twice its rates.
    return (products_of(before) + products_of(before + after) + products_of(after)) * (span / 6)


def products_of(omega: Vector) -> Float[Array, "6"]:
    """p1 p2, p1² - p2², p2 s, p1 s, p1² + p2² and s², of which ds/dt is a sum."""
    x, y, z = omega
    return jnp.stack([x * y, x**2 - y**2, y * z, x * z, x**2 + y**2, z**2])
