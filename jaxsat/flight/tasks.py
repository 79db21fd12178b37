"""freertos_task.c: an example of a task that runs an exported controller."""

import numpy as np

from jaxsat.flight.guard import real_type
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.templates import template


def freertos_task(program: FlightProgram) -> str:
    """The text of freertos_task.c; its period is that of the law in whole milliseconds."""
    period = float(np.asarray(program.period))
    real = real_type(program)
    begin = f"  const {real} attitude[4] = {{0}}; /* begin with the first that is measured */\n"
    return template(
        "freertos_task.c",
        PERIOD=f"{period:.9g}",
        PERIOD_MS=max(1, round(1000 * period)),
        BEGIN=begin * program.estimates,
        ATTITUDE="attitude, " * program.estimates,
    )
