"""Newton's step of a plan by a Riccati recursion, at a cost linear in the number of intervals.

The step is that of a linear-quadratic problem in the changes of (x, T), where T is a state without
dynamics, and of u. The Hessian omits the dynamics' second derivatives (Gauss-Newton): it is
positive definite, and near an optimum at the limits of the torques, as those of least time are, the
step is Newton's nevertheless. References: Rao, Wright, Rawlings, J. Optim. Theory Appl. 99(3),
1998; Wächter and Biegler, Math. Program. 106(1), 2006.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jax import lax
from jaxtyping import Array, Float

from jaxsat.control.planning.barriers import EndTerms
from jaxsat.control.planning.transcription import STATES, Transcription, Unknowns
from jaxsat.core.array_types import RealScalar

ARRIVAL_WEIGHT = 1e5
"""Weight of |arrival|² in the step, with multipliers, which make it exact as they converge."""

DURATION_PROXIMITY = 0.01
"""Weight of the squared change of T, relative to that of the torques' changes."""


class QuadraticTerms(NamedTuple):
    """The step's cost by the torques and by T; `proximity` holds the step near its begin.

    `duration_curvature` is infinite for a given duration. `end` belongs to the place in the
    tolerances where the plan ends.
    """

    curvature: Float[Array, "n m"]
    gradient: Float[Array, "n m"]
    duration_curvature: RealScalar
    duration_gradient: RealScalar
    proximity: RealScalar
    end: EndTerms | None = None


class NewtonStep(NamedTuple):
    """Changes of the unknowns, multipliers of the arrival, and the largest multiplier of all."""

    change: Unknowns
    arrival_multipliers: Float[Array, "6"]
    largest_multiplier: RealScalar


class _Stage(NamedTuple):
    """The dynamics of changes in one interval, and the feedback."""

    by_state: Float[Array, "7 8"]
    by_torque: Float[Array, "7 m"]
    defect: Float[Array, "7"]
    feedback: Float[Array, "m 8"]
    feedforward: Float[Array, " m"]


def solved(matrix: Float[Array, "m m"], right: Float[Array, "m k"]) -> Float[Array, "m k"]:
    """matrix⁻¹ right for a positive definite matrix of a few rows, by Cholesky's factors."""
    size = matrix.shape[0]
    rows, factors = [], []
    for i in range(size):
        row_before: list[Array] = []
        for j in range(i):
            row_before.append((matrix[i, j] - _product(row_before, factors[j])) * factors[j][j])
        inverse = 1 / jnp.sqrt(matrix[i, i] - _product(row_before, row_before))
        row = right[i]
        for j in range(i):
            row = row - row_before[j] * rows[j]
        rows.append(row * inverse)
        factors.append([*row_before, inverse])
    for i in reversed(range(size)):
        for j in range(i + 1, size):
            rows[i] = rows[i] - factors[j][i] * rows[j]
        rows[i] = rows[i] * factors[i][i]
    return jnp.stack(rows)


def _product(a: list, b: list):
    return sum((x * y for x, y in zip(a, b, strict=False)), 0.0)


