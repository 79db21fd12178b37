"""Controllability of a spacecraft from its inertia and torque axes alone."""

from jaxsat.controllability.actuators import ActuatorSet, actuator_set, thruster_torques
from jaxsat.controllability.closure import (
    controllability_margin,
    generating_vectors,
    generator_names,
    singular_values,
    symmetric_product,
)
from jaxsat.controllability.cone import (
    TorqueCone,
    momentum_barrier,
    separatrix_normals,
    torque_cone,
)
from jaxsat.controllability.decision import (
    ClosedForm,
    one_thruster_condition,
    turn_time,
    two_thruster_condition,
)
from jaxsat.controllability.drift import (
    DriftTrajectory,
    EnergyCounterexample,
    Recurrence,
    divergence,
    drift_trajectory,
    energy_bound,
    energy_counterexample,
    energy_history,
    recurrence,
)
from jaxsat.controllability.failures import (
    FailureCase,
    failure_arrays,
    failure_csv,
    failure_markdown,
    failure_records,
    failure_table,
)
from jaxsat.controllability.gyros import GyroCluster
from jaxsat.controllability.judgement import Judgement
from jaxsat.controllability.judging import judge, judge_once_stopped
from jaxsat.controllability.lie import (
    ControlField,
    DriftField,
    LieBracket,
    bracket_words,
    control_fields,
    lie_bracket,
    pack,
    rank_at_state,
    tangent_matrix,
    to_tangent,
)
from jaxsat.controllability.linear import (
    LinearControllability,
    NoEquilibriumError,
    gramian_time_scales,
    linear_controllability,
    lvlh_linearisation,
)
from jaxsat.controllability.local import LocalControllability, small_time_local_controllability
from jaxsat.controllability.magnetic import (
    MagneticAuthority,
    magnetic_authority,
    magnetic_law_words,
    magnetic_verdict,
    magnetic_words,
)
from jaxsat.controllability.maps import (
    angle_grid,
    margins_over_angles,
    margins_over_inertias,
    physical_inertias,
    uncontrollable_single_directions,
)
from jaxsat.controllability.net_force import NetForce, net_force
from jaxsat.controllability.rank import Analysis, analyse, ranks_away_from_rest
from jaxsat.controllability.torque_ranges import judge_ranges, opposing_share, torque_reserve
from jaxsat.controllability.wheels import MomentumLevelSet, momentum_level_set
from jaxsat.controllability.wording import verdict_sentence

__all__ = [
    "ActuatorSet",
    "Analysis",
    "ClosedForm",
    "ControlField",
    "DriftField",
    "DriftTrajectory",
    "EnergyCounterexample",
    "FailureCase",
    "GyroCluster",
    "Judgement",
    "LieBracket",
    "LinearControllability",
    "LocalControllability",
    "MagneticAuthority",
    "MomentumLevelSet",
    "NetForce",
    "NoEquilibriumError",
    "Recurrence",
    "TorqueCone",
    "actuator_set",
    "analyse",
    "angle_grid",
    "bracket_words",
    "control_fields",
    "controllability_margin",
    "divergence",
    "drift_trajectory",
    "energy_bound",
    "energy_counterexample",
    "energy_history",
    "failure_arrays",
    "failure_csv",
    "failure_markdown",
    "failure_records",
    "failure_table",
    "generating_vectors",
    "generator_names",
    "gramian_time_scales",
    "judge",
    "judge_once_stopped",
    "judge_ranges",
    "lie_bracket",
    "linear_controllability",
    "lvlh_linearisation",
    "magnetic_authority",
    "magnetic_law_words",
    "magnetic_verdict",
    "magnetic_words",
    "margins_over_angles",
    "margins_over_inertias",
    "momentum_barrier",
    "momentum_level_set",
    "net_force",
    "one_thruster_condition",
    "opposing_share",
    "pack",
    "physical_inertias",
    "rank_at_state",
    "ranks_away_from_rest",
    "recurrence",
    "separatrix_normals",
    "singular_values",
    "small_time_local_controllability",
    "symmetric_product",
    "tangent_matrix",
    "thruster_torques",
    "to_tangent",
    "torque_cone",
    "torque_reserve",
    "turn_time",
    "two_thruster_condition",
    "uncontrollable_single_directions",
    "verdict_sentence",
]
