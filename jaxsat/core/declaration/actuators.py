"""Kinds of actuators and of passive parts that a scenario can have."""

import warnings
from importlib.metadata import entry_points

from jaxsat.core.declaration.actuator import ActuatorDeclaration, EffectorDeclaration
from jaxsat.core.declaration.flexible_modes import FLEXIBLE_MODE
from jaxsat.core.declaration.gimbals import GIMBAL
from jaxsat.core.declaration.magnetorquers import MAGNETORQUER
from jaxsat.core.declaration.thrusters import THRUSTER
from jaxsat.core.declaration.wheels import WHEEL
from jaxsat.core.errors import foreign_exceptions

OWN: tuple[ActuatorDeclaration, ...] = (THRUSTER, WHEEL, MAGNETORQUER, GIMBAL)
"""Actuators that come with jaxsat."""

PASSIVE: tuple[EffectorDeclaration, ...] = (FLEXIBLE_MODE,)
"""Parts of the body that move by themselves, uncommanded and unknown to the law."""

GROUP = "jaxsat.effectors"
"""Group of entry points of other packages, each an `ActuatorDeclaration`."""


def _installed() -> tuple[ActuatorDeclaration, ...]:
    """Return the actuators of installed packages; warns about each unusable one."""
    declarations: dict[str, ActuatorDeclaration] = {}
    for entry in sorted(entry_points(group=GROUP), key=lambda one: one.name):
        try:
            one = entry.load()
            _require_usable(one, (*OWN, *PASSIVE, *declarations.values()))
        except foreign_exceptions() as error:
            reason = f"{type(error).__name__}: {error}"
            text = f"Entry point {entry.name} of {GROUP}, {entry.value}, is left out: {reason}"
            warnings.warn(text, stacklevel=2)
        else:
            declarations[one.name] = one
    return tuple(declarations.values())


def _require_usable(one: object, others: tuple[EffectorDeclaration, ...]) -> None:
    """Raise `ValueError` unless `one` declares an effector with unique names."""
    if not isinstance(one, ActuatorDeclaration) or one.maker is None or one.steering is None:
        raise ValueError("must be an ActuatorDeclaration with a `maker` and a `steering`")
    other_names = {signal.name for other in others for signal in other.signals}
    other_names |= {quantity.name for other in others for quantity in other.dispersible}
    clashes = {two.name for two in (*one.signals, *one.dispersible)} & other_names
    clashes |= {one.name} & {other.name for other in others}
    if clashes:
        raise ValueError(f"must have names of its own, got {', '.join(sorted(clashes))} again")


ACTUATORS: tuple[ActuatorDeclaration, ...] = (*OWN, *_installed())
"""All actuators, in the order of the body's effectors."""

PARTS: tuple[EffectorDeclaration, ...] = (*ACTUATORS, *PASSIVE)
"""All actuators and passive parts, in the order of the body's effectors."""

EFFECTORS = tuple(one for one in PARTS if one.maker is not None)
"""Parts that are effectors of the body."""

SIGNALS = {signal.name: signal for one in PARTS for signal in one.signals}
"""Signals of all devices in results, by name."""

STUDIED = {one.column: (one, kind) for kind in PARTS for one in kind.signals if one.column}
"""Signals with a column in studies, by column name, with their parts."""

STEERED = tuple(one.name for one in ACTUATORS if one.steering)
"""Names of the actuators that have a steering of their own."""
