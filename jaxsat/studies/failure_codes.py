"""Codes of failures and of diagnostic verdicts in a store."""

import enum

from jaxsat.control.diagnosis.isolation import DiagnosedKind
from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.declaration.failures import AbstractFailureKind

NEVER = 0
"""Code of a failure that does not strike within the horizon, and of no verdict."""


def words(kinds: type[enum.IntEnum]) -> tuple[str, ...]:
    """Names of an enumeration as words."""
    return tuple(kind.name.lower().replace("_", " ") for kind in kinds)


_KINDS: dict[type[AbstractFailureKind], str] = {}
"""Enumerations of kinds, each with the name of the first actuator that has it."""

for _one in ACTUATORS:
    _KINDS.setdefault(type(_one.kinds[0]), _one.name)

CODES: dict[int, AbstractFailureKind] = dict(
    enumerate((kind for kinds in _KINDS for kind in kinds), 1)
)
"""Kind of failure by its code in `failure_kind`."""


def _words(kind: AbstractFailureKind) -> str:
    actuator = _KINDS[type(kind)]
    return kind.word if actuator == ACTUATORS[0].name else f"{actuator} {kind.word}"


FAILURES = ("none", *map(_words, CODES.values()))
"""Names of the codes of `failure_kind`."""

DIAGNOSED = ("none", *words(DiagnosedKind))
"""Names of the codes of `isolated_kind`."""


def first_code(kinds: type[AbstractFailureKind]) -> int:
    """Return the code of the first of these kinds of failure."""
    return next(code for code, kind in CODES.items() if isinstance(kind, kinds))


AMOUNTLESS = ("none", *(FAILURES[code] for code, kind in CODES.items() if not kind.one_number))
"""Names of failures that have no amount."""

_VERDICTS = {kind.text: 1 + kind for kind in DiagnosedKind}

HYPOTHESES = {code: _VERDICTS[kind.text] for code, kind in CODES.items() if kind.text in _VERDICTS}
"""Correct verdict for each failure code of a thruster or wheel, if there is one."""
