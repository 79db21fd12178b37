"""Controllability of a spacecraft from its inertia and torque axes alone."""

from jaxsat.controllability.closed_forms import (
    ClosedForm,
    one_thruster_condition,
    two_thruster_condition,
)
from jaxsat.controllability.closure import (
    controllability_margin,
    generating_vectors,
    generator_names,
    singular_values,
    symmetric_product,
)
from jaxsat.controllability.lie import (
    ControlField,
    DriftField,
    LieBracket,
    bracket_words,
    control_fields,
    lie_bracket,
    pack,
    tangent_matrix,
    to_tangent,
)
from jaxsat.controllability.linear import (
    LinearControllability,
    gramian,
    gramian_time_scales,
    linear_controllability,
    lvlh_linearisation,
)
from jaxsat.controllability.local import LocalControllability, small_time_local_controllability
from jaxsat.controllability.pointwise import rank_at_state
from jaxsat.controllability.rank import Analysis, analyse, ranks_elsewhere

__all__ = [
    "Analysis",
    "ClosedForm",
    "ControlField",
    "DriftField",
    "LieBracket",
    "LinearControllability",
    "LocalControllability",
    "analyse",
    "bracket_words",
    "control_fields",
    "controllability_margin",
    "generating_vectors",
    "generator_names",
    "gramian",
    "gramian_time_scales",
    "lie_bracket",
    "linear_controllability",
    "lvlh_linearisation",
    "one_thruster_condition",
    "pack",
    "rank_at_state",
    "ranks_elsewhere",
    "singular_values",
    "small_time_local_controllability",
    "symmetric_product",
    "tangent_matrix",
    "to_tangent",
    "two_thruster_condition",
]
