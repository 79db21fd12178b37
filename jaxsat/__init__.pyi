# The names for users; `__init__.py` imports each from here when it is first used.
from jaxsat.scenario.build.datasets import replay_case as replay_case
from jaxsat.scenario.build.errors import BuildError as BuildError
from jaxsat.scenario.build.load import load as load
from jaxsat.scenario.build.run import Run as Run, build as build
from jaxsat.scenario.build.study import build_study as build_study
from jaxsat.core.attitude import DCM as DCM, WZ as WZ, Quaternion as Quaternion
from jaxsat.synthesis.enclosure.tube import Tube as Tube, enclose as enclose
from jaxsat.synthesis.optima.run import bound as bound
from jaxsat.synthesis.optima.search import Bound as Bound
from jaxsat.synthesis.comparison.acceptance import (
    ComparisonSetting as ComparisonSetting,
    comparison_scenario as comparison_scenario,
)
from jaxsat.synthesis.comparison.front import Front as Front, front as front
from jaxsat.synthesis.comparison.in_scenario import compare_in_scenario as compare_in_scenario
from jaxsat.synthesis.comparison.run import Comparison as Comparison, compare as compare
from jaxsat.synthesis.comparison.verdict import (
    ComparisonRow as ComparisonRow,
    ComparisonVerdict as ComparisonVerdict,
)
from jaxsat.control.controller import (
    AbstractController as AbstractController,
    AbstractFeedbackLaw as AbstractFeedbackLaw,
    LawContext as LawContext,
)
from jaxsat.control.sampled import AbstractSampledController as AbstractSampledController
from jaxsat.controllability.failures import failure_table as failure_table
from jaxsat.controllability.linear import NoEquilibriumError as NoEquilibriumError
from jaxsat.controllability.rank import Analysis as Analysis, analyse as analyse
from jaxsat.synthesis.controller_design.request import read_vehicle as read_vehicle
from jaxsat.synthesis.controller_design.result import ControllerDesign as ControllerDesign
from jaxsat.synthesis.controller_design.run import design as design
from jaxsat.synthesis.execution import Execution as Execution, Listener as Listener
from jaxsat.core.declaration import (
    LawDeclaration as LawDeclaration,
    PartDeclaration as PartDeclaration,
    VectorDeclaration as VectorDeclaration,
)
from jaxsat.spacecraft.dynamics import PlantState as PlantState, RigidBody as RigidBody
from jaxsat.compiler import CannotLower as CannotLower
from jaxsat.simulation.engine.adaptive import (
    AdaptiveStepper as AdaptiveStepper,
    Tolerance as Tolerance,
)
from jaxsat.simulation.engine.fixed import FixedStepper as FixedStepper
from jaxsat.simulation.engine.native import NativeEngine as NativeEngine
from jaxsat.simulation.engine.program import Program as Program, program_of as program_of
from jaxsat.simulation.engine.progress import Outputs as Outputs
from jaxsat.simulation.engine.reference import ReferenceEngine as ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine as ScanEngine
from jaxsat.spacecraft.environment.disturbances import (
    AbstractDisturbance as AbstractDisturbance,
    DisturbanceContext as DisturbanceContext,
)
from jaxsat.spacecraft.environment.orbit import ExactOrbit as ExactOrbit
from jaxsat.spacecraft.environment.sensed_vectors import (
    AbstractSensedVector as AbstractSensedVector,
)
from jaxsat.spacecraft.navigation_sensors import SensorContext as SensorContext
from jaxsat.core.errors import (
    ArgumentError as ArgumentError,
    JaxsatError as JaxsatError,
    PrecisionError as PrecisionError,
)
from jaxsat.studies.dispersions import Dispersed as Dispersed, Dispersions as Dispersions
from jaxsat.studies.ensemble import Study as Study
from jaxsat.studies.executors import ClusterError as ClusterError
from jaxsat.studies.run import run_study as run_study
from jaxsat.studies.summary import Summary as Summary, summarise as summarise
from jaxsat.store.dataset import open_trajectory as open_trajectory
from jaxsat.store.files import OutputError as OutputError
from jaxsat.store.tables import case_table as case_table, open_study as open_study
from jaxsat.report.results import (
    Flight as Flight,
    StudyResults as StudyResults,
    fly as fly,
)
from jaxsat.scenario import (
    Scenario as Scenario,
    ScenarioError as ScenarioError,
    ScenarioWarning as ScenarioWarning,
    dump as dump,
    library as library,
)
from jaxsat.simulation.engine.single import simulate as simulate
from jaxsat.simulation.error_coordinates import ErrorCoordinateLoop as ErrorCoordinateLoop
from jaxsat.simulation.loops import ContinuousLoop as ContinuousLoop
from jaxsat.simulation.methods import adaptive as adaptive, fixed as fixed
from jaxsat.simulation.sampled_loop import SampledLoop as SampledLoop
from jaxsat.simulation.trajectory import (
    Outcome as Outcome,
    Signals as Signals,
    Trajectory as Trajectory,
)
from jaxsat.synthesis.tuning.descent import DescentProgress as DescentProgress
from jaxsat.synthesis.tuning.run import TuningResult as TuningResult, tune as tune
from jaxsat.spacecraft.actuators import (
    AbstractActuators as AbstractActuators,
    AbstractSmoothActuators as AbstractSmoothActuators,
    ActuatorContext as ActuatorContext,
    Actuators as Actuators,
)
from jaxsat.spacecraft.spacecraft import Spacecraft as Spacecraft
from jaxsat.spacecraft.thrusters import Thrusters as Thrusters
from jaxsat.synthesis.rare_events.result import RareEvent as RareEvent
from jaxsat.synthesis.rare_events.run import rare_event as rare_event
from jaxsat.synthesis.verification.result import Verification as Verification
from jaxsat.synthesis.verification.run import verify as verify
from jaxsat.synthesis.worst_case.run import WorstCase as WorstCase, worst_case as worst_case

__version__: str
IMPORTED_NS: int
