"""Controllability of a spacecraft from its inertia and its actuators."""

from jaxsat.controllability.actuators import actuator_set as actuator_set
from jaxsat.controllability.decision import one_thruster_condition as one_thruster_condition
from jaxsat.controllability.drift import divergence as divergence
from jaxsat.controllability.drift import energy_bound as energy_bound
from jaxsat.controllability.drift import energy_counterexample as energy_counterexample
from jaxsat.controllability.drift import recurrence as recurrence
from jaxsat.controllability.failures import failure_markdown as failure_markdown
from jaxsat.controllability.failures import failure_records as failure_records
from jaxsat.controllability.failures import failure_table as failure_table
from jaxsat.controllability.judging import judge as judge
from jaxsat.controllability.lie import DriftField as DriftField
from jaxsat.controllability.lie import bracket_words as bracket_words
from jaxsat.controllability.lie import control_fields as control_fields
from jaxsat.controllability.lie import lie_bracket as lie_bracket
from jaxsat.controllability.lie import pack as pack
from jaxsat.controllability.lie import tangent_matrix as tangent_matrix
from jaxsat.controllability.lie import to_tangent as to_tangent
from jaxsat.controllability.linear import gramian_time_scales as gramian_time_scales
from jaxsat.controllability.linear import linear_controllability as linear_controllability
from jaxsat.controllability.local import (
    small_time_local_controllability as small_time_local_controllability,
)
from jaxsat.controllability.maps import angle_grid as angle_grid
from jaxsat.controllability.maps import margins_over_angles as margins_over_angles
from jaxsat.controllability.maps import margins_over_inertias as margins_over_inertias
from jaxsat.controllability.maps import physical_inertias as physical_inertias
from jaxsat.controllability.maps import (
    uncontrollable_single_directions as uncontrollable_single_directions,
)
from jaxsat.controllability.net_forces import net_force as net_force
from jaxsat.controllability.rank import analyse as analyse
from jaxsat.controllability.wording import verdict_sentence as verdict_sentence
