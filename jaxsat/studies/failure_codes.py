"""Codes of failures and of verdicts on them, as they stand in a store."""

import enum

from jaxsat.control.diagnosis.isolation import DiagnosedKind
from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.declaration.failures import AbstractFailureKind

NEVER = 0
"""The code of a failure that does not strike within the horizon, and of no verdict."""


def words(kinds: type[enum.IntEnum]) -> tuple[str, ...]:
    """The names of an enumeration as words."""
    return tuple(kind.name.lower().replace("_", " ") for kind in kinds)


_KINDS: dict[type[AbstractFailureKind], str] = {}
"""The enumerations of kinds, each with the name of the first actuator that has it."""

for _one in ACTUATORS:
    _KINDS.setdefault(type(_one.kinds[0]), _one.name)

_CODES: dict[int, AbstractFailureKind] = dict(
    enumerate((kind for kinds in _KINDS for kind in kinds), 1)
)
"""What strikes, by the code of `failure_kind`."""


def _words(kind: AbstractFailureKind) -> str:
    """A kind in words, with the actuator where that is no thruster."""
    actuator = _KINDS[type(kind)]
    return kind.word if actuator == ACTUATORS[0].name else f"{actuator} {kind.word}"


FAILURES = ("none", *map(_words, _CODES.values()))
"""What the codes of `failure_kind` stand for."""

DIAGNOSED = ("none", *words(DiagnosedKind))
"""What the codes of `isolated_kind` stand for."""


def first_code(kinds: type[AbstractFailureKind]) -> int:
    """The code of the first of these kinds of failure."""
    return next(code for code, kind in _CODES.items() if isinstance(kind, kinds))


AMOUNTLESS = ("none", *(FAILURES[code] for code, kind in _CODES.items() if not kind.one_number))
"""Failures that have no amount."""

_VERDICTS = {kind.text: 1 + kind for kind in DiagnosedKind}

HYPOTHESES = {code: _VERDICTS[kind.text] for code, kind in _CODES.items() if kind.text in _VERDICTS}
"""The verdict that is right for a failure of a thruster or wheel, where there is one."""
