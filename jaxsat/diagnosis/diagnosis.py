"""Detection by CUSUM, isolation by likelihood, and how an actuator comes back."""

import enum
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int

from jaxsat.checks import as_float, require_positive
from jaxsat.diagnosis.isolation import PENALTY, DiagnosedKind, Evidence, explanation
from jaxsat.diagnosis.residual import Condition, Residual, ResidualFilter, ResidualMemory

RealScalar = Float[Array, ""]

LEAST_SIGNAL = 0.5
"""A signature of a full failure below so many sigmas tells nothing, and its test waits."""

LEAST_INFORMATION, MOST_PERIODS = 25.0, 15
"""About the loss of a thruster before it is judged: that of a test pulse, or so many periods."""

WEAK = 0.1
"""A thruster that makes less of its thrust counts as dead."""

TOLD_APART = 2 * PENALTY / WEAK**2
"""Information about the loss of a thruster that tells a dead one from a `WEAK` one."""

TEST_SIGMAS = 6.0
"""Effect of a test pulse on the rate, over the noise of a rate."""

TRACKING, SLOW_TRACKING = 0.1, 0.03
"""Part of the error of a flow, and of the torque besides, that is taken out with each sample."""

MOST_RETURNS = 2
"""A thruster that has come back so often and fails once more is not trusted again."""

NONE = -1.0
"""The kind of a thruster that works."""


class Stage(enum.IntEnum):
    """Nothing suspected, or an alarm whose cause is being isolated."""

    QUIET = 0
    ALARM = 1


class DiagnosisMemory(NamedTuple):
    """What is known of each thruster, and what is suspected.

    `statistic` (2, m) has the CUSUMs of loss and flow. `condition` and `kind` (a `DiagnosedKind`,
    or -1) are the verdicts, `returns` tells how often a thruster came back. `age` (s) is the time
    since the last alarm, verdict or dismissal, `suspect` the likeliest thruster, and `rival` tells
    which explain the residuals nearly as well. `doubt` (rad/s) is the standard deviation of the
    last residual, errors of the model included.
    """

    residual: ResidualMemory
    doubt: RealScalar
    statistic: Float[Array, "2 m"]
    stage: Int[Array, ""]
    age: RealScalar
    evidence: Evidence
    suspect: Int[Array, ""]
    rival: Bool[Array, " m"]
    condition: Condition
    kind: Float[Array, " m"]
    returns: Float[Array, " m"]


