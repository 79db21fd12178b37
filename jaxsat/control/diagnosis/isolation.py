"""Which actuator failed, and how: likelihoods of the kinds of failure.

A failed actuator lacks the part a of what was commanded and makes the part b of its full torque all
the time. The kinds are points and lines in the plane of (a, b). Of a thruster:

    dead (1, 0), degraded (s, 0), stuck on (1, 1), stuck at (1, s), leaking (s, s), reversed (2, 0).

Of a reaction wheel b is the part of its full motor torque that brakes the rotor all the time, so
that a motor that drives it on has b = -1:

    dead (1, 0), degraded (s, 0), friction up (0, s), runaway (1, -1).
"""

from collections.abc import Callable
from typing import NamedTuple, Protocol, runtime_checkable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxsat.core.declaration.failures import AbstractFailureKind

RealScalar = Float[Array, ""]

LEAST_PART = 0.02
"""A loss or a leak below this part of full torque is none."""

MOST_FRICTION = 4.0
"""Of the full torque of a motor: what brakes a wheel more counts as this."""


class DiagnosedKind(AbstractFailureKind):
    """Kinds of failure that are told apart; those from `FRICTION_UP` on are of wheels alone."""

    DEAD = 0, "dead", "no torque"
    DEGRADED = 1, "degraded", "a part of the torque that is commanded"
    STUCK_ON = 2, "stuck-on", "full thrust all the time"
    STUCK_AT = 3, "stuck-at", "a part of full thrust all the time"
    LEAKING = 4, "leaking", "never less than a part of full thrust"
    REVERSED = 5, "reversed", "the opposite of the torque that is commanded"
    FRICTION_UP = 6, "friction-up", "the rotor is braked"
    RUNAWAY = 7, "runaway", "full motor torque, which drives the rotor on"
    STOPPED = 8, "stopped", "the rotor stands still"


class Hypotheses(NamedTuple):
    """What may have happened to an actuator.

    `parts` gives the most likely (a, b) of each of `kinds` (kinds, 2, m), from the entries aa, ab
    and bb of the information (3, m), its product with (a, b) (2, m) and the uncertainty of full
    torques.
    Of those that are `free` a number is fitted; the kind `full` makes its full torque, b = `level`
    but for the uncertainty. `tests` are the signs of flow for which there is a CUSUM test, and
    `weak_losses` tells whether small signatures tell of a full loss, too: friction, which holds
    back what little a wheel at rest is commanded, looks like one. An actuator with a failure of a
    kind in `in_service` stays in use, and is diagnosed further.
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


def _thruster_parts(information, weighted, uncertainty) -> Float[Array, "kinds 2 m"]:
    """The most likely (a, b) of every kind; b of one stuck on is full thrust as it really is."""
    aa, ab, bb = information
    y, z = weighted
    one, zero = jnp.ones_like(y), jnp.zeros_like(y)
    lost, stuck = _nearest(y, aa), _nearest(z - ab, bb)
    certain = 1 / uncertainty**2
    fully = (z - ab + certain) / (bb + certain)
    leak = _nearest(y + z, aa + 2 * ab + bb)
    return _stacked(
        (one, zero), (lost, zero), (one, fully), (one, stuck), (leak, leak), (2 * one, zero)
    )


def _wheel_parts(information, weighted, uncertainty) -> Float[Array, "kinds 2 m"]:
    """The same of a wheel; b of a runaway is minus its full torque as it really is."""
    aa, ab, bb = information
    y, z = weighted
    one, zero = jnp.ones_like(y), jnp.zeros_like(y)
    lost, braked = _nearest(y, aa), _nearest(z, bb, MOST_FRICTION)
    certain = 1 / uncertainty**2
    driven = (z - ab - certain) / (bb + certain)
    return _stacked((one, zero), (lost, zero), (zero, braked), (one, driven))


def _nearest(value, weight, most: float = 1.0) -> Float[Array, " m"]:
    quotient = value / jnp.where(weight > 0, weight, 1.0)
    return jnp.clip(quotient, LEAST_PART, most)


def _stacked(*pairs) -> Float[Array, "kinds 2 m"]:
    return jnp.stack([jnp.stack(pair) for pair in pairs])


OF_THRUSTERS = Hypotheses(
    kinds=tuple(range(DiagnosedKind.REVERSED + 1)),
    free=(DiagnosedKind.DEGRADED, DiagnosedKind.STUCK_AT, DiagnosedKind.LEAKING),
    full=DiagnosedKind.STUCK_ON,
    level=1.0,
    parts=_thruster_parts,
)
"""Of thrusters that push."""

OF_WHEELS = Hypotheses(
    kinds=(
        DiagnosedKind.DEAD,
        DiagnosedKind.DEGRADED,
        DiagnosedKind.FRICTION_UP,
        DiagnosedKind.RUNAWAY,
    ),
    free=(DiagnosedKind.DEGRADED, DiagnosedKind.FRICTION_UP, DiagnosedKind.RUNAWAY),
    full=DiagnosedKind.RUNAWAY,
    level=-1.0,
    parts=_wheel_parts,
    tests=(1.0, -1.0),
    weak_losses=False,
    in_service=(DiagnosedKind.DEGRADED, DiagnosedKind.FRICTION_UP),
)
"""Of reaction wheels, whose momenta tell of each alone."""


PENALTY = 3.0
"""Of a free number, in units of log-likelihood, so that the simpler of two kinds wins."""

IMPOSSIBLE = 1e5
"""A log-likelihood below any other."""

UNIT = 1e4
"""Of evidence, which is kept in numbers that are not too large for a state."""

MOST_INFORMATION = 1e5
"""In that unit; what is far beyond doubt is not added up."""


@runtime_checkable
class AnyResidual(Protocol):
    """Innovations in one unit, and the signatures in them of what each actuator may lack or add."""

    @property
    def innovation(self) -> Float[Array, " n"]:
        """What was read less what was expected."""
        ...

    @property
    def variance(self) -> Float[Array, ""] | Float[Array, " m"]:
        """The variance of every innovation, or of each actuator's."""
        ...

    @property
    def loss(self) -> Float[Array, "n m"]:
        """What missing torque leaves in it."""
        ...

    @property
    def flow(self) -> Float[Array, "n m"]:
        """What full torque all the time leaves in it."""
        ...

    @property
    def steady(self) -> Float[Array, ""] | None:
        """What one unit of constant acceleration leaves in it; None where nothing acts besides."""
        ...

    def doubt(self, uncertainty: RealScalar) -> Float[Array, ""] | Float[Array, " m"]:
        """Standard deviation of the innovations if the part `uncertainty` may be a model error."""
        ...


