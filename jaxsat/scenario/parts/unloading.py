"""`[unloading]`: momentum unloading of wheels by magnetorquers."""

from typing import Annotated

import numpy as np

from jaxsat.core.ranges import SECONDS
from jaxsat.scenario.parts.torque_makers import MISSING, left_by_wheels
from jaxsat.scenario.quantities import Number, ScenarioTable, quantity, within
from jaxsat.scenario.rules import at, rule
from jaxsat.scenario.wording import shown


class UnloadingTable(ScenarioTable):
    """`[unloading]`: unloading of wheels by magnetorquers, or regulation of a momentum bias."""

    time_constant_s: Annotated[Number, within(SECONDS)] = quantity(
        "Time in which the wheels' momentum across the Earth's field is to fall to 1/e", "s", 1000.0
    )
    bias_N_m_s: Number = quantity(
        "Momentum of the wheels about negative body y, in the orbit frame the orbit normal, that "
        "magnetorquers keep",
        "N m s",
        0.0,
    )


@rule("unloading.bias_N_m_s", "wheel")
def _wheels_hold_the_bias(bias, wheels):
    if not bias or not wheels:
        return
    missing = left_by_wheels(wheels, 3) @ [0.0, bias, 0.0]
    if np.abs(missing).max() > MISSING * abs(bias):
        message = "must be 0 where the wheels left make no torque about body y alone"
        yield at("unloading.bias_N_m_s", f"{message}, got {shown(bias)}")


@rule("unloading.time_constant_s", "magnetorquer", "wheel")
def _unloading_has_both(time, magnetorquers, wheels):
    tables = {"[[wheel]]": wheels, "[[magnetorquer]]": magnetorquers}
    missing = " and ".join(name for name, rows in tables.items() if not rows)
    if missing:
        message = "must belong to wheels and magnetorquers that unload them"
        yield at("unloading", f"{message}, got time_constant_s = {shown(time)} without {missing}")
