"""How a part that a scenario names, such as a control law, declares the keys of its table.

Plain data, without any library: the scenario makes its checks, messages and schema of it, and
tuning its search space.
"""

import dataclasses
import re
from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

from jaxsat.core.ranges import Range

LARGEST = 1e12
"""Size of a number whose declaration has no bound of its own."""


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
    """Three numbers, in body axes, of which only the direction counts; not all are zero."""


@dataclass(frozen=True)
class Key:
    """A key of a table; `number`, `direction`, `switch` and `choice` make one.

    `unit` is None for what is no quantity. With the default `...` the key must be given, and with
    None it may be left out. `tunable` is where the number stands in the object that is built, a
    dotted path of attributes, or None where it is not tuned. A `width` rounds a corner and may be
    replaced while gradients are taken. `drawn` is the name by which studies can draw the number of
    one of jaxsat's parts, whose field is called as the key without the unit.
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

    def _require_within(self, kind: Numeric) -> None:
        """Raise `ValueError` for a default that the key would not take."""
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
    unit: str = "1",
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
    """Declare a number, or a list of `size` of them, with its unit in SI ("1" for none).

    A `size` of (1, 3) is one number or a list of three.
    Its bounds are those of the range `within`, or each by itself. `tunable=True` says that
    `jaxsat tune` may change it and that the attribute of the built object has the name of the key;
    a text is its dotted path. Only numbers above 0 are tuned. See `Key` for `drawn`.
    """
    if within is not None:
        at_least, at_most = within
    *one, several = size if isinstance(size, tuple) else (size,)
    kind = Numeric(above, at_least, at_most, several, bool(one))
    path = name if tunable is True else tunable or None
    return Key(name, meaning, unit, kind, default, path, width, drawn)


def of_part(part: str, keys: Iterable[Key]) -> tuple[Key, ...]:
    """The keys of an object that is the attribute `part` of another, which has them as well."""
    return tuple(
        dataclasses.replace(key, tunable=key.tunable and f"{part}.{key.tunable}") for key in keys
    )


def with_unit(name: str, unit: str) -> str:
    """The key of a quantity: its name and its unit in SI, "rad_s" for rad/s, none for "1"."""
    plain = unit.replace("²", "2").replace("√", "sqrt_")
    return name if unit == "1" else f"{name}_{re.sub(r'[ /]', '_', plain)}"


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
    """What breaks a rule: a dotted key of the scenario, and "must …, got …" about it.

    Tables of an array are told apart by their numbers from 0: "wheel.0.axis". `missing` says that
    the key is not given.
    """

    key: str
    message: str
    missing: bool = False


@dataclass(frozen=True)
class Rule:
    """A rule across keys: `check` takes the values of `keys`, dotted keys of the scenario.

    It is applied where all of them are valid in themselves.
    """

    keys: tuple[str, ...]
    check: Callable[..., Iterator[Finding]]


def require_own_keys(keys: Sequence[Key], owner: str, common: Sequence[str]) -> None:
    """Raise `ValueError` for keys that an owner declares twice, or that every one has."""
    names = [key.name for key in keys]
    for name in names:
        if name in common or names.count(name) > 1:
            what = f"a key of every {owner}" if name in common else "one of them twice"
            raise ValueError(f"Argument `keys` must be the {owner}'s own, but got {name}, {what}.")


@dataclass(frozen=True)
class DispersibleQuantity:
    """A quantity that a study can draw for every case, with its unit in SI ("1" for none).

    Of an actuator's quantities those of the `stage` "body", which are drawn again until the body is
    possible, are applied first, and those of "start" last. It is not dispersed together with those
    that it `excludes`. Where `random_attitude` is true its distribution is "random-attitude", which
    no other quantity has. One that `turns` moves the initial attitude away from where the scenario
    has it. `axis` is what the axis of its numbers is called where there are several. A quantity
    that is one `field` of its part lies `within` a range, which `relative` changes do not leave.
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
        """Its key of `[dispersion]`: the name with the unit."""
        return with_unit(self.name, self.unit)


@dataclass(frozen=True)
class PartDeclaration:
    """What a scenario needs to know of a disturbance, of actuators, of a sensor or an estimator.

    `summary` is one line, what the part does; `keys` are those of its table. Of parts that come
    with jaxsat `dispersible` are quantities that a study can draw besides drawn keys, or in place
    of them, and `rules` tie keys.
    """

    summary: str
    keys: tuple[Key, ...] = ()
    dispersible: tuple[DispersibleQuantity, ...] = ()
    rules: tuple[Rule, ...] = ()

    def __post_init__(self):
        require_own_keys(self.keys, "part", ("kind",))

    @property
    def quantities(self) -> tuple[DispersibleQuantity, ...]:
        """All that a study can draw, drawn keys first."""
        drawn_keys = {key.drawn: _quantity_of(key) for key in self.keys if key.drawn is not None}
        return tuple((drawn_keys | {one.name: one for one in self.dispersible}).values())


def _quantity_of(key: Key) -> DispersibleQuantity:
    assert key.drawn is not None
    assert key.unit is not None
    assert isinstance(key.kind, Numeric)
    low = -LARGEST if key.kind.at_least is None else key.kind.at_least
    meaning = key.meaning.partition(";")[0]  # what comes by default is of the scenario alone
    return DispersibleQuantity(
        key.drawn,
        meaning[:1].lower() + meaning[1:],
        key.unit,
        field=key.name.removesuffix(with_unit("", key.unit)),
        within=Range(low, key.kind.at_most),
        axis="body_axis" if key.kind.size == 3 else None,
    )
