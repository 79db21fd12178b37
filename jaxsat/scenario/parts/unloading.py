"""`[unloading]`: how magnetorquers take momentum out of wheels."""

from typing import Annotated

from jaxsat.core.ranges import SECONDS
from jaxsat.scenario.quantities import (
    Number,
    ScenarioTable,
    quantity,
    within,
)
from jaxsat.scenario.rules import at, rule
from jaxsat.scenario.wording import shown


class UnloadingTable(ScenarioTable):
    """`[unloading]`: how magnetorquers take momentum out of wheels."""

    time_constant_s: Annotated[Number, within(SECONDS)] = quantity(
        "Time in which the wheels' momentum across the Earth's field is to fall to 1/e", "s", 1000.0
    )


@rule("unloading.time_constant_s", "magnetorquer", "wheel")
def _unloading_has_both(time, magnetorquers, wheels):
    tables = {"[[wheel]]": wheels, "[[magnetorquer]]": magnetorquers}
    missing = " and ".join(name for name, given in tables.items() if not given)
    if missing:
        message = "must belong to wheels and magnetorquers that unload them"
        yield at("unloading", f"{message}, got time_constant_s = {shown(time)} without {missing}")
