"""How the parts that a scenario names declare themselves. Plain data: needs no JAX."""

from jaxsat.declaration.keys import (
    LARGEST,
    Choice,
    Finding,
    Key,
    Numeric,
    Rule,
    Switch,
    choice,
    number,
    switch,
)
from jaxsat.declaration.law import LawContext, LawDeclaration, UnsuitableModel
from jaxsat.declaration.part import ActuatorContext, DisturbanceContext, PartDeclaration

__all__ = [
    "LARGEST",
    "ActuatorContext",
    "Choice",
    "DisturbanceContext",
    "Finding",
    "Key",
    "LawContext",
    "LawDeclaration",
    "Numeric",
    "PartDeclaration",
    "Rule",
    "Switch",
    "UnsuitableModel",
    "choice",
    "number",
    "switch",
]
