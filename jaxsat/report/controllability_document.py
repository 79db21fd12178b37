"""Controllability of a spacecraft, as it is and after every failure: document and dataset."""

import math
from collections import Counter
from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from jaxsat.control.flyable_laws import FLYABLE
from jaxsat.controllability.cone import direction_words, torque_cone
from jaxsat.controllability.failures import FailureCase, failure_arrays
from jaxsat.controllability.judgement import CONTROLLABLE, Judgement
from jaxsat.controllability.linear import gramian_time_scales
from jaxsat.controllability.net_forces import net_force, net_force_words
from jaxsat.controllability.rank import Analysis, analyse
from jaxsat.controllability.rod_wording import rod_torques
from jaxsat.controllability.wording import (
    cone_words,
    momentum_words,
    once_stopped_words,
    verdict_sentence,
)
from jaxsat.core.text import clean, number_text
from jaxsat.report.document import Block, Cell, Document, Lines, Shown, Table, Verdict
from jaxsat.store.labelled import LabelledArray, LabelledArrays
from jaxsat.store.provenance import provenance_attributes

COLUMNS = {
    "failed": "failed",
    "verdict": "verdict",
    "laws": "applicable laws",
    "rank": "rank",
    "margin": "margin",
    "turn_time_s": "turn at 1 N m (s)",
    "torques": "attainable torques",
    "lost": "lost",
}

SURVIVES, UNFLOWN = "Survives", "Controllable, but flown by no law of jaxsat"
BORDERLINE, UNDECIDED = "Borderline", "Not decided"
OUTCOMES = (SURVIVES, UNFLOWN, BORDERLINE, UNDECIDED)
"""Outcomes by which the summary counts failures."""
COUNT_WORDS = ("single", "double", "triple")
ERRORS = ("roll 1°", "pitch 1°", "yaw 1°", "ω1 1 mrad/s", "ω2 1 mrad/s", "ω3 1 mrad/s")


def controllability_document(
    title: str,
    verdict: str,
    records: Sequence[Mapping[str, Any]],
    findings: Sequence[str],
    failures: int | None = None,
) -> Document:
    """Return the document: verdict, survival, all failures, and the `findings`.

    Where a law of jaxsat flies the spacecraft as it is, survival comes first and the verdict is its
    reason.

    `records` are those of `failure_records`, or rows of failures.csv; with `failures` only those of
    this number of actuators are listed.
    """
    selection = [one for one in records if failures in (None, count_failed(one))]
    later = any(one["once_stopped"] != one["verdict"] for one in records)
    names_makers = len({one.get("both_signs_by", "") for one in records} - {""}) > 1
    columns = COLUMNS | ({"both_signs_by": "of both signs by"} if names_makers else {})
    columns |= {"once_stopped": "once stopped"} if later else {}
    rows = [[_cell(name, one) for name in columns] for one in selection]
    note = (
        "The margin compares directions. The turn time is the time to turn by one radian about the "
        "axis that is hardest to reach."
    )
    heading = "Every failure" if failures is None else f"Failures of {failures}"
    blocks: list[Block] = [
        Table(heading, list(columns.values()), rows, note),
        Lines("Findings", findings),
    ]
    good, survival = _is_good(records[0]), _survival(records)
    if len(records) == 1 and records[0].get("working") == "none":  # the table counts no actuator
        good = {"Controllable": True, "Not controllable": False}.get(verdict.partition(":")[0])
        blocks, survival = blocks[1:], []
    if good and any(map(count_failed, records)):
        verdict = f"{survival.pop(0).replace(':', '')} ({verdict})"
    summary = Verdict(good, verdict, survival)
    return Document(title, summary, blocks)


def count_failed(record: Mapping[str, Any]) -> int:
    """Return the number of failed actuators of a record."""
    return 0 if record["failed"] == "none" else len(str(record["failed"]).split())


def _survival(records: Sequence[Mapping[str, Any]]) -> list[str]:
    """Return sentences on the failures of one actuator, two, … after which a law of jaxsat flies.

    Failures that leave the spacecraft controllable, but by no law, are counted apart, as are those
    without a verdict.
    """
    cases = Counter(map(count_failed, records))
    words = {number: word for number, word in enumerate(COUNT_WORDS, 1) if cases[number]}
    if not words:
        return ["No failure is listed."]
    outcomes = Counter((_outcome(one), count_failed(one)) for one in records)
    lines = []
    for outcome in OUTCOMES:
        parts = [
            f"{outcomes[outcome, number]} of {cases[number]} {word}"
            for number, word in words.items()
            if outcomes[outcome, number] or outcome == SURVIVES
        ]
        if parts:
            lines.append(f"{outcome}: {', '.join(parts)} failures.")
    return lines


