"""Failures in each case of a study, remaining torques, and reasons why a case did not recover."""

from collections.abc import Mapping
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Int

from jaxsat.core.declaration.failures import ONE_WAY
from jaxsat.core.tolerances import SETTLED_BEFORE, Tolerances
from jaxsat.simulation.engine.failure_record import initial_record
from jaxsat.simulation.loops import AbstractLoop, failures_of
from jaxsat.simulation.trajectory import ExplainedCode, Outcome
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.failures import AbstractFailures
from jaxsat.store.chunks import Column
from jaxsat.store.labels import ALL_PARTS
from jaxsat.studies.failure_codes import (
    AMOUNTLESS,
    DIAGNOSED,
    FAILURES,
    HYPOTHESES,
    NEVER,
    first_code,
    words,
)
from jaxsat.studies.momentum_left import Held
from jaxsat.studies.torques_left import UNRECOVERABLE, TorquesLeft, torques_left

STUCK = [1 + kind for kind in ONE_WAY]
"""Codes of failures of one direction of a two-sided thruster."""

OF_RECORD = {
    "longest_stay": Column(
        (), "float64", "s", "longest time within the tolerances since the first failure"
    ),
    "false_alarms": Column((), "int32", "1", "alarms that began before any failure"),
    "detection_time": Column((0,), "float64", "s", "first alarm after each failure", ("failure",)),
    "isolation_time": Column(
        (0,), "float64", "s", "when each thruster was first isolated", ("thruster",)
    ),
    "isolated_kind": Column(
        (0,), "uint8", "1", "last verdict on each thruster", ("thruster",), DIAGNOSED
    ),
}
"""Columns of a sampled loop's failures; those of a diagnosis only if its law makes one."""


class Recovery(ExplainedCode):
    """Whether a case settled for good or, if not, the first applicable reason."""

    RECOVERED = 0, "recovered"
    UNRECOVERABLE = 1, "unrecoverable"
    ENDED_EARLY = 2, "the run ended early"
    MISSED_DETECTION = 3, "missed detection"
    WRONG_THRUSTER_ISOLATED = 4, "a working actuator isolated"
    NOT_ISOLATED = 5, "detected, not isolated"
    WRONG_KIND_ISOLATED = 6, "isolated as the wrong kind"
    SETTLED_THEN_LOST = 7, "settled, then lost"
    TOO_SLOW = 8, "too slow"


