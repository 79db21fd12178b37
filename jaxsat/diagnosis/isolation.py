"""Which thruster failed, and how: likelihoods of the kinds of failure.

A failed thruster lacks the part a of what was commanded and has the part b of full thrust all the
time. The kinds are points and lines in the plane of (a, b):

    dead (1, 0), degraded (s, 0), stuck on (1, 1), stuck at (1, s), leaking (s, s), reversed (2, 0).
"""

import enum
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxsat.diagnosis.residual import Residual

RealScalar = Float[Array, ""]

PENALTY = 3.0
"""Of a free number, in units of log-likelihood, so that the simpler of two kinds wins."""

LEAST_PART = 0.02
"""A loss or a leak below this part of full thrust is none."""

IMPOSSIBLE = 1e5
"""A log-likelihood below any other."""

UNIT = 1e4
"""Of evidence, which is kept in numbers that are not too large for a state."""

MOST_INFORMATION = 1e5
"""In that unit; what is far beyond doubt is not added up."""


class DiagnosedKind(enum.IntEnum):
    """Kinds of failure that are told apart; the first five as `jaxsat.vehicle.FailureKind`."""

    DEAD = 0
    DEGRADED = 1
    STUCK_ON = 2
    STUCK_AT = 3
    LEAKING = 4
    REVERSED = 5


class Evidence(NamedTuple):
    """Of (a, b) of each thruster since an alarm: information matrix, and its product with them.

    `information` has the entries aa, ab and bb, `weighted` those of a and b, over `UNIT`.
    """

    information: Float[Array, "3 m"]
    weighted: Float[Array, "2 m"]

    @staticmethod
    def none(count: int) -> "Evidence":
        """Nothing known."""
        return Evidence(jnp.zeros((3, count)), jnp.zeros((2, count)))

    def after(self, residual: Residual, uncertainty: RealScalar) -> "Evidence":
        """With one more residual, of which the part `uncertainty` may be an error of the model.

        Evidence beyond any doubt is kept at `MOST_INFORMATION`.
        """
        loss, flow, seen = residual.loss, residual.flow, residual.innovation
        variance = UNIT * residual.doubt(uncertainty) ** 2
        products = (loss * loss, loss * flow, flow * flow)
        more = jnp.stack([jnp.sum(one, axis=0) for one in products])
        found = jnp.stack([jnp.sum(seen[:, None] * one, axis=0) for one in (loss, flow)])
        information = self.information + more / variance
        most = jnp.maximum(jnp.max(information), MOST_INFORMATION)
        scale = MOST_INFORMATION / most
        return Evidence(scale * information, scale * (self.weighted + found / variance))


class Explanation(NamedTuple):
    """The thruster that explains the residuals best, the kind, its (a, b), and how well.

    `score` is the log-likelihood over that of no failure, `margin` how far it is above that of the
    best other thruster. `tested` is the information about a. `scores` has that of each thruster's
    best explanation.
    """

    thruster: Int[Array, ""]
    kind: Int[Array, ""]
    loss: RealScalar
    flow: RealScalar
    score: RealScalar
    margin: RealScalar
    tested: RealScalar
    scores: Float[Array, " m"]


def explanation(
    evidence: Evidence,
    failed: Bool[Array, " m"],
    lasting: Bool[Array, " m"],
    uncertainty: RealScalar,
) -> Explanation:
    """The best explanation, where full thrusts are known to within the part `uncertainty`.

    For thrusters that have `failed` it is that they work again, in full (`DEAD`, of which a is 1)
    or in part (`DEGRADED`): of what was lost a has come back. Those whose failure is `lasting`
    are no explanation.
    """
    evidence = jax.tree.map(lambda x: UNIT * x, evidence)
    parts = _parts(evidence, uncertainty)  # (kinds, 2, m)
    a, b = parts[:, 0], parts[:, 1]
    aa, ab, bb = evidence.information
    quadratic = a**2 * aa[None] + 2 * a * b * ab[None] + b**2 * bb[None]
    weighted = evidence.weighted
    scores = a * weighted[:1] + b * weighted[1:] - quadratic / 2
    kinds = jnp.arange(len(DiagnosedKind))[:, None]
    free = jnp.isin(kinds, jnp.array(_LINES))
    scores = scores - jnp.where(free, PENALTY, 0.0)
    strength = (b - 1) ** 2 / (2 * uncertainty**2)
    scores = scores - jnp.where(kinds == DiagnosedKind.STUCK_ON, strength, 0.0)
    of_failed = kinds <= DiagnosedKind.DEGRADED
    scores = jnp.where((failed[None] & ~of_failed) | lasting[None], -IMPOSSIBLE, scores)
    best = jnp.max(scores, axis=0)
    thruster = jnp.argmax(best)
    others = jnp.where(jnp.arange(failed.shape[0]) == thruster, -IMPOSSIBLE, best)
    kind = jnp.argmax(scores[:, thruster])
    return Explanation(
        thruster,
        kind,
        a[kind, thruster],
        b[kind, thruster],
        best[thruster],
        best[thruster] - jnp.max(others),
        aa[thruster],
        best,
    )


_LINES = (DiagnosedKind.DEGRADED, DiagnosedKind.STUCK_AT, DiagnosedKind.LEAKING)


def _parts(evidence: Evidence, uncertainty: RealScalar) -> Float[Array, "kinds 2 m"]:
    """The most likely (a, b) of every kind; b of one stuck on is full thrust as it really is."""
    aa, ab, bb = evidence.information
    y, z = evidence.weighted
    one, zero = jnp.ones_like(y), jnp.zeros_like(y)

    def nearest(value, weight):
        quotient = value / jnp.where(weight > 0, weight, 1.0)
        return jnp.clip(quotient, LEAST_PART, 1.0)

    lost, stuck = nearest(y, aa), nearest(z - ab, bb)
    certain = 1 / uncertainty**2
    fully = (z - ab + certain) / (bb + certain)
    leak = nearest(y + z, aa + 2 * ab + bb)
    return jnp.stack(
        [
            jnp.stack(pair)
            for pair in (
                (one, zero),
                (lost, zero),
                (one, fully),
                (one, stuck),
                (leak, leak),
                (2 * one, zero),
            )
        ]
    )
