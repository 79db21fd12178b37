"""What disturbances and actuators declare, and what they are built from."""

from dataclasses import dataclass
from typing import TYPE_CHECKING, NamedTuple

import numpy as np
from jaxtyping import Float

from jaxsat.declaration.keys import Key

if TYPE_CHECKING:
    from jaxsat.vehicle import Actuators


@dataclass(frozen=True)
class PartDeclaration:
    """What a scenario needs to know of a disturbance or of actuators.

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


class DisturbanceContext(NamedTuple):
    """What a scenario tells a disturbance besides its own keys.

    The nominal `inertia` (kg m²) and `orbit_rate` (rad/s).
    """

    inertia: Float[np.ndarray, "3 3"]
    orbit_rate: float


class ActuatorContext(NamedTuple):
    """What a scenario tells actuators besides their own keys.

    `ideal` are the working thrusters as jaxsat has them without actuators of another kind: torque
    axes, how the command is shared among them, and their limit. The law commands `torques` torques,
    2 or 3, or 0 for none.
    """

    ideal: "Actuators"
    torques: int
