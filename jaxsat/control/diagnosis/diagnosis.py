"""Detection of failures by CUSUM, isolation by likelihood, and recovery of actuators.

The one-sided CUSUM test of standard normal scores is g' = max(0, g + z - k), an alarm where g' > h.
Its average run length has a closed form (Siegmund, Sequential Analysis (1985), section 2.6): the
walk's overshoot over a boundary is 0.583 on average, at either end.
"""

import enum
import math
from typing import Annotated, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxsat.control.diagnosis.isolation import (
    ALIKE,
    NONE,
    PENALTY,
    Diagnosed,
    DiagnosedKind,
    Evidence,
    Hypotheses,
    Residual,
    explanation,
)
from jaxsat.control.diagnosis.residual import (
    AbstractResidualFilter,
    ActuatorCondition,
    FilterMemory,
    Reading,
)
from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar
from jaxsat.core.checks import positive

OVERSHOOT = 1.166
"""Overshoot of a walk with standard normal steps, at both boundaries together."""

SMALL = 1e-6
"""Drift below which the series replaces the quotient."""


def average_run_length(reference: float, threshold: float, shift: float = 0.0) -> float:
    """Return the mean number of scores N(shift, 1) until an alarm, k and h in their sigmas.

    Without a shift it is the mean distance of false alarms, else the detection delay.
    """
    drift, width = shift - reference, threshold + OVERSHOOT
    if abs(drift) < SMALL:
        return width**2
    return (math.expm1(-2 * drift * width) + 2 * drift * width) / (2 * drift**2)


def cusum_threshold(reference: float, run_length: float) -> float:
    """Return the threshold h for a mean distance of false alarms, in scores; k and h in sigmas.

    Raises `ValueError` for a distance that even h = 0 exceeds.
    """
    if not average_run_length(reference, 0.0) < run_length < math.inf:
        raise ValueError(
            "Argument `run_length` must be finite and above that of the threshold 0, "
            f"{average_run_length(reference, 0.0):.3g}, but got {run_length}."
        )
    low, high = 0.0, 1.0
    while average_run_length(reference, high) < run_length:
        high *= 2
    for _ in range(60):
        middle = (low + high) / 2
        short = average_run_length(reference, middle) < run_length
        low, high = (middle, high) if short else (low, middle)
    return high


def false_alarm_rate(watch: AbstractResidualFilter, reference: float, threshold: float) -> float:
    """Upper limit of false alarms per sample by all tests if the model is true; both in sigmas.

    A likelihood ratio exceeds e^x at most once in e^x samples (Lorden, Ann. Math. Stat. 42, 1971).
    """
    hypotheses = watch.hypotheses
    rate = (1 + len(hypotheses.tests)) / average_run_length(reference, threshold)
    rate += hypotheses.weak_losses * math.exp(-2 * reference * threshold)
    return watch.count * rate


LEAST_SIGNAL = 0.5
"""Signature of a full failure, in sigmas, below which its test waits."""

LEAST_INFORMATION, MOST_PERIODS = 25.0, 15
"""Information about a loss for a verdict (that of a test pulse), or periods after which it is due.
"""

WEAK = 0.1
"""Fraction of its torque below which an actuator counts as dead."""

TOLD_APART = 2 * PENALTY / WEAK**2
"""Information about the loss of an actuator that separates a dead one from a `WEAK` one."""

MOST_RETURNS = 2
"""Recoveries after which an actuator that fails once more is not trusted again."""


class Stage(enum.IntEnum):
    """Stage of the diagnosis: nothing suspected, or an alarm whose cause is being isolated."""

    QUIET = 0
    ALARM = 1


class DiagnosisMemory(NamedTuple):
    """Verdicts on each actuator, and the state of the tests.

    `statistic` (tests, m) has the CUSUMs of loss, of flow for each sign that it may have, and of a
    full loss. `condition` and `kind` (`Diagnosed`) are the verdicts, `returns` counts
    recoveries. `age` (s) is the time since the last alarm, verdict or dismissal. `suspect` is the
    actuator whose test raised the alarm, once there is evidence the likeliest, and `rival` marks
    those that explain the residuals nearly as well. `doubt` (in the residuals' unit) is the
    standard deviation of the last residual, model errors included.
    """

    residual: FilterMemory
    doubt: Float[Array, " k"]
    statistic: Float[Array, "tests m"]
    stage: Annotated[IntScalar, Stage]
    age: RealScalar
    evidence: Evidence
    suspect: IntScalar
    rival: Bool[Array, " m"]
    condition: ActuatorCondition
    kind: Annotated[Int[Array, " m"], Diagnosed]
    returns: Float[Array, " m"]

    @property
    def alarmed(self) -> BoolScalar:
        """Whether the cause of an alarm is being isolated."""
        return self.stage == Stage.ALARM

    @property
    def may_return(self) -> Bool[Array, " m"]:
        """Failed actuators that return to service once their torque reappears."""
        return self.condition.failed & (self.returns < MOST_RETURNS)

    def test_command(self, watch: AbstractResidualFilter, period: RealScalar) -> Float[Array, " m"]:
        """Return commands of test pulses in a period (s) that stand out of the noise.

        During an alarm they stand out of all that is in doubt: flow of a stuck actuator hides
        pulses that would be seen without it.
        """
        sigma = jnp.where(self.alarmed, self.doubt, watch.noise)
        return watch.test_command(period, sigma)