class Diagnosis(eqx.Module):
    """Detects and isolates failed thrusters, and finds those that work again.

    Each thruster has two CUSUM tests, that thrust is missing and that there is some which was not
    commanded. Their scores are standard normal where nothing has failed and the model is true, so
    that `average_run_length` of `reference` and `threshold` (both in sigmas) is the mean number of
    samples to a false alarm of each test. From the alarm on the evidence is gathered anew. The best
    explanation is the verdict once its log-likelihood exceeds that of no failure, and that of any
    other thruster, by `margin`. After `patience` samples the more likely of two thrusters is taken,
    and an alarm that nothing explains is dismissed. A failed thruster whose commanded thrust is
    there again works again, at most `MOST_RETURNS` times.
    """

    filter: ResidualFilter
    reference: RealScalar = eqx.field(converter=as_float, default=1.0)
    threshold: RealScalar = eqx.field(converter=as_float, default=12.0)
    margin: RealScalar = eqx.field(converter=as_float, default=8.0)
    patience: RealScalar = eqx.field(converter=as_float, default=300.0)

    def __check_init__(self):
        for name in ("reference", "threshold", "margin", "patience"):
            require_positive(name, getattr(self, name))

    def init(self, omega: Float[Array, "3"]) -> DiagnosisMemory:
        """All thrusters work."""
        count = self.filter.thrusters.count
        zero = jnp.zeros(count, omega.dtype)
        return DiagnosisMemory(
            self.filter.init(omega),
            self.filter.rate_noise,
            jnp.zeros((2, count), omega.dtype),
            jnp.array(int(Stage.QUIET)),
            zero[0],
            Evidence.none(count),
            jnp.array(0),
            zero >= 0,
            Condition.sound(count),
            zero + NONE,
            zero,
        )

    def test_duty(self, period: RealScalar, memory: DiagnosisMemory) -> Float[Array, " m"]:
        """The duty, in a period (s), of test pulses that stand out of the noise if they come.

        During an alarm they stand out of all that is in doubt: what a stuck thruster makes hides
        pulses that would be seen without it.
        """
        residual, thrusters = self.filter, self.filter.thrusters
        effect = residual.model.spacecraft.inverse_inertia @ thrusters.torque
        sigma = jnp.where(memory.stage == Stage.ALARM, memory.doubt, residual.rate_noise)
        seen = TEST_SIGMAS * sigma / jnp.sqrt(jnp.sum(effect**2, axis=0))
        return jnp.minimum(jnp.maximum(seen, thrusters.min_on_time) / period, 1.0)

    def may_return(self, memory: DiagnosisMemory) -> Bool[Array, " m"]:
        """Which thrusters have failed and count as working again once their thrust is there."""
        return memory.condition.failed & (memory.returns < MOST_RETURNS)

    def step(
        self,
        omega: Float[Array, "3"],
        on_time: Float[Array, " m"],
        period: RealScalar,
        memory: DiagnosisMemory,
        needed: Bool[Array, " m"] | None = None,
    ) -> DiagnosisMemory:
        """One sample: `omega` (rad/s) is estimated, `on_time` (s) was commanded since the last.

        Of those that are `needed` a dead one is told from a `WEAK` one before it is given up.
        """
        needed = jnp.zeros_like(memory.condition.failed) if needed is None else needed
        condition = memory.condition
        residual, filtered = self.filter.step(omega, on_time, condition, period, memory.residual)
        statistic = self._statistic(residual, memory)
        alarmed = memory.stage == Stage.ALARM
        evidence = memory.evidence.after(residual, self.filter.uncertainty)
        evidence = jax.tree.map(lambda x: jnp.where(alarmed, x, 0.0), evidence)
        lasting = condition.failed & ~self.may_return(memory)
        found = explanation(evidence, condition.failed, lasting, self.filter.uncertainty)
        age = memory.age + period
        late = age > self.patience * period
        tested = (found.tested > LEAST_INFORMATION) | (age > MOST_PERIODS * period)
        flows = found.kind > DiagnosedKind.DEGRADED
        tested = tested & (flows | ~needed[found.thruster] | (found.tested > TOLD_APART))
        sure = (found.margin > self.margin) & tested
        verdict = alarmed & (found.score > self.margin) & (sure | late)
        over = alarmed & (verdict | late)
        alarm = ~alarmed & (jnp.max(statistic) > self.threshold)
        hit = verdict & (jnp.arange(lasting.shape[0]) == found.thruster)
        fails = hit & ~condition.failed
        comes_back = hit & condition.failed & (found.kind == DiagnosedKind.DEAD)
        tracked = self._tracked(residual, condition, period)
        lost = jnp.where(fails, 1.0, 1 - condition.part)
        left = jnp.where(fails, 1 - found.loss, condition.part + found.loss * lost)
        flow = jnp.where(comes_back, 0.0, tracked.flow)
        judged = Condition(
            (condition.failed | fails) & ~comes_back,
            jnp.where(hit, left, condition.part),
            jnp.where(fails, found.flow, flow),
            tracked.torque,
        )
        return DiagnosisMemory(
            self.filter.restarted(filtered, verdict),
            residual.doubt(self.filter.uncertainty),
            jnp.where(over | alarm, 0.0, statistic),
            jnp.where(over, int(Stage.QUIET), jnp.where(alarm, int(Stage.ALARM), memory.stage)),
            jnp.where(over | alarm, 0.0, age),
            evidence,
            found.thruster,
            found.scores > found.score - self.margin,
            judged,
            jnp.where(comes_back, NONE, jnp.where(hit, found.kind, memory.kind)),
            memory.returns + comes_back,
        )

    def _statistic(self, residual: Residual, memory: DiagnosisMemory) -> Float[Array, "2 m"]:
        """The CUSUMs, which stand where a signature is too small, and during an alarm."""
        signatures = jnp.stack([residual.loss, residual.flow])
        size = jnp.sqrt(jnp.sum(signatures**2, axis=1))
        sigma = jnp.sqrt(residual.variance)
        seen = size > LEAST_SIGNAL * sigma
        along = jnp.sum(signatures * residual.innovation[None, :, None], axis=1)
        score = along / (jnp.where(seen, size, 1.0) * sigma)
        after = jnp.maximum(memory.statistic + score - self.reference, 0.0)
        of_flow = jnp.arange(2)[:, None] == 1
        failed, many = memory.condition.failed, memory.returns >= MOST_RETURNS
        untested = failed[None] & (of_flow | many[None])
        tested = seen & ~untested & (memory.stage == Stage.QUIET)
        return jnp.where(tested, after, memory.statistic)

    def _tracked(self, residual: Residual, condition: Condition, period: RealScalar) -> Condition:
        """With the flows of failed thrusters that have one, and the torque, corrected."""
        body = self.filter.model.spacecraft
        effect = period * (body.inverse_inertia @ self.filter.thrusters.torque)
        error = jnp.sum(effect * residual.innovation[:, None], axis=0) / jnp.sum(effect**2, axis=0)
        flows = condition.failed & (condition.flow > 0)
        flow = jnp.clip(condition.flow + TRACKING * error, 0.0, 1.0)
        torque = condition.torque + SLOW_TRACKING / period * (body.inertia @ residual.innovation)
        return condition._replace(
            flow=jnp.where(flows, flow, condition.flow),
            torque=jnp.where(jnp.any(flows), torque, 0.0),
        )