@dataclass(frozen=True)
class FailureRecovery:
    """Evaluation of failures in flight: strikes, remaining torques, and recovery of each case.

    A case is settled within the `tolerances`, of the rate alone if those of the attitude are
    infinite. `names` are those of all thrusters, a two-sided one twice, and wheels. `outputs` has
    the shapes of the loop's failure record, by column.
    """

    loop: AbstractLoop
    start: PlantState
    duration: float
    tolerances: Tolerances
    names: tuple[str, ...]
    outputs: Mapping[str, tuple[int, ...]]

    @staticmethod
    def of(
        loop: AbstractLoop,
        start: PlantState,
        duration: float,
        tolerances: Tolerances,
        names: tuple[str, ...] = (),
    ) -> "FailureRecovery | None":
        """Return the recovery of a loop and its start; None without failures in flight.

        Without a name for each thruster, wheel and magnetorquer these are numbered.
        """
        if not failures_of(loop):
            return None
        counts = _counts(loop)
        if len(names) != sum(counts.values()):
            names = tuple(f"{kind} {one + 1}" for kind in counts for one in range(counts[kind]))
        outputs = {name: one.shape for name, one in _output_shapes(loop, start).items()}
        return FailureRecovery(loop, start, duration, tolerances, names, outputs)

    @property
    def _attitude(self) -> bool:
        """Whether cases settle in attitude, or in rate alone."""
        return bool(np.isfinite(np.asarray(self.tolerances.w)))

    @property
    def _dwell(self) -> float:
        """Shortest time (s) at the end for which a settled case is within the tolerances."""
        dwell = self.tolerances.dwell
        return (1 - SETTLED_BEFORE) * self.duration if dwell is None else float(np.asarray(dwell))

    @property
    def _events(self) -> list[AbstractFailures]:
        return failures_of(self.loop)

    @property
    def _diagnosed_kind(self) -> str:
        """Kind of actuator of the verdicts, or `ALL_PARTS` for thrusters and wheels."""
        thrusters = _counts(self.loop).get("thruster", 0)
        if not thrusters:
            return "wheel"
        (verdicts,) = self.outputs.get("isolated_kind", (thrusters,))
        return "thruster" if verdicts == thrusters else ALL_PARTS

    def columns(self) -> dict[str, Column]:
        """Return the store columns; those of `OF_RECORD` if the loop has them."""
        count = sum(one.count for one in self._events)
        events = ("failure",)

        def of_failure(kind: str, unit: str, text: str, flags: tuple[str, ...] = ()) -> Column:
            return Column((count,), kind, unit, text, events, flags)

        columns = {
            name: OF_RECORD[name]._replace(shape=shape) for name, shape in self.outputs.items()
        }
        kind = self._diagnosed_kind
        if kind != "thruster":
            columns = {name: _of_others(column, kind) for name, column in columns.items()}
        return columns | {
            "failure_time": of_failure("float64", "s", "when each failure strikes"),
            "failed_part": of_failure("uint8", "1", "what each failure strikes", self.names),
            "failure_kind": of_failure("uint8", "1", "kind of each failure", FAILURES),
            "failure_amount": of_failure(
                "float64", "1", "fraction (or delay, s; or factor or level, N m) of each failure"
            ),
            "torques_left": Column(
                (), "uint8", "1", "what the failures leave", (), words(TorquesLeft)
            ),
            "recovery": Column(
                (), "uint8", "1", "whether the case recovered, or why not", (), words(Recovery)
            ),
        }

    def values(
        self, columns: Mapping[str, np.ndarray], draws: Mapping[str, np.ndarray]
    ) -> dict[str, np.ndarray]:
        """Return columns of failures and recovery, from other columns of cases and their draws."""
        cases = len(columns["code"])
        failures = self.struck(draws, cases)
        momentum, hold = np.asarray(self.loop.plant.total_momentum(self.start)), None
        if self._attitude:
            hold = Held(self.loop, self.start, self.duration, self.tolerances, draws)
        gain = draws.get("torque_gain")
        remaining = torques_left(self.loop, momentum, failures, gain, hold)
        codes = {
            "torques_left": remaining,
            "recovery": self._recovery({**columns, **failures}, remaining),
        }
        return {name: failures[name] for name in self.columns() if name in failures} | codes

    def struck(self, draws: Mapping[str, np.ndarray], cases: int) -> dict[str, np.ndarray]:
        """Return time, part, kind and amount (cases, failures) of every failure, from draws."""

        def numbers(name: str, field: str, of: str | None = None) -> np.ndarray:
            parts = [getattr(one, field) for one in self._events if of in (None, one.part)]
            if name in draws:
                return np.asarray(draws[name]).reshape(cases, -1)
            nominal = np.concatenate([np.asarray(part) for part in parts] or [np.zeros(0)])
            return np.tile(nominal, (cases, 1))

        at, kind = numbers("failure_time", "at"), numbers("failure_kind", "kind")
        parts, before = [], 0
        for name, count in _counts(self.loop).items():
            parts.append(numbers(f"failed_{name}", "number", name) + before)
            before += count
        part = np.rint(np.concatenate(parts, axis=1)).astype(int)
        shift = np.concatenate([np.full(one.count, first_code(one.kinds)) for one in self._events])
        part = np.clip(part, 0, len(self.names) - 1)  # numbers beyond belong to impossible cases
        kind = np.clip(np.rint(kind).astype(int) + shift, NEVER, len(FAILURES) - 1)
        kind = np.where(at <= self.duration, kind, NEVER)
        amount = numbers("failure_amount", "amount")
        none = np.isin(kind, [FAILURES.index(name) for name in AMOUNTLESS])
        return {
            "failure_time": at,
            "failed_part": part,
            "failure_kind": kind,
            "failure_amount": np.where(none, np.nan, amount),
        }

    def _recovery(
        self, columns: Mapping[str, np.ndarray], remaining: np.ndarray
    ) -> Int[np.ndarray, " cases"]:
        wrong = UNRECOVERABLE if self._attitude else (TorquesLeft.UNOPPOSED_TORQUE,)
        had_settled = columns["longest_stay"] >= self._dwell if "longest_stay" in columns else False
        reasons = {
            Recovery.RECOVERED: np.isfinite(columns["settling_time"]),
            Recovery.UNRECOVERABLE: np.isin(remaining, wrong),
            Recovery.ENDED_EARLY: columns["code"] != int(Outcome.SUCCESS),
        }
        if "isolated_kind" in columns:
            reasons |= _errors(columns, self.names)
        reasons[Recovery.SETTLED_THEN_LOST] = np.broadcast_to(had_settled, remaining.shape)
        return np.select(list(reasons.values()), list(map(int, reasons)), int(Recovery.TOO_SLOW))


