"""Rules that lower primitives, by kind of primitive."""

from jaxsat.compiler.rules import calls as calls
from jaxsat.compiler.rules import composed as composed
from jaxsat.compiler.rules import control as control
from jaxsat.compiler.rules import elementwise as elementwise
from jaxsat.compiler.rules import indexing as indexing
from jaxsat.compiler.rules import linear_algebra as linear_algebra
from jaxsat.compiler.rules import mathematics as mathematics
from jaxsat.compiler.rules import random as random
from jaxsat.compiler.rules import reductions as reductions
from jaxsat.compiler.rules import structural as structural
from jaxsat.compiler.rules import windows as windows
