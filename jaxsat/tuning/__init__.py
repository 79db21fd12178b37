"""Gain tuning: gradient descent through the simulator, and the proof of what it found."""

from jaxsat.tuning.aggregates import (
    AbstractAggregate,
    Judged,
    Mean,
    Objective,
    Quantile,
    Tail,
    TailMean,
    Worst,
)
from jaxsat.tuning.descent import (
    DescentProgress,
    DescentState,
    StepRecord,
    ValidationRecord,
    advance,
    begin,
    descend,
)
from jaxsat.tuning.optimisers import Descent
from jaxsat.tuning.parameters import Parameter, SearchSpace
from jaxsat.tuning.plan import Settings, TuningPlan
from jaxsat.tuning.receipt import Comparison, Receipt, compare, make_receipt
from jaxsat.tuning.trials import CaseWithGains, Counter, GradientMethod, Slopes, Trials, WithGains
from jaxsat.tuning.verdict import Judgement, Verdict, judge, make_verdict, mean_interval

__all__ = [
    "AbstractAggregate",
    "CaseWithGains",
    "Comparison",
    "Counter",
    "Descent",
    "DescentProgress",
    "DescentState",
    "GradientMethod",
    "Judged",
    "Judgement",
    "Mean",
    "Objective",
    "Parameter",
    "Quantile",
    "Receipt",
    "SearchSpace",
    "Settings",
    "Slopes",
    "StepRecord",
    "Tail",
    "TailMean",
    "Trials",
    "TuningPlan",
    "ValidationRecord",
    "Verdict",
    "WithGains",
    "Worst",
    "advance",
    "begin",
    "compare",
    "descend",
    "judge",
    "make_receipt",
    "make_verdict",
    "mean_interval",
]
