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

__all__ = [
    "LARGEST",
    "Choice",
    "Finding",
    "Key",
    "LawContext",
    "LawDeclaration",
    "Numeric",
    "Rule",
    "Switch",
    "UnsuitableModel",
    "choice",
    "number",
    "switch",
]
