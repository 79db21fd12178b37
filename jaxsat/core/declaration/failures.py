"""Kinds of failure of actuators and sensors, with their text in a scenario, number and meaning.

The number is used in compiled programs, in the codes of stores, and in draws of a study.
"""

import enum
from collections.abc import Iterable
from typing import Any

from jaxsat.core.declaration.keys import Key, Numeric, number
from jaxsat.core.ranges import FROM_ZERO, ROTATION

FRACTION = number(
    "fraction",
    "How much, of full thrust or torque or of time; below 0 only of a torque of either sign that "
    "is stuck",
    at_least=-1,
    at_most=1,
    default=None,
)
DELAY = number("delay_s", "How much later its valve follows", within=FROM_ZERO, default=None)
TURN = number(
    "turn_rad",
    "Rotation vector by which its force, or its torque where only that is given, is turned, body "
    "axes",
    within=ROTATION,
    size=3,
    default=None,
)


class AbstractFailureKind(enum.IntEnum):
    """A kind of failure: its number, its `text` in a scenario, and its `meaning`.

    `amounts` are declared keys of `[[failure]]`, all of which give the amount; empty for a kind
    without an amount. Kinds with the same text are alternatives.
    """

    text: str
    meaning: str
    amounts: tuple[Key, ...]

    def __new__(cls, number: int, text: str, meaning: str, *amounts: Key) -> "AbstractFailureKind":
        """Make a member, which is declared as a tuple of these arguments."""
        member = int.__new__(cls, number)
        member._value_ = number
        member.text, member.meaning, member.amounts = text, meaning, amounts
        return member

    @property
    def keys(self) -> tuple[str, ...]:
        """Names of the keys of the kind's amount."""
        return tuple(one.name for one in self.amounts)

    @property
    def word(self) -> str:
        """Name of the kind in words."""
        return self.name.lower().replace("_", " ")

    @property
    def one_number(self) -> bool:
        """Whether the amount begins with one number; a turn has three, and most kinds have none."""
        sizes = (one.kind.size for one in self.amounts if isinstance(one.kind, Numeric))
        return bool(self.amounts) and not any(sizes)

    def amount(self, table: Any) -> float:
        """Return the amount in a checked table `[[failure]]`; 0 unless it is one number."""
        amounts = (getattr(table, key) for key in self.keys if self.one_number)
        return next((amount for amount in amounts if amount is not None), 0.0)


class FailureKind(AbstractFailureKind):
    """Kinds of failure of a thruster or a magnetorquer."""

    DEAD = 0, "dead", "no torque any more"
    DEGRADED = 1, "degraded", "a fraction of the torque that it should make", FRACTION
    STUCK_ON = 2, "stuck-on", "full thrust, or the limit of its dipole, all the time"
    STUCK_AT = 3, "stuck-at", "a fraction of that all the time", FRACTION
    LEAKING = 4, "leaking", "never less than a fraction of full thrust", FRACTION
    DELAYED = 5, "delayed", "its valve follows delay_s later", DELAY
    INTERMITTENT = 6, "intermittent", "off for a fraction of every 10 s", FRACTION
    TURNED = 7, "turned", "its force or torque is turned by turn_rad", TURN
    REVERSED = 8, "reversed", "the opposite of the torque that it should make"


ONE_WAY = (FailureKind.STUCK_ON, FailureKind.STUCK_AT, FailureKind.LEAKING)
"""Consecutive kinds that strike one of the two valves of a two-sided thruster."""


def failure_kind(kinds: Iterable[AbstractFailureKind], table: Any) -> AbstractFailureKind:
    """Return the kind of a checked table `[[failure]]` among those of the failed part.

    Among several with the same text the one whose amount is given.
    """
    alike = [kind for kind in kinds if kind.text == table.kind]
    matching = (one for one in alike if any(getattr(table, key) is not None for key in one.keys))
    return next(matching, alike[0])