def _of_others(column: Column, kind: str) -> Column:
    """Column of a law that diagnoses actuators of another kind than thrusters."""
    dims = tuple(kind if axis == "thruster" else axis for axis in column.dims)
    return column._replace(dims=dims, long_name=column.long_name.replace("thruster", kind))


def failed_thrusters(
    columns: Mapping[str, np.ndarray], names: tuple[str, ...]
) -> Int[np.ndarray, "cases m"]:
    """Return the code of the last failure that struck each thruster, `NEVER` without one.

    The two directions of a two-sided thruster have the same one of the `names`, and fail together
    except for the kinds `ONE_WAY`.
    """
    verdict = columns["isolated_kind"]
    count, truth = verdict.shape[1], np.zeros(verdict.shape, int)
    same = np.array([[one == other for other in names[:count]] for one in names])
    order = np.argsort(columns["failure_time"], axis=1, kind="stable")
    kinds, parts = (
        np.take_along_axis(np.asarray(columns[name]), order, axis=1)
        for name in ("failure_kind", "failed_part")
    )
    for kind, part in zip(kinds.T, parts.T, strict=True):
        alone = (part[:, None] == np.arange(count)) | ~np.isin(kind, STUCK)[:, None]
        hit = same[part] & alone & (kind > NEVER)[:, None]
        truth = np.where(hit, kind[:, None], truth)
    return truth


def wrong_kind(columns: Mapping[str, np.ndarray], names: tuple[str, ...]) -> np.ndarray:
    """Mask of thrusters (cases, m) isolated as the wrong kind, although a right verdict exists."""
    truth, verdict = failed_thrusters(columns, names), columns["isolated_kind"]
    right = np.array([HYPOTHESES.get(code, NEVER) for code in range(len(FAILURES))])[truth]
    return (right != NEVER) & (verdict > NEVER) & (verdict != right)


def _errors(
    columns: Mapping[str, np.ndarray], names: tuple[str, ...]
) -> dict[Recovery, np.ndarray]:
    """Errors of the diagnosis, as masks of cases."""
    truth, verdict = failed_thrusters(columns, names), columns["isolated_kind"]
    of_thruster = (columns["failure_kind"] > NEVER) & (columns["failed_part"] < truth.shape[1])
    wrong = {
        Recovery.MISSED_DETECTION: of_thruster & np.isnan(columns["detection_time"]),
        Recovery.WRONG_THRUSTER_ISOLATED: (truth == NEVER) & (verdict > NEVER),
        Recovery.NOT_ISOLATED: (truth > NEVER) & (verdict == NEVER),
        Recovery.WRONG_KIND_ISOLATED: wrong_kind(columns, names),
    }
    return {reason: np.asarray(one.any(axis=1)) for reason, one in wrong.items()}


def _counts(loop: AbstractLoop) -> dict[str, int]:
    """Number of parts of each kind that may fail, in the order of `failures_of`."""
    return {one.kind: one.count for one in loop.plant.effectors}


def _output_shapes(loop: AbstractLoop, start: PlantState) -> Mapping[str, jax.ShapeDtypeStruct]:
    """Shapes of the loop's failure record, by column."""

    def outputs():
        record = initial_record(loop, loop.start(start))
        return {} if record is None else record.outputs(jnp.ones(()))

    return jax.eval_shape(outputs)
