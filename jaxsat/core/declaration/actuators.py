"""The kinds of actuators that a scenario can have."""

from jaxsat.core.declaration.actuator import ActuatorDeclaration
from jaxsat.core.declaration.gimbals import GIMBAL
from jaxsat.core.declaration.magnetorquers import MAGNETORQUER
from jaxsat.core.declaration.thrusters import THRUSTER
from jaxsat.core.declaration.wheels import WHEEL

ACTUATORS: tuple[ActuatorDeclaration, ...] = (THRUSTER, WHEEL, MAGNETORQUER, GIMBAL)
"""In the order in which the body has them."""

EFFECTORS = tuple(one for one in ACTUATORS if one.maker is not None)
"""Those that are effectors of the body."""

SIGNALS = {signal.name: signal for one in ACTUATORS for signal in one.signals}
"""What results have of the devices of all of them, by name."""

STUDIED = {one.column: (one, kind) for kind in ACTUATORS for one in kind.signals if one.column}
"""Those of which a study has a column, by its name, with their actuator."""

STEERED = tuple(one.name for one in ACTUATORS if one.steered)
"""The names of those that have a steering of their own."""
