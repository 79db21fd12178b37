"""Request of an export: the closed loop, the start, and what all its files say of themselves."""

import hashlib
import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from jaxsat.compiler.c.naming import comment
from jaxsat.core.declaration.keys import Key
from jaxsat.core.declaration.sensors import HOLD_SAMPLES
from jaxsat.flight.program import FlightProgram
from jaxsat.simulation.loops import AbstractLoop
from jaxsat.spacecraft.dynamics import PlantState


@dataclass(frozen=True)
class Request:
    """Input of an export: a loop, a start and the duration (s) of test runs.

    `title`, `scenario` (TOML) and `provenance` (versions, platform, time) go into the files. `keys`
    are those that the law declares: they bound its parameters. `hold_samples` is the default of the
    guard: consecutive calls without a step for which commands are held. With `unit` there is a
    functional mock-up unit, too.
    """

    loop: AbstractLoop
    start: PlantState
    duration: float
    title: str
    scenario: str
    provenance: Mapping[str, Any]
    single: bool = False
    libm: bool = False
    keys: tuple[Key, ...] = ()
    hold_samples: int = HOLD_SAMPLES
    unit: bool = False

    def head(self) -> list[str]:
        """Return the comment that begins each file."""
        version = self.provenance["versions"]["jaxsat"]
        return comment(f"{self.title}. Written by jaxsat {version}; do not edit, export again.")

    def intro(self, program: FlightProgram) -> list[str]:
        """Return the comment that begins each file which depends on the traced program."""
        precision = "single" if program.single else "double"
        traced = comment(f"Traced program {program.hash}, {precision} precision.")
        return [*self.head(), *traced, ""]

    def record(self, program: FlightProgram, code: str) -> str:
        """Return export.json: provenance, layout of the structs, and the hash of the code."""
        layout = {
            name: [
                {
                    "name": field.name,
                    "path": field.path,
                    "shape": field.shape,
                    "type": str(field.dtype),
                }
                for field in struct.fields
            ]
            for name, struct in program.structs.items()
        }
        record = {
            "title": self.title,
            "program": program.hash,
            "source_sha256": hashlib.sha256(code.encode()).hexdigest(),
            "single": self.single,
            "libm": self.libm,
            "modes": program.modes,
            "layout": layout,
            **self.provenance,
        }
        return json.dumps(record, indent=2, ensure_ascii=False) + "\n"
