"""How the parts that a scenario names declare themselves. Plain data: needs no JAX."""

from jaxsat.core.declaration.keys import (
    LARGEST,
    Choice,
    Direction,
    Finding,
    Key,
    Numeric,
    PartDeclaration,
    Rule,
    Switch,
    choice,
    direction,
    number,
    switch,
)
from jaxsat.core.declaration.law import LawDeclaration

__all__ = [
    "LARGEST",
    "Choice",
    "Direction",
    "Finding",
    "Key",
    "LawDeclaration",
    "Numeric",
    "PartDeclaration",
    "Rule",
    "Switch",
    "choice",
    "direction",
    "number",
    "switch",
]
