"""Declarations of the parts that a scenario names: plain data without JAX."""

from jaxsat.core.declaration.keys import LARGEST as LARGEST
from jaxsat.core.declaration.keys import Choice as Choice
from jaxsat.core.declaration.keys import Direction as Direction
from jaxsat.core.declaration.keys import Finding as Finding
from jaxsat.core.declaration.keys import Key as Key
from jaxsat.core.declaration.keys import Numeric as Numeric
from jaxsat.core.declaration.keys import PartDeclaration as PartDeclaration
from jaxsat.core.declaration.keys import Rule as Rule
from jaxsat.core.declaration.keys import Switch as Switch
from jaxsat.core.declaration.keys import choice as choice
from jaxsat.core.declaration.keys import direction as direction
from jaxsat.core.declaration.keys import number as number
from jaxsat.core.declaration.keys import switch as switch
from jaxsat.core.declaration.law import LawDeclaration as LawDeclaration
from jaxsat.core.declaration.sensor import VectorDeclaration as VectorDeclaration