def newton_step(
    program: Transcription,
    begin: RealScalar,
    at: Unknowns,
    arrival_multipliers: Float[Array, "6"],
    terms: QuadraticTerms,
) -> NewtonStep:
    """The step from some unknowns, for a plan that begins at the time `begin`."""
    miss = program.missed(at)
    by_state = jax.jacfwd(program.arrival)(at.last)
    jacobian = jnp.concatenate([by_state, jnp.zeros((len(miss), 1))], axis=1)
    weight, multipliers = _arrival_terms(arrival_multipliers, terms.end)
    hessian = jacobian.T @ weight @ jacobian
    gradient = jacobian.T @ (multipliers + weight @ miss)
    (hessian, gradient), stages = _backward(program, begin, at, terms, (hessian, gradient))
    curvature = hessian[STATES, STATES] + terms.duration_curvature
    curvature = curvature + DURATION_PROXIMITY * terms.proximity
    duration = -(gradient[STATES] + terms.duration_gradient) / curvature

    def forward(before, stage: _Stage):
        change = jnp.concatenate([before, duration[None]])
        torque = stage.feedback @ change + stage.feedforward
        after = stage.by_state @ change + stage.by_torque @ torque + stage.defect
        return after, (before, torque)

    last, (states, torque) = lax.scan(forward, jnp.zeros(STATES), stages)
    still_missed = miss + by_state @ last
    multipliers = multipliers + weight @ still_missed
    place = _place_change(arrival_multipliers, still_missed, terms.end)

    def tied(carry, matrix):
        multiplier, largest = carry
        largest = jnp.maximum(largest, jnp.max(jnp.abs(multiplier)))
        return (matrix[:, :STATES].T @ multiplier, largest), None

    end = (by_state.T @ multipliers, jnp.max(jnp.abs(multipliers)))
    (_, largest), _ = lax.scan(tied, end, stages.by_state, reverse=True)
    return NewtonStep(Unknowns(states, last, torque, duration, place), multipliers, largest)


def _arrival_terms(multipliers: Float[Array, "6"], end: EndTerms | None):
    """Weight and multipliers of a plan's missed arrival, with the change of the place eliminated.

    The place moves by (W R² + H)⁻¹ (R (λ + W m) - g) where the arrival misses it by m.
    """
    if end is None:
        return ARRIVAL_WEIGHT * jnp.eye(len(multipliers)), multipliers
    radii, scaled = end.radii, end.hessian / end.radii[None]
    right = jnp.concatenate([scaled, end.gradient[:, None]], axis=1)
    response = radii[:, None] * solved(_place_curvature(end), right)
    share, pull = response[:, :-1], response[:, -1]
    return ARRIVAL_WEIGHT * share, share @ multipliers + ARRIVAL_WEIGHT * pull


def _place_change(
    multipliers: Float[Array, "6"], miss: Float[Array, "6"], end: EndTerms | None
) -> Float[Array, "6"] | None:
    if end is None:
        return None
    pull = end.radii * (multipliers + ARRIVAL_WEIGHT * miss) - end.gradient
    return solved(_place_curvature(end), pull[:, None])[:, 0]


def _place_curvature(end: EndTerms) -> Float[Array, "6 6"]:
    return ARRIVAL_WEIGHT * jnp.diag(end.radii**2) + end.hessian


def _backward(program: Transcription, begin: RealScalar, at: Unknowns, terms: QuadraticTerms, end):
    """Cost-to-go at the first state, and all stages."""
    m = at.torque.shape[1]
    still = jnp.eye(STATES + 1)[STATES:]

    def backward(carry, inputs):
        (hessian, gradient), after = carry
        number, x, u, curvature, slope = inputs
        end_state, by_state, by_torque = program.linearised(begin, number, x, at.duration, u)
        a = jnp.concatenate([by_state, still])
        b = jnp.concatenate([by_torque, jnp.zeros((1, m))])
        defect = end_state - after
        weighted = hessian @ b
        slope_after = hessian[:, :STATES] @ defect + gradient
        own = b.T @ weighted + jnp.diag(curvature + terms.proximity)
        cross = weighted.T @ a
        pull = slope + b.T @ slope_after
        response = solved(own, jnp.concatenate([cross, pull[:, None]], axis=1))
        feedback, feedforward = -response[:, :-1], -response[:, -1]
        before = a.T @ hessian @ a + cross.T @ feedback
        before = (before + before.T) / 2
        to_go = (before, a.T @ slope_after + cross.T @ feedforward)
        return (to_go, x), _Stage(by_state, by_torque, defect, feedback, feedforward)

    rows = (program.numbers(at), at.states, at.torque, terms.curvature, terms.gradient)
    (to_go, _), stages = lax.scan(backward, (end, at.last), rows, reverse=True)
    return to_go, stages
