"""Effectiveness of magnetorquers, by the momentum of body and wheels.

A magnetorquer lacks the fraction a of its dipole, and is turned from its axis e by a small vector
g across. With a dipole m and a torque d of the body besides, all constant, the momentum that the
commands do not explain is, over an interval,

    ΔH = Σ (g_i - a_i e_i) × ∫ m_i B dt + m × ∫ B dt + d T,

linear in a, g, m and d: a Kalman filter of these. A stuck magnetorquer has a = 1, and its dipole is
a part of m. Torques of wheels are internal, and change nothing.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsat.control.diagnosis.diagnosis import MOST_RETURNS, WEAK, Diagnosis
from jaxsat.control.diagnosis.isolation import PENALTY
from jaxsat.core.array_types import BoolScalar, RealScalar, Vector
from jaxsat.core.checks import as_float, positive
from jaxsat.core.quotients import SMALLEST, length
from jaxsat.core.trees import Symmetric
from jaxsat.spacecraft.dynamics import RigidBody

INTERVAL = 0.01
"""Time between corrections, over the orbital period: the field turns by 0.1 rad."""

WALK = (0.005, 0.003, 0.004, 0.0)
"""Random walk of losses, dipole, torque and turns in an interval, over their first standard
deviations: a mounting does not change."""

UNTOLD = 0.02
"""Torque that nothing explains, over ω0² J with the mean moment of inertia."""

TURNED = 0.03
"""Standard deviation (rad) of the turn of a magnetorquer about each direction across, by its
mounting."""

ROUGH = 0.01
"""Relative error of the torque of each magnetorquer, by the field."""

DOUBTED = 0.5
"""Standard deviation of the loss of a magnetorquer that works, over the error of the model, and of
any loss beyond which it is on trial."""

IMPOSSIBLE = 30.0
"""Squares of innovations over their variances at first, beyond which something else acts."""

Columns = Float[Array, "3 k"]


class RodInterval(NamedTuple):
    """Sums of an interval: `age` (s); `momentum` (N m s) that commands do not explain; the command
    of each magnetorquer times the field, `driven` (A m² T s); the `field` (T s); the impulses that
    may be wrong by the fraction of model errors, `doubtful` (N m s); and the rate (rad/s) at its
    beginning."""

    age: RealScalar
    momentum: Vector
    driven: Columns
    field: Vector
    doubtful: RealScalar
    first: Vector

    @staticmethod
    def begin(rate: Vector, count: int) -> "RodInterval":
        """Return an interval that begins at a rate (rad/s)."""
        none = jnp.zeros_like(rate)
        return RodInterval(none[0], none, jnp.zeros((3, count)), none, none[0], rate)


class RodFitMemory(NamedTuple):
    """Estimates of losses, dipole, torque and turns, each over its standard deviation at first;
    their covariance; rate and momentum at the last sample, valid once `started`; the interval;
    the verdicts: which magnetorquers `failed`, and the `part` of its dipole that each makes; the
    `sense` of trial dipoles until the next correction, zero while all losses are known; and how
    often each that was given up came back, `returns`."""

    estimate: Float[Array, " n"]
    covariance: Symmetric
    rate: Vector
    momentum: Vector
    started: BoolScalar
    interval: RodInterval
    failed: Bool[Array, " k"]
    part: Float[Array, " k"]
    sense: RealScalar
    returns: Float[Array, " k"]

    @property
    def tested(self) -> Bool[Array, " k"]:
        """Those given up which return to service once their dipole reappears."""
        return (self.part == 0) & (self.returns < MOST_RETURNS)


class Outside(NamedTuple):
    """Mean torque (N m) of thrusters since the last sample, and whether it is known: `quiet`."""

    thrust: Vector
    quiet: BoolScalar


class RodSample(NamedTuple):
    """What a sample gives: rate (rad/s), `momentum` of body and wheels (N m s, body axes), `field`
    (T), the mean of each command times the field since the last sample, `driven` (A m² T), the
    torque that is `known` from the model (N m), and what thrusters do."""

    rate: Vector
    momentum: Vector
    field: Vector
    driven: Columns
    known: Vector
    outside: Outside


class RodFit(eqx.Module):
    """A Kalman filter of losses and turns of magnetorquers, a dipole and a torque of the body.

    Magnetorquers are along unit `axes`, with two unit vectors `across` each. `model` is the law's
    model of body and known torques, `noise` (N m s) the standard deviation of a momentum about an
    axis, `dipole` (A m²) the mean dipole limit, `strength` (T) the mean field and `span` (s) the
    interval between corrections. A magnetorquer has failed once its loss a exceeds the error u of
    the model (`uncertainty`) with the evidence (|a| - u)² / 2σ² - `PENALTY` above 2kh, as for the
    losses of thrusters: by chance at most once in e^2kh intervals. A loss is estimated as if all
    others that work made their dipoles if this explains the sums, by the `margin` of the diagnosis,
    better than any other loss alone: dipoles along the field show only how losses differ. An
    interval that the variances do not allow, with as much evidence, makes all states unknown again:
    something has failed at once. One that even this does not explain has another cause. While a
    loss is doubtful, even with the others zero, trial dipoles change sign from interval to
    interval. One that was given up returns to service once the part 1 - a that it makes is as
    evident, at most `MOST_RETURNS` times.
    """

    axes: Float[Array, "3 k"] = eqx.field(converter=as_float)
    across: Float[Array, "2 3 k"] = eqx.field(converter=as_float)
    model: RigidBody
    noise: RealScalar = eqx.field(converter=positive("noise"))
    dipole: RealScalar = eqx.field(converter=positive("dipole"))
    strength: RealScalar = eqx.field(converter=positive("strength"))
    span: RealScalar = eqx.field(converter=positive("span"))

    @property
    def count(self) -> int:
        """Number of magnetorquers."""
        return self.axes.shape[1]

    def init(self, rate: Vector) -> RodFitMemory:
        """Return the memory at the start: all magnetorquers work."""
        none, size = jnp.zeros_like(rate), 3 * self.count + 6
        return RodFitMemory(
            jnp.zeros(size),
            Symmetric(jnp.eye(size)),
            none,
            none,
            jnp.array(False),
            RodInterval.begin(none, self.count),
            jnp.zeros(self.count) > 0,
            jnp.ones(self.count),
            jnp.ones_like(none[0]),
            jnp.zeros(self.count),
        )

    def false_alarm_rate(self, reference: float, threshold: float, period: float) -> float:
        """Upper limit of false verdicts per sample; `reference` and `threshold` in sigmas."""
        samples = max(float(self.span) / period, 1.0)
        return self.count * math.exp(-2 * reference * threshold) / samples

    def body_dipole(self, memory: RodFitMemory) -> tuple[Vector, Vector]:
        """Return the dipole (A m²) of body and stuck magnetorquers, and its standard deviations."""
        body = slice(self.count, self.count + 3)
        variances = jnp.diagonal(memory.covariance.matrix)[body]
        return self.dipole * memory.estimate[body], self.dipole * jnp.sqrt(variances)

    def turns(self, memory: RodFitMemory) -> Columns:
        """Return the vectors by which magnetorquers are turned from their axes."""
        first, second = memory.estimate[self.count + 6 :].reshape(2, self.count)
        return TURNED * (self.across[0] * first[None] + self.across[1] * second[None])

    def step(
        self, sample: RodSample, period: RealScalar, memory: RodFitMemory, diagnosis: Diagnosis
    ) -> RodFitMemory:
        """Return the memory after one more sample."""
        goes_on = memory.started & sample.outside.quiet
        interval = self._longer(sample, period, memory)
        fresh = RodInterval.begin(sample.rate, self.count)
        interval = jax.tree.map(lambda x, y: jnp.where(goes_on, x, y), interval, fresh)
        memory = memory._replace(
            rate=sample.rate,
            momentum=sample.momentum,
            started=jnp.array(True),
            interval=interval,
        )
        return jax.lax.cond(
            interval.age >= self.span,
            lambda: self._judged(self._corrected(memory, diagnosis), diagnosis)._replace(
                interval=fresh
            ),
            lambda: memory,
        )

    def _longer(self, sample: RodSample, period: RealScalar, memory: RodFitMemory) -> RodInterval:
        """Return the interval with the period (s) that ends with a sample."""
        before = memory.interval
        rate, momentum = (sample.rate + memory.rate) / 2, (sample.momentum + memory.momentum) / 2
        rods = jnp.sum(jnp.cross(self.axes, sample.driven, axis=0), axis=1)
        torque = rods + sample.outside.thrust + sample.known
        change = sample.momentum - memory.momentum + period * (jnp.cross(rate, momentum) - torque)
        turned = jnp.cross(rate, self.model.spacecraft.inertia @ rate)
        doubtful = length(sample.outside.thrust) + length(sample.known) + length(turned)
        return RodInterval(
            before.age + period,
            before.momentum + change,
            before.driven + period * sample.driven,
            before.field + period * sample.field,
            before.doubtful + period * doubtful,
            before.first,
        )

    def _corrected(self, memory: RodFitMemory, diagnosis: Diagnosis) -> RodFitMemory:
        """Return the memory with the equations of an interval."""
        one = memory.interval
        unit = self.model.spacecraft.momentum_unit
        doubtful = one.doubtful + unit * length(memory.rate - one.first)
        least = UNTOLD * self.model.orbit.rate**2 * unit * one.age
        squares = (diagnosis.uncertainty * doubtful) ** 2 + least**2
        squares = squares + ROUGH**2 * jnp.sum(jnp.cross(self.axes, one.driven, axis=0) ** 2)
        variance = 2 * self.noise**2 + squares / 3  # about each axis
        sigma = jnp.sqrt(variance)
        dipole = jnp.cross(jnp.eye(3), self.dipole * one.field[:, None], axis=0)
        torque = self.dipole * self.strength * one.age * jnp.eye(3)
        losses = -jnp.cross(self.axes, one.driven, axis=0)
        turns = [TURNED * jnp.cross(across, one.driven, axis=0) for across in self.across]
        rows = jnp.concatenate([losses, dipole, torque, *turns], axis=1) / sigma
        read = one.momentum / sigma
        walk = jnp.repeat(jnp.array(WALK), np.array([self.count, 3, 3, 2 * self.count]))
        unknown = jnp.eye(3 * self.count + 6)
        covariance = memory.covariance.matrix + jnp.diag(walk**2)
        surprise, usual = _updated(memory.estimate, covariance, rows, read)
        known = surprise < 2 * self._evidence(diagnosis)
        wonder, (estimate, covariance) = jax.lax.cond(
            known,
            lambda: (jnp.zeros_like(surprise), usual),
            lambda: _updated(memory.estimate, unknown, rows, read),
        )
        believed = wonder < IMPOSSIBLE
        return memory._replace(
            estimate=jnp.where(believed, estimate, memory.estimate),
            covariance=Symmetric(jnp.where(believed, covariance, memory.covariance.matrix)),
        )

    def _evidence(self, diagnosis: Diagnosis) -> RealScalar:
        return 2 * diagnosis.reference * diagnosis.threshold

    def _alone(
        self, memory: RodFitMemory, error: RealScalar
    ) -> tuple[Float[Array, " k"], Float[Array, " k"], Float[Array, " k"]]:
        """Return the loss of each if all others that work lack nothing, its variance, and how ill
        that fits: the squares over variances of what the others lack."""
        count, each = self.count, jnp.arange(self.count)
        before = memory.estimate[:count], memory.covariance.matrix[:count, :count]

        def alone(number):
            own = each == number
            works = jnp.diag(jnp.where(memory.failed | own, 0.0, 1 / (DOUBTED * error)))
            misfit, (loss, covariance) = _updated(*before, works, jnp.zeros(count))
            loss, variance = (jnp.where(own, x, 0.0) for x in (loss, jnp.diagonal(covariance)))
            return jnp.sum(loss), jnp.sum(variance) + SMALLEST, misfit

        return jax.lax.map(alone, each)

    def _judged(self, memory: RodFitMemory, diagnosis: Diagnosis) -> RodFitMemory:
        """Return the memory with the verdicts."""
        error = diagnosis.uncertainty
        alone, least, misfit = self._alone(memory, error)
        behind = (misfit[None] > misfit[:, None] + 2 * diagnosis.margin) | (alone <= 0)[None]
        behind = jnp.all(behind | jnp.eye(self.count, dtype=bool), axis=1)
        fits = misfit < 2 * diagnosis.margin
        likeliest = jnp.where(memory.failed, fits, (alone > 0) & behind)
        variance = jnp.diagonal(memory.covariance.matrix)[: self.count] + SMALLEST
        loss = jnp.where(likeliest, alone, memory.estimate[: self.count])
        variance = jnp.where(likeliest, least, variance)
        evidence = PENALTY + self._evidence(diagnosis)
        beyond = jnp.maximum(jnp.abs(loss) - error, 0.0)
        proven = beyond**2 / (2 * variance) > evidence
        known = variance < error**2
        returned = memory.tested & ((1 - loss) ** 2 / (2 * variance) > evidence)
        lost = (memory.part == 0) & ~returned
        failed = lost | proven | (memory.failed & ~(known & (beyond == 0)))
        part = jnp.clip(1 - loss, -1.0, 1.0)
        part = jnp.where(jnp.abs(part) < WEAK, 0.0, part)
        part = jnp.where(lost, 0.0, jnp.where(proven | known | returned, part, memory.part))
        part = jnp.where(failed, part, 1.0)
        returned = jnp.where(returned & (part != 0), 1.0, 0.0)
        unknown = jnp.concatenate([returned, jnp.zeros(2 * self.count + 6)])
        doubted = jnp.any(least > (DOUBTED * error) ** 2)
        sense = jnp.where(doubted, jnp.where(memory.sense > 0, -1.0, 1.0), 0.0)
        return memory._replace(
            covariance=Symmetric(memory.covariance.matrix + jnp.diag(unknown)),
            failed=failed,
            part=part,
            sense=sense,
            returns=memory.returns + returned,
        )


def across(axes: Float[np.ndarray, "3 k"]) -> Float[np.ndarray, "2 3 k"]:
    """Return two unit vectors across each unit axis, and across each other."""
    first = np.cross(axes, np.eye(3)[:, np.argmin(np.abs(axes), axis=0)], axis=0)
    first = first / np.linalg.norm(first, axis=0)
    return np.stack([first, np.cross(axes, first, axis=0)])


def _updated(
    estimate: Float[Array, " n"],
    covariance: Float[Array, "n n"],
    rows: Float[Array, "m n"],
    read: Float[Array, " m"],
) -> tuple[RealScalar, tuple[Float[Array, " n"], Float[Array, "n n"]]]:
    """Return the squares of innovations, of noise 1, over their variances, and estimate and
    covariance after them."""

    def also(number, before):
        squares, estimate, covariance = before
        row = rows[number]
        projected = jnp.sum(covariance * row[None, :], axis=1)
        variance = 1 + jnp.sum(row * projected)
        innovation = read[number] - jnp.sum(row * estimate)
        return (
            squares + innovation**2 / variance,
            estimate + projected * (innovation / variance),
            covariance - projected[:, None] * projected[None, :] / variance,
        )

    first = (jnp.zeros_like(read[0]), estimate, covariance)
    squares, *after = jax.lax.fori_loop(0, len(rows), also, first)
    return squares, (after[0], after[1])
