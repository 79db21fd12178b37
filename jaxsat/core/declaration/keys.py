"""Declaration of the keys of a part that a scenario names, such as a control law.

Plain data without any library: the scenario derives its checks, messages and schema from it, and
tuning its search space.
"""

import dataclasses
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from jaxsat.core.declaration.units import unit_of, with_unit
from jaxsat.core.ranges import Range

LARGEST = 1e12
"""Default upper bound of a number."""


@dataclass(frozen=True)
class Numeric:
    """Finite numbers within bounds: one, a list of `size`, or with `or_one` either of these."""

    above: float | int | None = None
    at_least: float | int | None = None
    at_most: float | int = LARGEST
    size: int | None = None
    or_one: bool = False


@dataclass(frozen=True)
class Switch:
    """True or false."""


@dataclass(frozen=True)
class Choice:
    """One of some texts."""

    among: tuple[str, ...]


@dataclass(frozen=True)
class Direction:
    """Direction in body axes, three numbers that are not all zero."""


@dataclass(frozen=True)
class Key:
    """A key of a table; `number`, `direction`, `switch` and `choice` make one.

    `unit` is None for a key that is no quantity. With the default `...` the key is required, and
    with None optional. `tunable` is the dotted path of the number's attribute in the built object,
    or None for keys that are not tuned. A `width` rounds a corner and may be replaced while
    gradients are taken. `drawn` is the name by which studies draw a number of one of jaxsat's
    parts, whose field has the key's name without the unit.
    """

    name: str
    meaning: str
    unit: str | None
    kind: Numeric | Switch | Choice | Direction
    default: Any = ...
    tunable: str | None = None
    width: bool = False
    drawn: str | None = None

    def __post_init__(self):
        if not self.name.isidentifier():
            raise ValueError(f"Argument `name` must be an identifier, but got {self.name!r}.")
        if isinstance(self.default, list):
            object.__setattr__(self, "default", tuple(self.default))
        if isinstance(self.kind, Numeric) and self.default not in (..., None):
            self._require_within(self.kind)

    @property
    def stem(self) -> str:
        """Name without the unit, such as that of the field of a built part."""
        return self.name if self.unit is None else self.name.removesuffix(with_unit("", self.unit))

    def _require_within(self, kind: Numeric) -> None:
        entries = self.default if isinstance(self.default, tuple) else (self.default,)
        for entry in entries:
            too_low = (kind.above is not None and not entry > kind.above) or (
                kind.at_least is not None and not entry >= kind.at_least
            )
            if too_low or not entry <= kind.at_most:
                raise ValueError(
                    f"Argument `default` of the key {self.name} must lie within its bounds, "
                    f"but got {entry!r}."
                )


def number(
    name: str,
    meaning: str,
    unit: str | None = None,
    *,
    within: Range | None = None,
    above: float | int | None = None,
    at_least: float | int | None = None,
    at_most: float | int = LARGEST,
    size: int | tuple[Literal[1], int] | None = None,
    default: Any = ...,
    tunable: bool | str = False,
    width: bool = False,
    drawn: str | None = None,
) -> Key:
    """Declare a number, or a list of `size` of them, with its unit in SI.

    The unit is by default that of `UNITS` with which the name ends, else "1", which is none. A
    `size` of (1, 3) is one number or a list of three.

    The bounds are those of the range `within`, or given one by one. `tunable=True` lets
    `jaxsat tune` change the attribute of the built object with the name of the key; a text is the
    attribute's dotted path. Only numbers above 0 are tuned. See `Key` for `drawn`.
    """
    if within is not None:
        at_least, at_most = within
    *one, several = size if isinstance(size, tuple) else (size,)
    kind = Numeric(above, at_least, at_most, several, bool(one))
    path = name if tunable is True else tunable or None
    return Key(name, meaning, unit or unit_of(name), kind, default, path, width, drawn)


def of_part(part: str, keys: Iterable[Key]) -> tuple[Key, ...]:
    """Return `keys` for an object whose attribute `part` is the one that has them."""
    return tuple(
        dataclasses.replace(key, tunable=key.tunable and f"{part}.{key.tunable}") for key in keys
    )


