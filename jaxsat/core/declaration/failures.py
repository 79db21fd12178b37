"""How actuators fail: the kinds, with the text that a scenario has, the number and the meaning.

The number stands in compiled programs, in the codes of stores, and in what a study draws.
"""

import enum
from collections.abc import Iterable
from typing import Any


class AbstractFailureKind(enum.IntEnum):
    """A kind of failure: its number, its `text` in a scenario, and its `meaning`.

    `keys` are those of `[[failure]]` of which one tells how much, none for a kind that has no
    amount.
    """

    text: str
    meaning: str
    keys: tuple[str, ...]

    def __new__(cls, number: int, text: str, meaning: str, *keys: str) -> "AbstractFailureKind":
        """A member, declared as a tuple of these."""
        member = int.__new__(cls, number)
        member._value_ = number
        member.text, member.meaning, member.keys = text, meaning, keys
        return member

    @property
    def word(self) -> str:
        """Its name in words."""
        return self.name.lower().replace("_", " ")

    @property
    def one_number(self) -> bool:
        """Whether its amount is one number; a turn has three, and most kinds have none."""
        return bool(self.keys) and self.keys != ("turn_rad",)

    def amount(self, table: Any) -> float:
        """How much a checked table `[[failure]]` tells; 0 where that is no one number."""
        amounts = (getattr(table, key) for key in self.keys if self.one_number)
        return next((amount for amount in amounts if amount is not None), 0.0)


class FailureKind(AbstractFailureKind):
    """How a thruster or a magnetorquer fails."""

    DEAD = 0, "dead", "no torque any more"
    DEGRADED = 1, "degraded", "a fraction of the torque that it should make", "fraction"
    STUCK_ON = 2, "stuck-on", "full thrust, or the limit of its dipole, all the time"
    STUCK_AT = 3, "stuck-at", "a fraction of that all the time", "fraction"
    LEAKING = 4, "leaking", "never less than a fraction of full thrust", "fraction"
    DELAYED = 5, "delayed", "its valve follows delay_s later", "delay_s"
    INTERMITTENT = 6, "intermittent", "off for a fraction of every 10 s", "fraction"
    TURNED = 7, "turned", "its force or torque is turned by turn_rad", "turn_rad"
    REVERSED = 8, "reversed", "the opposite of the torque that it should make"


ONE_WAY = (FailureKind.STUCK_ON, FailureKind.STUCK_AT, FailureKind.LEAKING)
"""Kinds, one after another, that strike one of the two valves of a two-sided thruster."""


def failure_kind(kinds: Iterable[AbstractFailureKind], table: Any) -> AbstractFailureKind:
    """The kind of a checked table `[[failure]]` among those of what it strikes.

    Of several with one text it is the one whose amount is given.
    """
    alike = [kind for kind in kinds if kind.text == table.kind]
    matching = (one for one in alike if any(getattr(table, key) is not None for key in one.keys))
    return next(matching, alike[0])
