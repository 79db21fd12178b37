"""What disturbances, actuators and estimators declare."""

from dataclasses import dataclass

from jaxsat.core.declaration.keys import Key


@dataclass(frozen=True)
class PartDeclaration:
    """What a scenario needs to know of a disturbance, of actuators or of an estimator.

    `summary` is one line, what the part does; `keys` are those of its table.
    """

    summary: str
    keys: tuple[Key, ...] = ()

    def __post_init__(self):
        names = [key.name for key in self.keys]
        for name in names:
            if name == "kind" or names.count(name) > 1:
                what = "a key of every part" if name == "kind" else "one of them twice"
                raise ValueError(f"Argument `keys` must be the part's own, but got {name}, {what}.")
