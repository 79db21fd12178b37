"""Declaration of a kind of actuator: plain data for scenarios, studies and results."""

import pkgutil
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any, Literal

from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.core.declaration.keys import DispersibleQuantity, Key, Rule, require_own_keys


@dataclass(frozen=True)
class Signal:
    """A signal of devices in the history of a run.

    `name` is the attribute of the `Signals` of a run, `units` are those of a data set ("rad s-1").
    Without `each` the signal is that of all devices together. The summary of a run has the largest
    size of a `peak`. A `mean` is over the time until the next saved instant. A `total` is
    accumulated from the start. If `overall` names the signal of all devices, a study keeps the
    total at the end of a case, or the peak. A `mute` signal is hidden where it is zero throughout.
    With a `shape` replays draw each device along its key `axis`, and an arrow with the signal's
    size over the key `limit`: a disc in the body's side, or a rod through the body.
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
        """Name of the column that a study has of the signal in every case, None without one."""
        return (self.name if self.total else f"peak_{self.name}") if self.overall else None


@dataclass(frozen=True)
class EffectorDeclaration:
    """Everything known of a part that acts on the body, except its equations.

    - `name`: of its tables `[[name]]`.
    - `summary`: one line that describes one such part.
    - `most`: largest number of tables.
    - `meaning`: one line, for the schema.
    - `keys`: those of a table, without `name` and `type`, which every part has.
    - `maker`: "module:Class.method" of the function that returns an `AbstractEffector` from checked
      tables and an `EffectorContext`; None for actuators that are no effector of the body. Imports
      happen at first use.
    - `rules`: rules across keys.
    - `dispersible`: quantities that a study can draw; `dispersible` of the effector's class has
      their effects.
    - `signals`: signals of its devices in results.
    - `called`: name of one device in words, by default `name`.
    - `momentum`: for devices that store momentum at the start, its key (N m s) and the dispersible
      quantity that changes it; None for others.

    A part that is no `ActuatorDeclaration` is passive: it takes no command and does not fail.
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
        """Class of the effector."""
        assert self.maker is not None
        return pkgutil.resolve_name(self.maker.rpartition(".")[0])

    @property
    def from_tables(self) -> Callable[[Sequence[Any], Any], Any]:
        """Function that returns the effector from checked tables and an `EffectorContext`."""
        assert self.maker is not None
        return pkgutil.resolve_name(self.maker)


@dataclass(frozen=True, kw_only=True)
class ActuatorDeclaration(EffectorDeclaration):
    """Everything known of a kind of actuator, identified by its name, except its equations.

    - `failed`: meaning of a failure before the start, a key of every table.
    - `kinds`: kinds of failure in flight, members of one enumeration.
    - `idle`: kinds without effect on an actuator that failed before the start.
    - `drawn`: kinds that a study can draw, the first ones of their enumeration.
    - `both_signs`: whether a stuck actuator may be stuck either way.
    - `steering`: "module:Class.method" of the function that returns an `AbstractSteering` from the
      effector, its checked tables and a `SteeringContext`: the part that the actuators take of a
      command of three torques before others; None for actuators without a steering of their own.
    - `judged`: whether the verdict on controllability counts the actuator with the others.
    - `numbered`: remark about the numbers by which a study draws the actuators.
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
        """Number of the failed actuator, as a study can draw it."""
        return DispersibleQuantity(
            f"failed_{self.name}",
            f"number from 0, rounded, of the {self.called} that each [[failure]] of one "
            f"strikes{self.numbered}",
        )

    @property
    def drawn_kinds(self) -> str:
        """Numbers by which kinds of failure are drawn, and the key of each kind's amount."""
        names = (
            f"{kind:d} {kind.word}" + "".join(f" ({key})" for key in kind.keys)
            for kind in self.drawn
        )
        return f"of a {self.name} {', '.join(names)}"
