"""Gain tuning: gradient descent through the simulator, and the proof of what it found."""

from jaxsat.scenario.optimisers import OptimiserSettings
from jaxsat.synthesis.tuning.aggregates import (
    AbstractAggregate,
    ConditionalValueAtRisk,
    LossGradient,
    Mean,
    Objective,
    Quantile,
    TailCompression,
    WorstCase,
)
from jaxsat.synthesis.tuning.cost_evaluator import (
    CaseGradients,
    CaseWithGains,
    CostEvaluator,
    GradientMethod,
    TrajectoryCounter,
    WithGains,
)
from jaxsat.synthesis.tuning.descent import (
    DescentProgress,
    DescentState,
    StepRecord,
    ValidationRecord,
    descend,
    descent_step,
    initial_state,
)
from jaxsat.synthesis.tuning.parameters import Parameter, SearchSpace
from jaxsat.synthesis.tuning.plan import TuningPlan, TuningSettings
from jaxsat.synthesis.tuning.receipt import GradientCheck, Receipt, check_gradients, make_receipt
from jaxsat.synthesis.tuning.unusable import NoGradient
from jaxsat.synthesis.tuning.verdict import (
    GainEvaluation,
    TuningVerdict,
    evaluate_gains,
    make_verdict,
    mean_interval,
)

__all__ = [
    "AbstractAggregate",
    "CaseGradients",
    "CaseWithGains",
    "ConditionalValueAtRisk",
    "CostEvaluator",
    "DescentProgress",
    "DescentState",
    "GainEvaluation",
    "GradientCheck",
    "GradientMethod",
    "LossGradient",
    "Mean",
    "NoGradient",
    "Objective",
    "OptimiserSettings",
    "Parameter",
    "Quantile",
    "Receipt",
    "SearchSpace",
    "StepRecord",
    "TailCompression",
    "TrajectoryCounter",
    "TuningPlan",
    "TuningSettings",
    "TuningVerdict",
    "ValidationRecord",
    "WithGains",
    "WorstCase",
    "check_gradients",
    "descend",
    "descent_step",
    "evaluate_gains",
    "initial_state",
    "make_receipt",
    "make_verdict",
    "mean_interval",
]
