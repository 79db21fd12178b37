"""Isolation of the failed actuator and its kind of failure by likelihoods.

A failed actuator lacks the fraction a of its command and makes the fraction b of its full torque
all the time. The kinds of failure are points and lines in the plane of (a, b).
"""

import enum
from collections.abc import Callable
from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.core.array_types import IntScalar, RealScalar, Vector
from jaxsat.core.declaration.failures import AbstractFailureKind

LEAST_PART = 0.02
"""Loss or leak, as a fraction of full torque, below which there is none."""


class DiagnosedKind(AbstractFailureKind):
    """Diagnosed kinds of failure; those from `FRICTION_UP` on are of wheels alone."""

    DEAD = 0, "dead", "no torque"
    DEGRADED = 1, "degraded", "a part of the torque that is commanded"
    STUCK_ON = 2, "stuck-on", "full thrust all the time"
    STUCK_AT = 3, "stuck-at", "a part of full thrust all the time"
    LEAKING = 4, "leaking", "never less than a part of full thrust"
    REVERSED = 5, "reversed", "the opposite of the torque that is commanded"
    FRICTION_UP = 6, "friction-up", "the rotor is braked"
    RUNAWAY = 7, "runaway", "full motor torque, which drives the rotor on"
    STOPPED = 8, "stopped", "the rotor stands still"


NONE = -1
"""The kind of an actuator that works."""

Diagnosed = enum.IntEnum(
    "Diagnosed", {"NONE": NONE} | {one.name: one.value for one in DiagnosedKind}
)
"""Verdict on an actuator: the kind of its failure, or none."""


class Hypotheses(NamedTuple):
    """Failure hypotheses of an actuator.

    `parts` gives the most likely (a, b) of each of `kinds` (kinds, 2, m), from the entries aa, ab
    and bb of the information (3, m), its product with (a, b) (2, m) and the uncertainty of full
    torques. Kinds in `free` fit one number; the kind `full` makes its full torque, b = `level` but
    for the uncertainty. `tests` are the signs of flow with a CUSUM test, and `weak_losses` says
    whether small signatures count for a full loss, too: friction, which holds back the small
    commands of a wheel at rest, looks like one. An actuator with a failure of a kind in
    `in_service` stays in use, and is diagnosed further.
    """

    kinds: tuple[int, ...]
    free: tuple[int, ...]
    full: int
    level: float
    parts: Callable[
        [Float[Array, "3 m"], Float[Array, "2 m"], RealScalar], Float[Array, "kinds 2 m"]
    ]
    tests: tuple[float, ...] = (1.0,)
    weak_losses: bool = True
    in_service: tuple[int, ...] = ()


def most_likely(
    value: Float[Array, " m"], weight: Float[Array, " m"], most: float = 1.0
) -> Float[Array, " m"]:
    """Return the value over its weight, a fraction of full torque from `LEAST_PART` to `most`."""
    quotient = value / jnp.where(weight > 0, weight, 1.0)
    return jnp.clip(quotient, LEAST_PART, most)


def stacked_parts(
    *pairs: tuple[Float[Array, " m"], Float[Array, " m"]],
) -> Float[Array, "kinds 2 m"]:
    """Return the (a, b) of every kind, in their order."""
    return jnp.stack([jnp.stack(pair) for pair in pairs])


PENALTY = 3.0
"""Penalty of a fitted number in units of log-likelihood, so that the simpler of two kinds wins."""

IMPOSSIBLE = 1e5
"""Magnitude of a log-likelihood below any other."""

UNIT = 1e4
"""Unit of evidence, which keeps its numbers within the range of a state."""

MOST_INFORMATION = 1e5
"""Information, in that unit, beyond which evidence is no longer added up."""


ALIKE = 3
"""Numbers whose errors may all act alike: moments of inertia, or torques of one wheel."""


class Residual(NamedTuple):
    """Innovations, and the signatures in them of what each actuator may lack or add.

    A column of `innovation` is reading less expectation, with a `variance` each: one for all
    actuators, or one of each. `loss` is the signature of an actuator whose torque has been missing
    (of a failed one: has been there again), `flow` of one that has made its full torque all the
    time, `steady` of a constant acceleration of 1 rad/s², None where none acts. `errors` are the
    signatures of each number of the model, wrong by its uncertainty; the last `ALIKE` may all act
    alike. `driven`, from -1 to 1, says which actuators are driven from rest and which way, None
    where none rests.
    """

    innovation: Float[Array, "n k"]
    variance: Float[Array, " k"]
    loss: Float[Array, "n m"]
    flow: Float[Array, "n m"]
    errors: Float[Array, "numbers n k"]
    steady: RealScalar | None = None
    driven: Float[Array, " m"] | None = None

    def doubt(self, uncertainty: RealScalar) -> Float[Array, " k"]:
        """Return standard deviations with the fraction `uncertainty` as model error."""
        return jnp.sqrt(self.variance + uncertainty**2 * jnp.sum(self.innovation**2, axis=0))


