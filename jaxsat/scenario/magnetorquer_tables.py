"""`[[magnetorquer]]`, `[unloading]`: dipoles in the Earth's field."""

from typing import Annotated

from jaxsat.core.ranges import DIPOLE_LIMIT, SECONDS
from jaxsat.scenario.quantities import Line, Number, Switch, Table, choice, quantity, within
from jaxsat.scenario.thruster_tables import Direction


class MagnetorquerTable(Table):
    """`[[magnetorquer]]`: one magnetorquer, a coil or rod."""

    name: Line | None = choice("A name of its own; by default it goes by its number from 1", None)
    axis: Direction = quantity("Direction of its dipole, body axes", "1")
    dipole_limit_A_m2: Annotated[Number, within(DIPOLE_LIMIT)] = quantity(
        "Largest dipole, either way", "A m²"
    )
    failed: Switch = choice("Whether it has failed before the start, and the law knows it", False)


class UnloadingTable(Table):
    """`[unloading]`: how magnetorquers take momentum out of wheels."""

    time_constant_s: Annotated[Number, within(SECONDS)] = quantity(
        "Time in which the wheels' momentum across the Earth's field is to fall to 1/e", "s", 1000.0
    )
