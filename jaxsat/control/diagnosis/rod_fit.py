"""Effectiveness of magnetorquers, by the momentum of body and wheels.

A magnetorquer lacks the fraction a of its dipole. With a dipole m and a torque d of the body
besides, both constant, the momentum that the commands do not explain is, over an interval,

    ΔH = -Σ a_i ∫ e_i × B m_i dt + m × ∫B dt + d T,

linear in a, m and d: a Kalman filter of these. A stuck magnetorquer has a = 1, and its dipole is
a part of m. Torques of wheels are internal, and change nothing.
"""

import math
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsat.control.diagnosis.diagnosis import WEAK, Diagnosis
from jaxsat.control.diagnosis.isolation import PENALTY
from jaxsat.core.array_types import BoolScalar, RealScalar, Vector
from jaxsat.core.checks import positive
from jaxsat.core.quotients import SMALLEST, length
from jaxsat.core.trees import Symmetric
from jaxsat.spacecraft.dynamics import RigidBody

INTERVAL = 0.01
"""Time between corrections, over the orbital period: the field turns by 0.1 rad."""

WALK = (0.005, 0.003, 0.004)
"""Random walk of losses, dipole and torque in an interval, over their first standard deviations."""

UNTOLD = 0.02
"""Torque that nothing explains, over ω0² J with the mean moment of inertia."""

TURNED = 0.03
"""Relative error of the torques of all magnetorquers, by their mounting and the field."""

SURE = 0.1
"""Standard deviation of the dipole of the body, over that at first, below which it is known."""

DOUBTED = 0.5
"""Standard deviation of a loss, over the error of the model, above which it is on trial."""

IMPOSSIBLE = 30.0
"""Squares of innovations over their variances at first, beyond which something else acts."""

Columns = Float[Array, "3 k"]


class RodInterval(NamedTuple):
    """Sums of an interval: `age` (s); `momentum` (N m s) that commands do not explain; impulses of
    each magnetorquer (N m s) as commanded; the `field` (T s); the impulses that may be wrong by the
    fraction of model errors, `doubtful` (N m s); and the rate (rad/s) at its beginning."""

    age: RealScalar
    momentum: Vector
    impulses: Columns
    field: Vector
    doubtful: RealScalar
    first: Vector

    @staticmethod
    def begin(rate: Vector, count: int) -> "RodInterval":
        """Return an interval that begins at a rate (rad/s)."""
        none = jnp.zeros_like(rate)
        return RodInterval(none[0], none, jnp.zeros((3, count)), none, none[0], rate)


class RodFitMemory(NamedTuple):
    """Estimates of losses, dipole and torque, each over its standard deviation at first; their
    covariance; rate and momentum at the last sample, valid once `started`; the present interval;
    the verdicts: which magnetorquers `failed`, and the `part` of its dipole that each makes; and
    the `sense` of trial dipoles until the next correction, zero while all losses are known."""

    estimate: Float[Array, " n"]
    covariance: Symmetric
    rate: Vector
    momentum: Vector
    started: BoolScalar
    interval: RodInterval
    failed: Bool[Array, " k"]
    part: Float[Array, " k"]
    sense: RealScalar


class Outside(NamedTuple):
    """Mean torque (N m) of thrusters since the last sample, and whether it is known: `quiet`."""

    thrust: Vector
    quiet: BoolScalar


class RodSample(NamedTuple):
    """What a sample gives: rate (rad/s), `momentum` of body and wheels (N m s, body axes), `field`
    (T), the mean torque (N m) of each magnetorquer since the last sample by its command, that which
    is `known` from the model, and what thrusters do."""

    rate: Vector
    momentum: Vector
    field: Vector
    rods: Columns
    known: Vector
    outside: Outside