def direction(name: str, meaning: str, default: Any = ...) -> Key:
    """Declare a direction in body axes."""
    return Key(name, meaning, "1", Direction(), default)


def switch(name: str, meaning: str, default: Any = ...) -> Key:
    """Declare a key that is true or false."""
    return Key(name, meaning, None, Switch(), default)


def choice(name: str, meaning: str, among: tuple[str, ...], default: Any = ...) -> Key:
    """Declare a key that is one of some texts."""
    return Key(name, meaning, None, Choice(among), default)


class Finding(NamedTuple):
    """A broken rule: a dotted key of the scenario, and a message "must …, got …" about it.

    Tables of an array are numbered from 0: "wheel.0.axis". `missing` marks a key that is not given.
    """

    key: str
    message: str
    missing: bool = False


@dataclass(frozen=True)
class Rule:
    """A rule across keys: `check` takes the values of `keys`, dotted keys of the scenario.

    It is applied only if each of the values is valid by itself.
    """

    keys: tuple[str, ...]
    check: Callable[..., Iterator[Finding]]


def require_own_keys(keys: Sequence[Key], owner: str, common: Sequence[str]) -> None:
    """Raise `ValueError` for keys that an owner declares twice, or that every owner has."""
    names = [key.name for key in keys]
    for name in names:
        if name in common or names.count(name) > 1:
            what = f"a key of every {owner}" if name in common else "one of them twice"
            raise ValueError(f"Argument `keys` must be the {owner}'s own, but got {name}, {what}.")


@dataclass(frozen=True)
class DispersibleQuantity:
    """A quantity that a study can draw for every case, with its unit in SI ("1" for none).

    Quantities of an actuator with the `stage` "body" are applied first and redrawn until the body
    is possible, those of "start" last. A quantity is not dispersed together with those that it
    `excludes`. `random_attitude` marks the only quantity with the distribution "random-attitude". A
    quantity that `turns` moves the initial attitude away from the scenario's. `axis` names the axis
    of the quantity's numbers where there are several. A quantity that is one `field` of its part is
    `within` a range, which `relative` changes do not leave.
    """

    name: str
    meaning: str
    unit: str = "1"
    field: str | None = None
    within: Range | None = None
    relative: bool = False
    stage: Literal["body", "part", "start"] = "part"
    excludes: tuple[str, ...] = ()
    random_attitude: bool = False
    turns: bool = False
    axis: str | None = None

    @property
    def key(self) -> str:
        """Key of `[dispersion]`: the name with the unit."""
        return with_unit(self.name, self.unit)


@dataclass(frozen=True)
class PartDeclaration:
    """Declaration of a disturbance, of actuators, of a sensor or of an estimator for a scenario.

    `summary` is one line that describes the part; `keys` are those of its table. For parts that
    come with jaxsat `dispersible` are quantities that a study can draw besides or instead of drawn
    keys, and `rules` apply across keys.
    """

    summary: str
    keys: tuple[Key, ...] = ()
    dispersible: tuple[DispersibleQuantity, ...] = ()
    rules: tuple[Rule, ...] = ()

    def __post_init__(self):
        require_own_keys(self.keys, "part", ("kind",))

    @property
    def quantities(self) -> tuple[DispersibleQuantity, ...]:
        """All quantities that a study can draw, drawn keys first."""
        drawn_keys = {key.drawn: _quantity_of(key) for key in self.keys if key.drawn is not None}
        return tuple((drawn_keys | {one.name: one for one in self.dispersible}).values())


def _quantity_of(key: Key) -> DispersibleQuantity:
    assert key.drawn is not None
    assert key.unit is not None
    assert isinstance(key.kind, Numeric)
    low = -LARGEST if key.kind.at_least is None else key.kind.at_least
    meaning = key.meaning.partition(";")[0]  # defaults concern the scenario alone
    return DispersibleQuantity(
        key.drawn,
        meaning[:1].lower() + meaning[1:],
        key.unit,
        field=key.stem,
        within=Range(low, key.kind.at_most),
        axis="body_axis" if key.kind.size == 3 else None,
    )