def _outcome(record: Mapping[str, Any]) -> str | None:
    """Return the one of `OUTCOMES` that a failure has; None where control of some or all attitudes
    is lost."""
    if record["verdict"] in CONTROLLABLE:
        return SURVIVES if FLYABLE[record["laws"]].everywhere else UNFLOWN
    return {"borderline": BORDERLINE, "not decided": UNDECIDED}.get(record["verdict"])


def _cell(name: str, record: Mapping[str, Any]) -> Cell:
    if name == "rank":
        return f"{record[name]} of {record['dimension']}"
    if name in ("margin", "turn_time_s"):
        value = float(record[name])
        return None if math.isnan(value) else Shown(number_text(value, 3), value)
    text = str(record[name])
    return Shown(text, good=_is_good(record)) if name == "verdict" else text


def _is_good(record: Mapping[str, Any]) -> bool | None:
    """Whether a law of jaxsat flies to every attitude; None where only in principle one could."""
    if record["verdict"] == "uncontrollable":
        return False
    everywhere = record["verdict"] == "controllable" and FLYABLE[record["laws"]].everywhere
    return True if everywhere else None


def controllability_lines(
    judgement: Judgement,
    analysis: Analysis | None = None,
    *,
    torque: float = 1.0,
    stopped: Judgement | None = None,
    magnetorquers: bool = False,
    laws: str | None = None,
) -> list[str]:
    """Return the findings without the verdict; `torque` (N m) is the command for the time scales.

    `analysis` is that of the actuators' columns as torques of both signs, None where the momentum
    of wheels decides in place of their rank; `stopped` the judgement once coasting wheels have
    stopped, None without any; `magnetorquers` whether some work; `laws` which laws apply, by
    default those of the judgement.
    """
    jets = torque_cone(judgement.actuators.torques, judgement.actuators.two_sided)
    remarks = [
        once_stopped_words(judgement, stopped),
        momentum_words(judgement, magnetorquers),
        net_force_words(net_force(judgement.actuators, jets)),
    ]
    verdict, torques = verdict_sentence(judgement), cone_words(judgement.cone)
    if judgement.orbit is not None:
        torques = f"{rod_torques(judgement.orbit)} at any instant"
    return [
        *([] if torques.lower() in verdict.lower() else [f"Torques: {torques}"]),
        f"Laws: {laws or FLYABLE[judgement.laws].words}",
        *[line for line in remarks if line is not None],
        *([] if analysis is None else _rank_lines(judgement, analysis, torque)),
    ]


def _rank_lines(judgement: Judgement, analysis: Analysis, torque: float) -> list[str]:
    values = ", ".join(number_text(value, 3) for value in analysis.singular_values)
    growth = " → ".join(str(size) for size in analysis.growth)
    elsewhere = ", ".join(f"{where} {rank}" for where, rank in analysis.away_from_rest.items())
    signs = ", one-sided torques counted as two-sided" if judgement.one_signed else ""
    margin = number_text(analysis.margin, 3)
    lines = [
        f"Rank {analysis.rank} of 6{signs}, margin {margin} (singular values "
        f"{values}; below {analysis.tolerance:.1e} the verdict is borderline); the margin compares "
        "directions and does not say how quickly the spacecraft turns",
        _turn_time(judgement, torque),
        f"Generated by {', '.join(analysis.generators) or 'nothing'}; the closure grows {growth}",
        f"Rank at other states (without the drift unless stated): {elsewhere}",
        *_local_and_linear(judgement, analysis, torque),
    ]
    if analysis.closed_form is not None and not judgement.one_signed:
        lines.insert(2, _closed_form(analysis))
    if analysis.borderline:
        lines.insert(
            1,
            f"Borderline: the numbers exactly as given have rank {analysis.exact_rank}, but "
            f"the deciding value lies below {analysis.tolerance:.1e} (rounding of the input alone: "
            f"{analysis.rounding:.1e})",
        )
    if not analysis.physical:
        lines.append(
            "Caution: physically impossible inertia; one moment exceeds the sum of the others"
        )
    return lines