class RodFit(eqx.Module):
    """A Kalman filter of the losses of magnetorquers, and of a dipole and a torque of the body.

    `model` is the law's model of body and known torques, `noise` (N m s) the standard deviation of
    a momentum about an axis, `dipole` (A m²) the mean dipole limit, `strength` (T) the mean field
    and `span` (s) the interval between corrections. A magnetorquer has failed once its loss a
    exceeds the error u of the model (`uncertainty`) with the evidence (|a| - u)² / 2σ² - `PENALTY`
    above 2kh, as for the losses of thrusters: by chance at most once in e^2kh intervals. An
    interval that the variances do not allow, with as much evidence, makes all states unknown again:
    something has failed at once. One that even this does not explain has another cause. While a
    loss is doubtful, trial dipoles change sign from interval to interval.
    """

    count: int = eqx.field(static=True)
    model: RigidBody
    noise: RealScalar = eqx.field(converter=positive("noise"))
    dipole: RealScalar = eqx.field(converter=positive("dipole"))
    strength: RealScalar = eqx.field(converter=positive("strength"))
    span: RealScalar = eqx.field(converter=positive("span"))

    def init(self, rate: Vector) -> RodFitMemory:
        """Return the memory at the start: all magnetorquers work."""
        none, size = jnp.zeros_like(rate), self.count + 6
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
        )

    def false_alarm_rate(self, reference: float, threshold: float, period: float) -> float:
        """Upper limit of false verdicts per sample; `reference` and `threshold` in sigmas."""
        samples = max(float(self.span) / period, 1.0)
        return self.count * math.exp(-2 * reference * threshold) / samples

    def body_dipole(self, memory: RodFitMemory) -> tuple[Vector, BoolScalar]:
        """Return the dipole (A m²) of body and stuck magnetorquers, and whether it is known."""
        body = slice(self.count, self.count + 3)
        variances = jnp.diagonal(memory.covariance.matrix)[body]
        return self.dipole * memory.estimate[body], jnp.all(variances < SURE**2)

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
        torque = jnp.sum(sample.rods, axis=1) + sample.outside.thrust + sample.known
        change = sample.momentum - memory.momentum + period * (jnp.cross(rate, momentum) - torque)
        turned = jnp.cross(rate, self.model.spacecraft.inertia @ rate)
        doubtful = length(sample.outside.thrust) + length(sample.known) + length(turned)
        return RodInterval(
            before.age + period,
            before.momentum + change,
            before.impulses + period * sample.rods,
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
        squares = squares + TURNED**2 * jnp.sum(one.impulses**2)
        variance = 2 * self.noise**2 + squares / 3  # about each axis
        sigma = jnp.sqrt(variance)
        x, y, z = one.field * self.dipole
        zero = jnp.zeros_like(x)
        turned = jnp.stack(
            [jnp.stack(row) for row in ((zero, z, -y), (-z, zero, x), (y, -x, zero))]
        )
        torque = self.dipole * self.strength * one.age * jnp.eye(3)
        rows = jnp.concatenate([-one.impulses, turned, torque], axis=1) / sigma
        read = one.momentum / sigma
        walk = jnp.repeat(jnp.array(WALK), np.array([self.count, 3, 3]))
        unknown = jnp.eye(self.count + 6)
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

    def _judged(self, memory: RodFitMemory, diagnosis: Diagnosis) -> RodFitMemory:
        """Return the memory with the verdicts."""
        error = diagnosis.uncertainty
        loss = memory.estimate[: self.count]
        variance = jnp.diagonal(memory.covariance.matrix)[: self.count] + SMALLEST
        beyond = jnp.maximum(jnp.abs(loss) - error, 0.0)
        proven = beyond**2 / (2 * variance) - PENALTY > self._evidence(diagnosis)
        known = variance < error**2
        failed = proven | (memory.failed & ~(known & (beyond == 0)))
        part = jnp.clip(1 - loss, -1.0, 1.0)
        part = jnp.where(jnp.abs(part) < WEAK, 0.0, part)
        part = jnp.where(proven | known, part, memory.part)
        doubted = jnp.any(variance > (DOUBTED * error) ** 2)
        sense = jnp.where(doubted, jnp.where(memory.sense > 0, -1.0, 1.0), 0.0)
        return memory._replace(failed=failed, part=jnp.where(failed, part, 1.0), sense=sense)


def _updated(
    estimate: Float[Array, " n"],
    covariance: Float[Array, "n n"],
    rows: Float[Array, "3 n"],
    read: Vector,
) -> tuple[RealScalar, tuple[Float[Array, " n"], Float[Array, "n n"]]]:
    """Return the squares of three innovations, of noise 1, over their variances, and estimate and
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
    squares, *after = jax.lax.fori_loop(0, 3, also, first)
    return squares, (after[0], after[1])
