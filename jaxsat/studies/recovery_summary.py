"""Summary of a study of failures in flight: recovered fractions by kind, and explained cases.

The summary needs the columns of a store alone, so that it exists for any store that has them.
"""

import itertools
from collections.abc import Iterator, Mapping
from typing import Any, NamedTuple

import numpy as np

from jaxsat.store.labels import flags_of
from jaxsat.studies.failure_codes import AMOUNTLESS, CODES, DIAGNOSED, FAILURES, NEVER
from jaxsat.studies.recovery import Recovery, failed_thrusters, wrong_kind
from jaxsat.studies.statistics import Interval, percentile, wilson
from jaxsat.studies.torques_left import TorquesLeft

ALL, NONE = "all", "no failure"

DELAY_PERCENTS = (50.0, 90.0)
SETTLING_PERCENTS = (50.0, 90.0, 99.0)

COLUMNS = ("failure_time", "failed_part", "failure_kind", "failure_amount", "torques_left",
           "recovery", "settling_time", "ended_at")  # fmt: skip
OF_DIAGNOSIS = ("false_alarms", "detection_time", "isolation_time", "isolated_kind")


class KindDiagnosis(NamedTuple):
    """Diagnosis of failures of one kind.

    `detected` cases had an alarm after every failure; in `isolated` ones exactly the failed
    thrusters are isolated at the end, in `as_kind` also as the right kind. The delays (s) are from
    the failure to the alarm and from the alarm to the verdict, by percent.
    """

    detected: int
    isolated: int
    as_kind: int
    detection_delay: dict[float, Interval]
    isolation_delay: dict[float, Interval]


class KindRecovery(NamedTuple):
    """Cases of one kind of failure, by their recovery.

    `recovered` is the fraction of all, `of_recoverable` that of cases for which laws exist, by
    controllability or because they recovered; None without any. `settling_delay` is the time (s)
    from the last failure until recovered cases had settled, zero if they stayed settled, by
    percent. `reasons` counts the others by `Recovery`.
    """

    kind: str
    cases: int
    settled: int
    recovered: Interval
    recoverable: int
    of_recoverable: Interval | None
    settling_delay: dict[float, Interval]
    reasons: dict[Recovery, int]
    diagnosis: KindDiagnosis | None


class UnrecoveredCase(NamedTuple):
    """A case that did not recover, the reason, and a one-line explanation."""

    case: int
    reason: Recovery
    text: str


class RecoverySummary(NamedTuple):
    """Summary of a study of failures: by kind, all kinds last, and the cases that did not recover.

    `false_alarms` is the number of alarms in `healthy_time` (s), the time before any failure of all
    cases together; None for a law that does not diagnose.
    """

    by_kind: list[KindRecovery]
    unrecovered: list[UnrecoveredCase]
    false_alarms: int | None
    healthy_time: float


def reason_words(reason: Recovery) -> str:
    """Reason in words."""
    return reason.explanation


def summarise_recovery(dataset: Mapping[Any, Any], places: np.ndarray) -> RecoverySummary | None:
    """Summarise the cases at these `places`; None for a study without failures in flight.

    `dataset` is that of `open_study`, or columns by name. Parts of a vehicle are numbered if the
    columns are plain arrays, which lack names.
    """
    if "recovery" not in dataset:
        return None
    stored = [name for name in (*COLUMNS, *OF_DIAGNOSIS) if name in dataset]
    columns = {name: np.asarray(dataset[name])[places] for name in stored}
    kinds = _kind_names(columns["failure_kind"])
    names = flags_of(dataset["failed_part"]) or _part_numbers(columns)
    rows = [_of_kind(kind, _only(columns, kinds == kind), names) for kind in _in_order(kinds)]
    if len(rows) > 1:
        rows.append(_of_kind(ALL, columns, names))
    healthy = np.minimum(columns["failure_time"].min(axis=1), columns["ended_at"])
    unrecovered = np.flatnonzero(columns["recovery"] != Recovery.RECOVERED)
    return RecoverySummary(
        rows,
        [
            UnrecoveredCase(int(places[row]), Recovery(int(columns["recovery"][row])), text)
            for row, text in zip(
                unrecovered, explanations(_only(columns, unrecovered), names), strict=True
            )
        ],
        int(columns["false_alarms"].sum()) if "false_alarms" in columns else None,
        float(healthy.sum()),
    )


def recovery_by_devices(
    columns: Mapping[str, np.ndarray], names: tuple[str, ...]
) -> Iterator[tuple[str, np.ndarray, KindRecovery]]:
    """Yield the failing devices, the indices of their cases, and their recovery, for each set of
    failures of different devices in a study; `names` are those of the devices.

    Cases in which a failure does not strike, or in which a device fails twice, are left out.
    """
    columns = {name: columns[name] for name in (*COLUMNS, *OF_DIAGNOSIS) if name in columns}
    kinds, parts = columns["failure_kind"], columns["failed_part"]
    first = np.array([names.index(name) for name in names])  # both directions have one name
    parts = first[parts]
    order = np.argsort(parts, axis=1, kind="stable")
    parts, kinds = (np.take_along_axis(one, order, axis=1) for one in (parts, kinds))
    whole = (kinds != NEVER).all(axis=1) & (np.diff(parts, axis=1) > 0).all(axis=1)
    both, count = np.hstack([parts, kinds]), parts.shape[1]
    for row in np.unique(both[whole], axis=0):
        places = np.flatnonzero((both == row).all(axis=1))
        text = " + ".join(FAILURES[kind] for kind in row[count:])
        devices = " + ".join(names[part] for part in row[:count])
        yield devices, places, _of_kind(text, _only(columns, places), names)


