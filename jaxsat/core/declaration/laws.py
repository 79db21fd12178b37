"""Control laws that a scenario can name."""

import pkgutil
import sys
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from importlib.metadata import entry_points
from types import MappingProxyType
from typing import Any

from jaxsat.core.declaration.law import LawDeclaration
from jaxsat.core.declaration.magnetic import MAGNETIC_CONTROL
from jaxsat.core.declaration.one_torque import ONE_TORQUE
from jaxsat.core.declaration.paper import RATE, SWITCHING, THREE_AXIS
from jaxsat.core.declaration.settling import OSCILLATORY, PLANNED, THREE_SLEW
from jaxsat.core.declaration.three_torques import FAULT_TOLERANT, QUATERNION_FEEDBACK


@dataclass(frozen=True)
class Law:
    """A law by its name: its declaration, and the import path of its class ("module:Class").

    `maker` is the function that returns the law from a checked table, the class's `from_table`
    unless given. Both are imported at first use.
    """

    name: str
    declaration: LawDeclaration
    place: str
    maker: str | None = None

    def __str__(self) -> str:
        """Return the name."""
        return self.name

    @property
    def controller(self) -> type:
        """Class of the law."""
        return pkgutil.resolve_name(self.place)

    @property
    def from_table(self) -> Callable[[Mapping[str, Any], Any], Any]:
        """Function that returns the law from a checked table and a `LawContext`."""
        if self.maker is None:
            return self.controller.from_table
        return pkgutil.resolve_name(self.maker)


LAW_GROUP = "jaxsat.laws"
"""Group of entry points by which packages name their laws."""

COAST = LawDeclaration(summary="no control", torques=0, has_model=False)

LAWS: Mapping[str, Law] = MappingProxyType(
    {
        law.name: law
        for law in (
            Law("coast", COAST, "jaxsat.control.controller:Coast"),
            Law("rate", RATE, "jaxsat.control.rate:RateLaw"),
            Law("three-axis", THREE_AXIS, "jaxsat.control.three_axis:ThreeAxisLaw"),
            Law(
                "quaternion-feedback",
                QUATERNION_FEEDBACK,
                "jaxsat.control.quaternion_feedback:QuaternionFeedback",
            ),
            Law(
                "fault-tolerant",
                FAULT_TOLERANT,
                "jaxsat.control.fault_tolerant:FaultTolerant",
                "jaxsat.control.fault_tolerant_law:build_fault_tolerant",
            ),
            Law("switching", SWITCHING, "jaxsat.control.switching:SwitchingLaw"),
            Law(
                "oscillatory",
                OSCILLATORY,
                "jaxsat.control.fine:OscillatorySettling",
                "jaxsat.control.settling_laws:build_oscillatory",
            ),
            Law(
                "three-slew",
                THREE_SLEW,
                "jaxsat.control.supervisor:ThreeSlewSettling",
                "jaxsat.control.settling_laws:build_three_slew",
            ),
            Law(
                "planned",
                PLANNED,
                "jaxsat.control.planned:PlannedSettling",
                "jaxsat.control.settling_laws:build_planned",
            ),
            Law("one-torque", ONE_TORQUE, "jaxsat.control.one_torque:OneTorque"),
            Law("magnetic", MAGNETIC_CONTROL, "jaxsat.control.magnetic:MagneticLaw"),
        )
    }
)
"""Laws that come with jaxsat, by name."""


def value_of(controller: type) -> str:
    """Return the value of `control.law` for laws of this class.

    That is the name of jaxsat's own law or an installed package's, and "module:Class" for others.
    """
    own = [law.name for law in LAWS.values() if _has(law.place, controller)]
    others = [one.name for one in entry_points(group=LAW_GROUP) if _has(one.value, controller)]
    return next(iter((*own, *others)), f"{controller.__module__}:{controller.__qualname__}")


def _has(place: str, controller: type) -> bool:
    """Whether a class stands at a place "module:name" of a module that is imported."""
    module, _, name = place.partition(" ")[0].partition(":")
    return getattr(sys.modules.get(module), name, None) is controller