def _local_and_linear(judgement: Judgement, analysis: Analysis, torque: float) -> list[str]:
    local = "Small-time local controllability at rest"
    cone = judgement.cone
    if judgement.one_signed and judgement.laws == "none":
        if cone.two_sided or cone.opposed is None:
            return [f"{local}: not decided. One-sided torques matter"]
        return [
            f"{local}: disproved. Every torque has a component against "
            f"{direction_words(cone.opposed)}, which a short drift cannot compensate"
        ]
    if judgement.one_signed:
        analysis = analyse(
            analysis.inertia,
            cone.both_signs,
            orbit_rate=analysis.orbit_rate,
            tolerance=analysis.tolerance,
        )
    return [f"{local}: {analysis.local.status}. {analysis.local.reason}", _linear(analysis, torque)]


def _turn_time(judgement: Judgement, torque: float) -> str:
    if not np.isfinite(judgement.turn_time):
        return "Turn time: infinite, no law reaches some axis"
    time = judgement.turn_time / np.sqrt(torque)
    each = "about each axis of both signs" if judgement.one_signed else "a thruster"
    seconds = number_text(time, 3)
    return (
        f"Turn time: {seconds} s with {torque:g} N m {each} to turn one radian about the axis "
        "hardest to reach, from rest, with the other axes unchanged; it falls as 1/√torque"
    )


def _closed_form(analysis: Analysis) -> str:
    form = analysis.closed_form
    assert form is not None
    pair = "no pair of coefficients satisfies it"
    if form.coefficients is not None:
        pair = "with coefficients ({:.4g}, {:.4g})".format(*form.coefficients)
    return f"Closed condition {form.equation} {'holds' if form.holds else 'fails'}, {pair}"


def _linear(analysis: Analysis, torque: float) -> str:
    linear = analysis.linear
    if linear is None:
        return (
            "Linear system about the orbit frame: none, the frame's axes are not principal, so "
            "rest in it is no equilibrium"
        )
    text = f"Linear system about the orbit frame: rank {linear.rank} of 6"
    if not linear.controllable:
        return f"{text}; no linear law holds all three axes"
    times = gramian_time_scales(linear, rms_command=torque)
    parts = [
        f"{e} {number_text(t, 3)} s" for e, t in zip(ERRORS, times, strict=True) if np.isfinite(t)
    ]
    return f"{text}; removing one error with {torque:g} N m (rms) takes {', '.join(parts)}"


def failure_dataset(
    cases: Sequence[FailureCase],
    judgement: Judgement,
    *,
    title: str,
    scenario: str,
    verdict: str,
    findings: Sequence[str],
) -> LabelledArrays:
    """Return every failure case with rank, margin and loss; the judgement is in the attributes.

    `verdict` is a sentence, `findings` are sentences of the document, a line each in an attribute.
    """
    names = cases[0].working  # the first case has no failure
    arrays = failure_arrays(cases, names)
    meaning = {
        "failed": "whether the actuator has failed",
        "rank": "rank of the Lie algebra at rest, of `dimension`",
        "dimension": "dimension of the states that the conserved momentum leaves",
        "verdict": "what the remaining actuators can do",
        "controllable": "every attitude and rate of these states can be reached",
        "borderline": "the margin is too small for a verdict",
        "margin": "smallest singular value of the normalised generating vectors (directions), by "
        "magnetorquers over the largest, of a factor of the Gramian over an orbit",
        "turn_time": "time to turn 1 rad about the axis hardest to reach, 1 N m a thruster",
        "directions": "dimension of the torques of both signs without the drift",
        "torques": "shape of the set of torques",
        "both_signs_by": "which kinds of actuators make the torques of both signs",
        "laws": "laws of jaxsat that can be flown, by the torques they need",
        "lost": "control authority that the failure removes",
        "once_stopped": "the verdict once friction has stopped the wheels that coast",
    }
    units = {"margin": "1", "turn_time": "s"}
    variables = {}
    for name, values in arrays.items():
        dimensions = ("case", "actuator")[: np.ndim(values)]
        attributes = {"long_name": meaning[name]}
        if name in units:
            attributes["units"] = units[name]
        variables[name] = LabelledArray(dimensions, np.asarray(values), attributes)
    attributes = {
        "title": clean(title),
        "scenario": scenario,
        "verdict": clean(verdict),
        "findings": "\n".join(map(clean, findings)),
        "rank": judgement.rank,
        "margin": judgement.margin,
        "turn_time_s": judgement.turn_time,
        **provenance_attributes(),
    }
    actuators = {"actuator": LabelledArray(("actuator",), np.array(names))}
    return LabelledArrays(variables, actuators, attributes)
