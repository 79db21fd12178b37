"""How a kind of actuator declares itself: plain data, which scenarios, studies and results read."""

import pkgutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.core.declaration.keys import DispersibleQuantity, Key, Rule, require_own_keys


@dataclass(frozen=True)
class Signal:
    """What devices do or store, as the history of a run has it.

    `name` is that in the `Signals` of a run, `units` are those of a data set ("rad s-1").
    One that is not `each` device's is that of all together. The summary of a run tells the largest
    size of a `peak`. A `mean` is that of the time until the next saved instant, whichever are
    saved. A `total` is counted from the start. A study keeps the totals at the end of a case, and
    of what devices store the peaks, if the signal has a name for that of them all, `overall`. One
    that is `mute` is not shown where it is zero throughout. With a `shape` replays draw each device
    along its key `axis`, and an arrow as long as the signal is of the key `limit`: a disc in the
    body's side, or a rod through the body.
    """

    name: str
    units: str
    meaning: str
    each: bool = True
    peak: bool = False
    mean: bool = False
    total: bool = False
    overall: str = ""
    mute: bool = False
    shape: Literal["disc", "rod"] | None = None
    limit: str = ""

    @property
    def column(self) -> str | None:
        """What a study has of it in every case: the name of a column, None for nothing."""
        return (self.name if self.total else f"peak_{self.name}") if self.overall else None


@dataclass(frozen=True)
class EffectorDeclaration:
    """All that is known of a part that acts on the body, without its equations.

    - `name`: of its tables `[[name]]`.
    - `summary`: one line, what one of them is.
    - `most`: how many tables there may be.
    - `meaning`: one line, for the schema.
    - `keys`: those of a table, without `name` and `type`, which every part has.
    - `maker`: "module:Class.method" of the function that makes an `AbstractEffector` of checked
      tables and an `EffectorContext`; None for actuators that are no effector of the body.
      Nothing is imported before it is used.
    - `rules`: rules across keys.
    - `dispersible`: quantities that a study can draw; the class of the effector has under
      `dispersible` what they change.
    - `signals`: what results have of its devices.
    - `called`: one of them in words, by default the name.
    - `momentum`: of devices that store momentum at the start, the key that tells it (N m s) and
      the dispersible quantity that changes it; None for others.

    One that is no `ActuatorDeclaration` is passive: nothing commands it, and it does not fail.
    """

    name: str
    summary: str
    most: int
    meaning: str
    keys: tuple[Key, ...]
    maker: str | None = None
    rules: tuple[Rule, ...] = ()
    dispersible: tuple[DispersibleQuantity, ...] = ()
    signals: tuple[Signal, ...] = ()
    called: str = ""
    momentum: tuple[str, str] | None = None

    def __post_init__(self):
        require_own_keys(self.keys, "actuator", ("name", "type", "failed"))
        object.__setattr__(self, "called", self.called or self.name)

    @property
    def effector(self) -> Any:
        """The class of the effector."""
        assert self.maker is not None
        return pkgutil.resolve_name(self.maker.rpartition(".")[0])

    @property
    def from_tables(self) -> Callable[[Sequence[Any], Any], Any]:
        """What makes the effector of checked tables and an `EffectorContext`."""
        assert self.maker is not None
        return pkgutil.resolve_name(self.maker)


@dataclass(frozen=True, kw_only=True)
class ActuatorDeclaration(EffectorDeclaration):
    """All that is known of a kind of actuator without its equations, which goes by its name.

    - `failed`: what it means that one has failed before the start, a key of every table.
    - `kinds`: how one of them may fail in flight, members of one enumeration.
    - `idle`: those that change nothing of one that has failed before the start.
    - `drawn`: those that a study can draw, the first ones of their enumeration.
    - `both_signs`: whether what is stuck may be stuck either way.
    - `steering`: "module:Class.method" of the function that makes an `AbstractSteering` of the
      effector, its checked tables and a `SteeringContext`: how it takes its part of a command of
      three torques before others; None for actuators that have no steering of their own.
    - `judged`: whether the verdict on controllability counts it with the others.
    - `numbered`: what is to say of the numbers by which a study draws them.
    """

    failed: str
    kinds: tuple[AbstractFailureKind, ...]
    idle: tuple[AbstractFailureKind, ...]
    drawn: tuple[AbstractFailureKind, ...]
    both_signs: bool = False
    steering: str | None = None
    judged: bool = False
    numbered: str = ""

    @property
    def failed_quantity(self) -> DispersibleQuantity:
        """The number of what fails, as a study can draw it."""
        return DispersibleQuantity(
            f"failed_{self.name}",
            f"number from 0, rounded, of the {self.called} that each [[failure]] of one "
            f"strikes{self.numbered}",
        )

    @property
    def drawn_kinds(self) -> str:
        """The numbers by which kinds of failure are drawn, and the key of each one's amount."""
        names = (
            f"{kind:d} {kind.word}" + "".join(f" ({key})" for key in kind.keys)
            for kind in self.drawn
        )
        return f"of a {self.name} {', '.join(names)}"