class Diagnosis(eqx.Module):
    """Detection and isolation of failed actuators of one kind, and of those that recover.

    Measurements and failure hypotheses are those of a filter, the `watch`. Torques are assumed to
    be wrong by the fraction `uncertainty`, and moments of inertia with them; what such errors leave
    beyond `reference` counts neither as flow nor as a full loss. Each thruster has three CUSUM
    tests: missing thrust, thrust that was not commanded, and thrust missing in full; a wheel lacks
    the third, and has one for each sign of the second. The scores of the first two are standard
    normal where nothing has failed and the model is true, so that `average_run_length` of
    `reference` and `threshold` (both in sigmas) is the mean number of samples to a false alarm of
    each; that of the third is at least e^(2 reference threshold). From the alarm on the evidence is
    gathered anew. At an alarm for a flow the filter restarts, too: its signature would be that of a
    flow which has always been there. The best explanation is the verdict once its log-likelihood
    exceeds that of no failure, that of any other actuator, and that of a constant external torque,
    by `margin`; if such a torque is the best, it is compensated from then on. After `patience`
    samples the more likely of two actuators is taken, an external torque rather than an actuator
    that is hardly more likely, and an alarm that nothing explains is dismissed. A failed actuator
    whose commanded torque is there again returns to service, at most `MOST_RETURNS` times.
    """

    reference: RealScalar = eqx.field(converter=positive("reference"), default=1.0)
    threshold: RealScalar = eqx.field(converter=positive("threshold"), default=12.0)
    margin: RealScalar = eqx.field(converter=positive("margin"), default=8.0)
    patience: RealScalar = eqx.field(converter=positive("patience"), default=300.0)
    uncertainty: RealScalar = eqx.field(converter=positive("uncertainty"), default=0.1)

    def init(self, watch: AbstractResidualFilter, reading: Reading) -> DiagnosisMemory:
        """Return the memory at the start: all actuators work."""
        count, hypotheses = watch.count, watch.hypotheses
        tests = 1 + len(hypotheses.tests) + hypotheses.weak_losses
        zero = jnp.zeros(count, reading.rate.dtype)
        return DiagnosisMemory(
            watch.init(reading),
            watch.noise,
            jnp.zeros((tests, count), zero.dtype),
            jnp.array(int(Stage.QUIET)),
            zero[0],
            Evidence.none(count),
            jnp.array(0),
            zero >= 0,
            ActuatorCondition.sound(count),
            jnp.full(count, NONE, int),
            zero,
        )

    def step(
        self,
        watch: AbstractResidualFilter,
        reading: Reading,
        commanded: Float[Array, " m"],
        period: RealScalar,
        memory: DiagnosisMemory,
        needed: Bool[Array, " m"] | None = None,
    ) -> DiagnosisMemory:
        """Update by a reading and by what was `commanded` since the last, as `watch` reads it.

        Those that are `needed` must be shown to be dead, not `WEAK`, before they are given up.
        """
        needed = jnp.zeros_like(memory.condition.failed) if needed is None else needed
        condition = memory.condition
        hypotheses = watch.hypotheses
        residual, filtered = watch.step(
            reading, commanded, condition, period, memory.residual, self.uncertainty
        )
        statistic = self._statistic(watch.hypotheses, residual, memory)
        alarmed = memory.alarmed
        evidence = memory.evidence.after(residual, self.uncertainty)
        evidence = jax.tree.map(lambda x: jnp.where(alarmed, x, 0.0), evidence)
        lasting = condition.failed & ~memory.may_return
        best = explanation(evidence, condition.failed, lasting, self.uncertainty, hypotheses)
        age = memory.age + period
        late = age > self.patience * period
        tested = (best.tested > LEAST_INFORMATION) | (age > MOST_PERIODS * period)
        flows = best.kind > DiagnosedKind.DEGRADED
        tested = tested & (flows | ~needed[best.actuator] | (best.tested > TOLD_APART))
        sure = (best.margin > self.margin) & tested
        ahead = best.score - best.disturbance
        verdict = alarmed & (best.score > self.margin) & (sure | (late & (ahead > self.margin)))
        disturbed = alarmed & ~verdict & (best.disturbance > self.margin)
        disturbed = disturbed & ((ahead < -self.margin) | late)
        over = verdict | disturbed | (alarmed & late)
        largest = jnp.max(statistic, axis=1)
        alarm = ~alarmed & (jnp.max(largest) > self.threshold)
        flows_most = jnp.max(largest[1 : 1 + len(hypotheses.tests)]) == jnp.max(largest)
        anew = alarm & (watch.restarts_at_losses | flows_most)
        hit = verdict & (jnp.arange(lasting.shape[0]) == best.actuator)
        fails = hit & ~condition.failed
        whole = best.kind == DiagnosedKind.DEAD
        serves = jnp.isin(best.kind, jnp.array(hypotheses.in_service, int))
        comes_back = hit & condition.failed & (whole | serves)
        tracked = watch.tracked(residual, condition, period, ~alarmed & ~alarm)
        back = condition.part + best.loss * (1 - condition.part)
        left = jnp.where(fails, condition.part * (1 - best.loss), back)
        flow = jnp.where(comes_back, 0.0, tracked.flow)
        judged = ActuatorCondition(
            (condition.failed | (fails & ~serves)) & ~comes_back,
            jnp.where(hit, left, tracked.part),
            jnp.where(fails, condition.flow + best.flow, flow),
            tracked.torque + jnp.where(disturbed, watch.torque_of(best.acceleration), 0.0),
            jnp.where(disturbed, 0.0, tracked.samples),
        )
        rival = best.scores > best.score - self.margin
        held = rival[memory.suspect] & (best.score < self.margin)
        suspect = jnp.where(held, memory.suspect, best.actuator)
        named = watch.named(best.kind, best.actuator, filtered).astype(memory.kind.dtype)
        return DiagnosisMemory(
            filtered._replace(started=filtered.started & ~(verdict | disturbed | anew)),
            residual.doubt(self.uncertainty),
            jnp.where(over | alarm, 0.0, statistic),
            jnp.where(over, int(Stage.QUIET), jnp.where(alarm, int(Stage.ALARM), memory.stage)),
            jnp.where(over | alarm, 0.0, age),
            evidence,
            jnp.where(alarm, jnp.argmax(jnp.max(statistic, axis=0)), suspect),
            rival,
            judged,
            jnp.where(comes_back & whole, NONE, jnp.where(hit, named, memory.kind)),
            memory.returns + comes_back.astype(memory.returns.dtype),
        )

    def _statistic(
        self, hypotheses: Hypotheses, residual: Residual, memory: DiagnosisMemory
    ) -> Float[Array, "tests m"]:
        """Update the CUSUMs, which wait during an alarm and where a signature is too small.

        With `weak_losses` the last is the likelihood ratio of a full loss, for which no signature
        is too small, over twice the reference: the first one where the signature has that size.
        """
        signs, weak_losses = hypotheses.tests, hypotheses.weak_losses
        signatures = jnp.stack([residual.loss, *(sign * residual.flow for sign in signs)])
        squares = jnp.sum(signatures**2, axis=1)
        size = jnp.sqrt(squares)
        sigma = jnp.broadcast_to(jnp.sqrt(residual.variance), size.shape)
        is_visible = size > LEAST_SIGNAL * sigma
        along = jnp.sum(signatures * residual.innovation[None], axis=1)
        excess = _left_by_errors(residual, signatures) - self.reference * size * sigma
        less = along - jnp.maximum(excess, 0.0)
        score = along.at[1:].set(less[1:]) / (jnp.where(is_visible, size, 1.0) * sigma)
        gain = score - self.reference
        of_flow = (jnp.arange(1 + len(signs)) > 0)[:, None]
        failed, many = memory.condition.failed, memory.returns >= MOST_RETURNS
        untested = failed[None] & (of_flow | many[None])
        tested = is_visible & ~untested
        if weak_losses:
            ratio = (less[:1] - squares[:1] / 2) / (2 * self.reference * sigma[:1] ** 2)
            gain = jnp.concatenate([gain, ratio])
            tested = jnp.concatenate([tested, ~failed[None]])
        after = jnp.maximum(memory.statistic + gain, 0.0)
        return jnp.where(tested & (memory.stage == Stage.QUIET), after, memory.statistic)


def _left_by_errors(
    residual: Residual, signatures: Float[Array, "tests n m"]
) -> Float[Array, "tests m"]:
    """Return what errors of the model leave along signatures x: of torques by their root sum of
    squares √(xᵀ Σ e eᵀ x), of the last `ALIKE` numbers all with the same sign."""
    alone, alike = residual.errors[:-ALIKE], residual.errors[-ALIKE:]
    spread = jnp.sum(alone[:, :, None] * alone[:, None], axis=0)
    squares = jnp.sum(signatures * jnp.sum(spread[None] * signatures[:, None], axis=2), axis=1)
    same = jnp.sum(jnp.abs(jnp.sum(signatures[None] * alike[:, None], axis=2)), axis=0)
    return jnp.sqrt(jnp.maximum(squares, 0.0)) + same
