"""The `[tuning]` table: which gains are tuned, for what, and how."""

from typing import Annotated, Literal

from annotated_types import Ge, Le, Len, Lt

from jaxsat.scenario.quantities import (
    Line,
    NonNegative,
    Number,
    Positive,
    Switch,
    Table,
    Whole,
    choice,
    quantity,
)

Count = Annotated[Whole, Ge(1), Le(10**6)]
Unit = Annotated[Positive, Lt(1)]


class BoundsTable(Table):
    """`[tuning.parameters.KEY]`: the bounds of one gain, in its own unit."""

    low: Number = choice("Least value")
    high: Number = choice("Largest value")
    scale: Literal["log", "logit"] = choice(
        'Searched in its logarithm ("log") or in the logit of its place between the bounds', "log"
    )


class CostTable(Table):
    """`[tuning.cost]`: what a second costs, and how much at most."""

    w: NonNegative = quantity("Weight of the tilt; see simulation.attitude_cost", "1", 1.0)
    z: NonNegative = quantity("Weight of the turn", "1", 1.0)
    relative_rate: NonNegative = quantity("Weight of |ω_r|²", "s²", 100.0)
    torque: NonNegative = quantity("Weight of the squared torques", "1/(N m)²", 1e-3)
    settling: NonNegative = quantity(
        "Weight of a smooth 1 outside the settling tolerances, whose integral stands for the "
        "settling time",
        "1",
        0.0,
    )
    recovery: Positive | None = quantity(
        "Replaces all other terms: the cost of a case is the time from its first failure until it "
        "is settled, over the horizon, or this value if it never settles",
        "1",
        None,
    )
    limit: Positive = quantity(
        "Cost c_max of a second at most: c saturates as c/(1 + c/c_max), and a run that fails is "
        "charged c_max for each second that it lacks",
        "1",
        100.0,
    )


class TuningTable(Table):
    """`[tuning]`: gain tuning by gradient descent over the dispersed cases."""

    parameters: dict[str, BoundsTable] = choice(
        "Bounds of the gains that are tuned, by the keys of [control]"
    )
    cost: CostTable = choice("What is integrated over time", CostTable())
    smoothing: dict[str, Positive] = choice(
        "Widths in place of those in [control] while gradients are taken", {}
    )
    aggregate: Literal["mean", "cvar", "quantile", "worst"] = choice(
        "From the cases' costs to one number; cvar is the mean of the worst", "mean"
    )
    level: Unit = quantity("α of cvar, the worst 1 - α counting, or the quantile", "1", 0.9)
    tail_scale: Positive | None = quantity(
        "s: a cost C is replaced by s log(1 + C/s); by default it is not", "1", None
    )
    optimiser: Line = choice(
        'Optimiser by its name in optax; or "cma-es", which takes no derivatives and has `starts` '
        "as its population",
        "adam",
    )
    learning_rate: Positive = quantity("Learning rate, along the search", "1", 0.1)
    schedule: Literal["constant", "cosine", "exponential"] = choice(
        "How the learning rate falls", "cosine"
    )
    clip: Positive = quantity("A gradient longer than this is shortened to it", "1", 1.0)
    case_bound: Positive = quantity(
        "A case's derivative counts for at most this many times the median length", "1", 10.0
    )
    gradient: Literal["forward", "reverse", "differences"] = choice(
        'Mode of automatic differentiation, or central differences ("differences") for laws that '
        "switch where it is blind",
        "forward",
    )
    half_width: Positive = quantity("Half width of those differences, along the search", "1", 0.02)
    steps: Count = quantity("Steps of the descent", "1", 60)
    cases: Count = quantity("Cases of a step", "1", 32)
    fresh_cases: Switch = choice("Whether every step takes new cases", True)
    starts: Annotated[Whole, Ge(1), Le(10000)] = quantity(
        "Starts: the gains of [control], the others log-uniform within the bounds", "1", 4
    )
    screened: Annotated[Whole, Ge(0), Le(10**6)] = quantity(
        "Random points tried first, of which the best become starts; 0 takes the first", "1", 32
    )
    screening_cases: Count | None = quantity(
        "Cases on which they are tried; by default those of the first step", "1", None
    )
    horizon_s: Annotated[tuple[Positive, ...], Len(1, 100)] | None = quantity(
        "Horizons, each for an equal share of the steps; by default the whole duration", "s", None
    )
    halve_at: Annotated[tuple[Annotated[Whole, Ge(1), Le(10**6)], ...], Len(0, 100)] = quantity(
        "Steps after which the worse half of the starts is given up", "1", ()
    )
    tolerance: Positive = quantity(
        "Relative and absolute tolerance of adaptive steps, where [simulation.solver] has none",
        "1",
        1e-8,
    )
    validation_cases: Count = quantity("Cases that choose the best iterate", "1", 128)
    validate_every: Count = quantity("Steps between two validations", "1", 5)
    receipt_cases: Count = quantity("Cases on which gradients are checked", "1", 16)
    held_out_cases: Count = quantity("Cases of the verdict", "1", 1024)
    held_out_seed: Annotated[Whole, Ge(0), Le(2**63 - 1)] | None = quantity(
        "Seed of the verdict's cases; by default simulation.seed + 1", "1", None
    )
    false_alarm_interval_s: Positive = quantity(
        "Least mean time between false alarms of a law that diagnoses its thrusters, by the "
        "average run length of its tests; 10,000 low orbits if left out",
        "s",
        5.7e7,
    )
    alarm_cost: Positive | None = quantity(
        "The verdict counts cases whose cost exceeds this", "1", None
    )
    target_loss: Positive | None = quantity(
        "Loss on the validation cases at which a run ends after its first step; by default all "
        "steps are taken",
        "1",
        None,
    )
    baseline_cases: Count | None = quantity(
        "Cases of a round of the baselines; by default as many as of a step", "1", None
    )
    baseline_trajectories: Count | None = quantity(
        "Trajectories of a baseline; by default as many as the descent took", "1", None
    )
