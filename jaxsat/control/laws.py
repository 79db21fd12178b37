"""The control laws that a scenario can name."""

from collections.abc import Callable, Mapping
from types import MappingProxyType
from typing import Any, NamedTuple

from jaxsat.control.controller import AbstractBacksteppingLaw, AbstractController, Coast
from jaxsat.control.declaration import LawContext, LawDeclaration
from jaxsat.control.fine import OscillatorySettling
from jaxsat.control.rate import RateLaw
from jaxsat.control.settling_laws import (
    OSCILLATORY,
    THREE_SLEW,
    build_oscillatory,
    build_three_slew,
)
from jaxsat.control.supervisor import ThreeSlewSettling
from jaxsat.control.switching import AbstractSampledController, SwitchingLaw
from jaxsat.control.three_axis import ThreeAxisLaw


class Law(NamedTuple):
    """A law by its name: its class, what it declares, and how it is made of a checked table."""

    name: str
    controller: type[AbstractController] | type[AbstractSampledController]
    declaration: LawDeclaration
    from_table: Callable[
        [Mapping[str, Any], LawContext], AbstractController | AbstractSampledController
    ]

    @property
    def sampled(self) -> bool:
        """Whether the law runs once a period and its torque is held in between."""
        return issubclass(self.controller, AbstractSampledController)

    @property
    def tracks_rates(self) -> bool:
        """Whether the law has the form of (43), which error coordinates need."""
        return issubclass(self.controller, AbstractBacksteppingLaw)


def law_of(name: str, controller: Any) -> Law:
    """A law whose class carries its declaration and is built by `from_table`."""
    return Law(name, controller, controller.declaration, controller.from_table)


LAWS: Mapping[str, Law] = MappingProxyType(
    {
        law.name: law
        for law in (
            law_of("coast", Coast),
            law_of("rate", RateLaw),
            law_of("three-axis", ThreeAxisLaw),
            law_of("switching", SwitchingLaw),
            Law("oscillatory", OscillatorySettling, OSCILLATORY, build_oscillatory),
            Law("three-slew", ThreeSlewSettling, THREE_SLEW, build_three_slew),
        )
    }
)
"""Those that come with jaxsat."""