class Evidence(NamedTuple):
    """Of (a, b) of each actuator since an alarm: information matrix, and its product with them.

    `information` has the entries aa, ab and bb, `weighted` those of a and b, over `UNIT`.
    `disturbance` has the same of a constant acceleration besides: information, and three axes.
    """

    information: Float[Array, "3 m"]
    weighted: Float[Array, "2 m"]
    disturbance: Float[Array, "4"]

    @staticmethod
    def none(count: int) -> "Evidence":
        """The evidence before the first residual."""
        return Evidence(jnp.zeros((3, count)), jnp.zeros((2, count)), jnp.zeros(4))

    def after(self, residual: AnyResidual, uncertainty: RealScalar) -> "Evidence":
        """The evidence with one more residual, whose part `uncertainty` may be a model error.

        Evidence beyond any doubt is kept at `MOST_INFORMATION`.
        """
        loss, flow, seen = residual.loss, residual.flow, residual.innovation
        variance = UNIT * residual.doubt(uncertainty) ** 2
        variance = jnp.broadcast_to(variance, loss.shape[1:])[None]
        products = (loss * loss, loss * flow, flow * flow)
        more = jnp.stack([jnp.sum(one, axis=0) for one in products])
        correlation = jnp.stack([jnp.sum(seen[:, None] * one, axis=0) for one in (loss, flow)])
        information = self.information + more / variance
        most = jnp.maximum(jnp.max(information), MOST_INFORMATION)
        scale = MOST_INFORMATION / most
        besides = self.disturbance
        if residual.steady is not None:
            signature = jnp.concatenate([residual.steady[None], seen])
            besides = scale * (besides + residual.steady * signature / variance[0, 0])
        return Evidence(
            scale * information, scale * (self.weighted + correlation / variance), besides
        )


class Explanation(NamedTuple):
    """The actuator that explains the residuals best, the kind, its (a, b), and how well.

    `kind` is a `DiagnosedKind`. `score` is the log-likelihood over that of no failure, `margin` how
    far it is above that of the best other actuator and of a constant torque besides. `tested` is
    the information about a. `scores` has that of each actuator's best explanation, `disturbance`
    that of the constant torque, and `acceleration` (rad/s²) what it does.
    """

    thruster: Int[Array, ""]
    kind: Int[Array, ""]
    loss: RealScalar
    flow: RealScalar
    score: RealScalar
    margin: RealScalar
    tested: RealScalar
    scores: Float[Array, " m"]
    disturbance: RealScalar
    acceleration: Float[Array, "3"]


def explanation(
    evidence: Evidence,
    failed: Bool[Array, " m"],
    lasting: Bool[Array, " m"],
    uncertainty: RealScalar,
    hypotheses: Hypotheses,
) -> Explanation:
    """The best explanation, where full torques are known to within the part `uncertainty`.

    For actuators that have `failed` it is that they work again, in full (`DEAD`, of which a is 1)
    or in part (`DEGRADED`): of what was lost a has come back. Those whose failure is `lasting`
    are no explanation.
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
    thruster = jnp.argmax(best)
    others = jnp.where(jnp.arange(failed.shape[0]) == thruster, -IMPOSSIBLE, best)
    row = jnp.argmax(scores[:, thruster])
    known, pull = evidence.disturbance[0], evidence.disturbance[1:]
    acceleration = pull / jnp.where(known > 0, known, 1.0)
    disturbance = jnp.sum(pull * acceleration) / 2 - PENALTY * pull.shape[0]
    return Explanation(
        thruster,
        kinds[row, 0],
        a[row, thruster],
        b[row, thruster],
        best[thruster],
        best[thruster] - jnp.maximum(jnp.max(others), disturbance),
        aa[thruster],
        best,
        disturbance,
        acceleration,
    )
