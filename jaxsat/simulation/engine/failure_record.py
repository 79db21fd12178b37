"""Record of failures in flight during a sampled run: stays, detection, isolation."""

from typing import NamedTuple

import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar
from jaxsat.core.tolerances import Tolerances, excess
from jaxsat.simulation.loops import AbstractLoop, failures_of
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.simulation.trajectory import Signals


class DiagnosisRecord(NamedTuple):
    """Verdicts of a law that diagnoses its actuators so far; times are infinite for never.

    `detected` (s) is the time of the first alarm after each failure, `isolated` (s) that of each
    actuator's first isolation, `kind` the last verdict on each. `false_alarms` counts the alarms
    that began before any failure.
    """

    detected: Float[Array, " f"]
    isolated: Float[Array, " m"]
    kind: Float[Array, " m"]
    alarmed: BoolScalar
    false_alarms: IntScalar


class FailureRecord(NamedTuple):
    """Record, by sample, of a case with failures at times `at` (s).

    `stay` is the number of successive samples within the tolerances since the first failure,
    `longest` the largest of these numbers. `diagnosis` is None for a law that does not diagnose.
    """

    at: Float[Array, " f"]
    stay: IntScalar
    longest: IntScalar
    diagnosis: DiagnosisRecord | None

    def observe(self, t: RealScalar, signals: Signals, tolerances: Tolerances) -> "FailureRecord":
        """The record with one more sample, at `t` (s).

        A failure that begins at the sample counts from the next one.
        """
        sizes = excess(signals.w, signals.z, signals.relative_rate, tolerances)
        inside = jnp.all(sizes < 0) & (t >= jnp.min(self.at))
        stay = jnp.where(inside, self.stay + 1, 0)
        return self._replace(
            stay=stay,
            longest=jnp.maximum(self.longest, stay),
            diagnosis=self._next_diagnosis(t, signals),
        )

    def _next_diagnosis(self, t: RealScalar, signals: Signals) -> DiagnosisRecord | None:
        before = self.diagnosis
        if before is None:
            return None
        kind, alarm = (jnp.asarray(signals.parts[one]) for one in ("diagnosed_kind", "alarm"))
        alarmed = alarm > 0
        detection = alarmed & (t > self.at) & jnp.isinf(before.detected)
        isolation = (kind >= 0) & jnp.isinf(before.isolated)
        false = alarmed & ~before.alarmed & (t < jnp.min(self.at))
        return DiagnosisRecord(
            jnp.where(detection, t, before.detected),
            jnp.where(isolation, t, before.isolated),
            jnp.where(jnp.isnan(kind), before.kind, kind),
            alarmed,
            before.false_alarms + false.astype(before.false_alarms.dtype),
        )

    def outputs(self, interval: RealScalar) -> dict[str, Array]:
        """The record by columns of a study; NaN for never."""
        columns: dict[str, Array] = {"longest_stay": self.longest * interval}
        if self.diagnosis is not None:
            diagnosis = self.diagnosis
            columns |= {
                "false_alarms": diagnosis.false_alarms,
                "detection_time": jnp.where(
                    jnp.isinf(diagnosis.detected), jnp.nan, diagnosis.detected
                ),
                "isolation_time": jnp.where(
                    jnp.isinf(diagnosis.isolated), jnp.nan, diagnosis.isolated
                ),
                "isolated_kind": jnp.round(diagnosis.kind).astype(int) + 1,
            }
        return columns


def initial_record(loop: AbstractLoop, state: PyTree) -> FailureRecord | None:
    """The record before the first sample; None for a loop without samples or failures."""
    events = failures_of(loop)
    if not events or not isinstance(loop, SampledLoop):
        return None
    at = jnp.concatenate([one.at for one in events])
    none, telemetry = jnp.array(0), loop.controller.telemetry(state.memory)
    if "diagnosed_kind" not in telemetry or "alarm" not in telemetry:
        return FailureRecord(at, none, none, None)
    kind, never = telemetry["diagnosed_kind"], jnp.inf
    diagnosis = DiagnosisRecord(at * 0 + never, kind * 0 + never, kind, none > 0, none)
    return FailureRecord(at, none, none, diagnosis)