class Evidence(NamedTuple):
    """Evidence on (a, b) of each actuator since an alarm: information, and its product with (a, b).

    `information` has the entries aa, ab and bb, `weighted` those of a and b, over `UNIT`.
    `disturbance` has the same of a constant acceleration: information, and three axes.
    """

    information: Float[Array, "3 m"]
    weighted: Float[Array, "2 m"]
    disturbance: Float[Array, "4"]

    @staticmethod
    def none(count: int) -> "Evidence":
        """Return the evidence before the first residual."""
        return Evidence(jnp.zeros((3, count)), jnp.zeros((2, count)), jnp.zeros(4))

    def after(self, residual: Residual, uncertainty: RealScalar) -> "Evidence":
        """Add a residual, of which the fraction `uncertainty` may be model error.

        Evidence beyond any doubt is kept at `MOST_INFORMATION`.
        """
        loss, flow, innovation = residual.loss, residual.flow, residual.innovation
        variance = UNIT * residual.doubt(uncertainty)[None] ** 2
        products = (loss * loss, loss * flow, flow * flow)
        more = jnp.stack([jnp.sum(one, axis=0) for one in products])
        correlation = jnp.stack([jnp.sum(innovation * one, axis=0) for one in (loss, flow)])
        information = self.information + more / variance
        most = jnp.maximum(jnp.max(information), MOST_INFORMATION)
        scale = MOST_INFORMATION / most
        besides = self.disturbance
        if residual.steady is not None:
            signature = jnp.concatenate([residual.steady[None], innovation[:, 0]])
            besides = scale * (besides + residual.steady * signature / variance[0, 0])
        return Evidence(
            scale * information, scale * (self.weighted + correlation / variance), besides
        )


class Explanation(NamedTuple):
    """The best explanation of residuals: the `actuator`, its failure, and the likelihoods.

    `kind` is a `DiagnosedKind`; a, b are `loss`, `flow`. `score` is the log-likelihood over that of
    no failure, `margin` its lead over the best other actuator and over a constant torque. `tested`
    is the information about a. `scores` has the best score of each actuator, `disturbance` that of
    the constant torque, and `acceleration` (rad/s²) the effect of that torque.
    """

    actuator: IntScalar
    kind: IntScalar
    loss: RealScalar
    flow: RealScalar
    score: RealScalar
    margin: RealScalar
    tested: RealScalar
    scores: Float[Array, " m"]
    disturbance: RealScalar
    acceleration: Vector


def explanation(
    evidence: Evidence,
    failed: Bool[Array, " m"],
    lasting: Bool[Array, " m"],
    uncertainty: RealScalar,
    hypotheses: Hypotheses,
) -> Explanation:
    """Return the best explanation, with full torques known to within the fraction `uncertainty`.

    For actuators that have `failed` it is a recovery, in full (`DEAD`, a = 1) or in part
    (`DEGRADED`, a is the part of the loss that has come back). `lasting` failures are no
    explanation.
    """
    evidence = jax.tree.map(lambda x: UNIT * x, evidence)
    parts = hypotheses.parts(evidence.information, evidence.weighted, uncertainty)  # (kinds, 2, m)
    a, b = parts[:, 0], parts[:, 1]
    aa, ab, bb = evidence.information
    quadratic = a**2 * aa[None] + 2 * a * b * ab[None] + b**2 * bb[None]
    weighted = evidence.weighted
    scores = a * weighted[:1] + b * weighted[1:] - quadratic / 2
    kinds = jnp.array(hypotheses.kinds)[:, None]
    free = jnp.isin(kinds, jnp.array(hypotheses.free))
    scores = scores - jnp.where(free, PENALTY, 0.0)
    full = hypotheses.full
    strength = (b - hypotheses.level) ** 2 / (2 * uncertainty**2)
    scores = scores - jnp.where(kinds == full, strength, 0.0)
    of_failed = kinds <= DiagnosedKind.DEGRADED
    scores = jnp.where((failed[None] & ~of_failed) | lasting[None], -IMPOSSIBLE, scores)
    best = jnp.max(scores, axis=0)
    actuator = jnp.argmax(best)
    others = jnp.where(jnp.arange(failed.shape[0]) == actuator, -IMPOSSIBLE, best)
    row = jnp.argmax(scores[:, actuator])
    information, pull = evidence.disturbance[0], evidence.disturbance[1:]
    acceleration = pull / jnp.where(information > 0, information, 1.0)
    disturbance = jnp.sum(pull * acceleration) / 2 - PENALTY * pull.shape[0]
    return Explanation(
        actuator,
        kinds[row, 0],
        a[row, actuator],
        b[row, actuator],
        best[actuator],
        best[actuator] - jnp.maximum(jnp.max(others), disturbance),
        aa[actuator],
        best,
        disturbance,
        acceleration,
    )
