"""Requirements as plain data: signals, comparisons with thresholds, and temporal operators.

A formula is a tree of `Inequality`, `Negation`, `Junction` and `Temporal`. Every comparison is
inside exactly one `Temporal`.
"""

import math
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from typing import Literal, NamedTuple

from jaxsat.core.declaration.actuators import PARTS
from jaxsat.core.declaration.units import shown_unit

_DEGREE = math.pi / 180

UNITS: Mapping[str, Mapping[str, float]] = {
    "rad": {"rad": 1.0, "deg": _DEGREE, "arcmin": _DEGREE / 60, "arcsec": _DEGREE / 3600},
    "rad/s": {
        "rad/s": 1.0,
        "deg/s": _DEGREE,
        "deg/h": _DEGREE / 3600,
        "arcmin/s": _DEGREE / 60,
        "arcsec/s": _DEGREE / 3600,
        "rpm": math.pi / 30,
    },
    "N m": {"N m": 1.0, "mN m": 1e-3},
    "N m s": {"N m s": 1.0, "mN m s": 1e-3},
    "A m2": {"A m2": 1.0, "A m²": 1.0},
    "kg": {"kg": 1.0, "g": 1e-3},
    "s": {"s": 1.0, "min": 60.0, "h": 3600.0},
    "1": {"": 1.0},
}
"""Units in which a threshold may be given, with their sizes, by the unit of SI."""


@dataclass(frozen=True)
class RequiredSignal:
    """A signal that a requirement can name: its unit of SI and its meaning.

    `actuator` is the kind of actuator that has the signal, if any. The name of a `directed` signal
    is followed by a direction in body axes.
    """

    name: str
    unit: str
    meaning: str
    actuator: str = ""
    directed: bool = False


_BODY = (
    RequiredSignal("pointing_error", "rad", "angle from the orbit frame to the body frame"),
    RequiredSignal("tilt", "rad", "angle between the third axes of body and orbit frame"),
    RequiredSignal("rate", "rad/s", "size of the inertial angular velocity"),
    *(
        RequiredSignal(f"rate_{axis}", "rad/s", f"inertial angular velocity about body axis {axis}")
        for axis in "xyz"
    ),
    RequiredSignal("relative_rate", "rad/s", "size of the rate relative to the orbit frame"),
    RequiredSignal("torque", "N m", "size of the torque of all actuators"),
    RequiredSignal("disturbance", "N m", "size of the disturbance torque"),
    RequiredSignal(
        "sun_angle", "rad", "angle from a direction in body axes to the Sun", directed=True
    ),
)
"""Signals of every run."""

REQUIRED_SIGNALS: Mapping[str, RequiredSignal] = {
    one.name: one
    for one in (
        *_BODY,
        *(
            RequiredSignal(
                signal.name,
                shown_unit(signal.units),
                ("largest " if signal.each else "") + signal.meaning,
                actuator.name,
            )
            for actuator in PARTS
            for signal in actuator.signals
        ),
    )
}
"""Signals by name; for signals of each device, requirements take the largest size."""


@dataclass(frozen=True)
class Inequality:
    """Comparison of a signal with an upper or lower `limit` (SI); `unit` is that of the text.

    `column` is its place in the text, from 1.
    """

    signal: str
    below: bool
    limit: float
    unit: str
    size: float
    column: int
    direction: tuple[float, ...] = ()


@dataclass(frozen=True)
class Negation:
    """Negation of a formula."""

    part: "Formula"


@dataclass(frozen=True)
class Junction:
    """Conjunction of all parts, or with `every` false their disjunction."""

    parts: tuple["Formula", ...]
    every: bool


class Instant(NamedTuple):
    """A time (s) after, or with a negative offset before, its anchor."""

    anchor: Literal["start", "end", "failure"]
    offset: float = 0.0


@dataclass(frozen=True)
class Temporal:
    """A formula that must hold always, or at some time (eventually), of a window.

    With `until`, `until` must hold at some time of the window and `held` at all times before. A
    window with a failure as anchor exists for each failure, and all must hold.
    """

    kind: Literal["always", "eventually", "until"]
    held: "Formula"
    begin: Instant
    end: Instant
    until: "Formula | None" = None

    @property
    def after_failure(self) -> bool:
        """Whether the window is relative to failures."""
        return "failure" in (self.begin.anchor, self.end.anchor)

    @property
    def whole_run(self) -> bool:
        """Whether the window is the whole run."""
        return (self.begin, self.end) == (Instant("start"), Instant("end"))


Formula = Inequality | Negation | Junction | Temporal


def parts_of(formula: Formula) -> tuple[Formula, ...]:
    """Return the direct parts of a formula."""
    if isinstance(formula, Negation):
        return (formula.part,)
    if isinstance(formula, Junction):
        return formula.parts
    if isinstance(formula, Temporal):
        return (formula.held,) if formula.until is None else (formula.held, formula.until)
    return ()


def all_parts(formula: Formula) -> Iterator[Formula]:
    """Yield the formula and all its parts, in the order of the text."""
    yield formula
    for part in parts_of(formula):
        yield from all_parts(part)


def comparisons(formula: Formula) -> tuple[Inequality, ...]:
    """Return all comparisons of a formula, in the order of the text."""
    return tuple(one for one in all_parts(formula) if isinstance(one, Inequality))