def _part_numbers(columns: Mapping[str, np.ndarray]) -> tuple[str, ...]:
    verdicts = columns.get("isolated_kind")
    count = max(columns["failed_part"].max() + 1, 0 if verdicts is None else verdicts.shape[1])
    return tuple(f"part {number + 1}" for number in range(count))


def explanations(columns: Mapping[str, np.ndarray], names: tuple[str, ...]) -> Iterator[str]:
    """Yield a line for each case: the reason, failures, remaining torques, and diagnosis."""
    for case in range(len(columns["recovery"])):
        row = {name: values[case] for name, values in columns.items()}
        parts = [
            Recovery(int(row["recovery"])).explanation,
            *_failure_texts(row, names),
            TorquesLeft(int(row["torques_left"])).explanation,
            *_diagnosis_texts(row, names),
        ]
        yield "; ".join(parts)


def _failure_texts(row: Mapping[str, Any], names: tuple[str, ...]) -> Iterator[str]:
    for at, part, code, amount in zip(
        row["failure_time"],
        row["failed_part"],
        row["failure_kind"],
        row["failure_amount"],
        strict=True,
    ):
        if code == NEVER:
            continue
        kind = CODES[int(code)].word
        much = "" if FAILURES[code] in AMOUNTLESS else f" {amount:.3g}"
        yield f"{names[part]} {kind}{much} at {at:.5g} s"


def _diagnosis_texts(row: Mapping[str, Any], names: tuple[str, ...]) -> Iterator[str]:
    if "isolated_kind" not in row:
        return
    for at, detected, code in zip(
        row["failure_time"], row["detection_time"], row["failure_kind"], strict=True
    ):
        if code != NEVER:
            late = "no alarm" if np.isnan(detected) else f"alarm {detected - at:.3g} s later"
            yield late
    verdicts = [
        f"{names[place]} as {DIAGNOSED[code]} at {row['isolation_time'][place]:.5g} s"
        for place, code in enumerate(row["isolated_kind"])
        if code != NEVER
    ]
    yield f"isolated: {', '.join(verdicts) or 'nothing'}"


def _only(columns: Mapping[str, np.ndarray], selection: np.ndarray) -> dict[str, np.ndarray]:
    return {name: values[selection] for name, values in columns.items()}


def _kind_names(kinds: np.ndarray) -> np.ndarray:
    """Kinds of all failures of each case, as one text."""
    return np.array(
        [" + ".join(FAILURES[code] for code in row if code != NEVER) or NONE for row in kinds],
        object,
    )


def _in_order(kinds: np.ndarray) -> list[str]:
    """Kinds in the order of `FAILURES`, no failure last."""
    distinct = sorted(set(kinds.tolist()))

    def place(kind: str) -> tuple:
        parts = [] if kind == NONE else kind.split(" + ")
        return (kind == NONE, len(parts), [FAILURES.index(part) for part in parts])

    return sorted(distinct, key=place)


def _of_kind(kind: str, columns: Mapping[str, np.ndarray], names: tuple[str, ...]) -> KindRecovery:
    codes = columns["recovery"]
    cases, settled = len(codes), int((codes == Recovery.RECOVERED).sum())
    recoverable = cases - int((codes == Recovery.UNRECOVERABLE).sum())
    return KindRecovery(
        kind,
        cases,
        settled,
        wilson(settled, cases),
        recoverable,
        wilson(settled, recoverable) if recoverable else None,
        {} if kind == NONE else _percentiles(_settling_delays(columns), SETTLING_PERCENTS),
        {
            reason: int((codes == reason).sum())
            for reason in Recovery
            if reason != Recovery.RECOVERED and (codes == reason).any()
        },
        _diagnosis(columns, names) if "isolated_kind" in columns and kind != NONE else None,
    )


def _diagnosis(columns: Mapping[str, np.ndarray], names: tuple[str, ...]) -> KindDiagnosis:
    truth, verdict = failed_thrusters(columns, names), columns["isolated_kind"]
    at, alarm = columns["failure_time"], columns["detection_time"]
    struck = (columns["failure_kind"] != NEVER) & (columns["failed_part"] < truth.shape[1])
    delay = np.where(struck, alarm - at, np.nan)
    exactly = ((truth != NEVER) == (verdict != NEVER)).all(axis=1) & (truth != NEVER).any(axis=1)
    right = exactly & ~wrong_kind(columns, names).any(axis=1)
    isolation_delays = [
        columns["isolation_time"][case, columns["failed_part"][case, event]] - alarm[case, event]
        for case, event in itertools.product(*map(range, struck.shape))
        if struck[case, event]
    ]
    return KindDiagnosis(
        int((struck.any(axis=1) & ~(struck & np.isnan(delay)).any(axis=1)).sum()),
        int(exactly.sum()),
        int(right.sum()),
        _percentiles(delay[np.isfinite(delay)]),
        _percentiles(np.array([late for late in isolation_delays if late >= 0])),
    )


def _settling_delays(columns: Mapping[str, np.ndarray]) -> np.ndarray:
    """Time (s) from the last failure until settled, of recovered cases with failures."""
    last_failure = np.where(columns["failure_kind"] != NEVER, columns["failure_time"], -np.inf).max(
        axis=1
    )
    delays = np.maximum(columns["settling_time"] - last_failure, 0)
    return delays[np.isfinite(last_failure) & (columns["recovery"] == Recovery.RECOVERED)]


def _percentiles(
    values: np.ndarray, percents: tuple[float, ...] = DELAY_PERCENTS
) -> dict[float, Interval]:
    if not len(values):
        return {}
    return {percent: percentile(values, percent) for percent in percents}
