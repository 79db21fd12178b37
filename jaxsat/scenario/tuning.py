"""`[tuning]`: the tuned gains, the cost, and the optimiser."""

from typing import Annotated, Literal

from annotated_types import Ge, Le, Len, Lt

from jaxsat.core.errors import ArgumentError
from jaxsat.core.text import suggestion
from jaxsat.scenario.control import table_of
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.quantities import (
    Line,
    NonNegative,
    Number,
    Positive,
    ScenarioTable,
    Switch,
    Whole,
    choice,
    quantity,
)
from jaxsat.scenario.rules import at, is_multiple, rule, rule_over
from jaxsat.scenario.wording import refusal, shown

Count = Annotated[Whole, Ge(1), Le(10**6)]
Unit = Annotated[Positive, Lt(1)]


class BoundsTable(ScenarioTable):
    """`[tuning.parameters.KEY]`: the bounds of one gain, in its own unit."""

    low: Number = choice("Least value")
    high: Number = choice("Largest value")
    scale: Literal["log", "logit"] = choice(
        'Searched in its logarithm ("log") or in the logit of its place between the bounds', "log"
    )


class CostTable(ScenarioTable):
    """`[tuning.cost]`: the cost of a second, and its limit."""

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
        "penalised with c_max for each missing second",
        "1",
        100.0,
    )


class TuningTable(ScenarioTable):
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
    clip: Positive = quantity("Largest gradient norm; longer gradients are clipped to it", "1", 1.0)
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
        "Steps after which the worse half of the starts is dropped", "1", ()
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


USUAL_OPTIMISERS = ("adam", "adamw", "lion", "rmsprop", "sgd")
"""Optimisers that are known to be suitable, which avoids the slow import of optax."""

MAX_CASES = 2**29
"""Largest number of cases of all steps; higher case numbers are for validation."""


def _entries(values, table):
    """Names and valid values of the keys of `[tuning.parameters]` or `[tuning.smoothing]`."""
    prefix = f"tuning.{table}."
    entries = {}
    for key, value in values.items():
        if key.startswith(prefix):
            name, _, part = key.removeprefix(prefix).partition(".")
            entries.setdefault(name, {})[part] = value
    return entries


def _tuned_bounds(values):
    """Tuned keys with their bounds where these are valid."""
    bounds = {
        name: (e.get("low"), e.get("high")) for name, e in _entries(values, "parameters").items()
    }
    return {name: ends for name, ends in bounds.items() if None not in ends}


def _foreign(values, table, allowed):
    """Yield an issue for each key in a table that the law does not allow there."""
    law = values["control.law"]
    for name in _entries(values, table):
        if name not in allowed:
            what = f"one of {', '.join(allowed)}" if allowed else "left out"
            message = f'must be {what} under the law "{law}", got {shown(name)}'
            yield at(f"tuning.{table}.{name}", message + suggestion(name, allowed))


@rule_over("control.law", "tuning.steps")
def _gains_are_those_of_the_law(values):
    law = values["control.law"]
    names = law.declaration.tunable
    yield from _foreign(values, "parameters", names)
    if not names:
        yield at(
            "tuning",
            f'must be left out under the law "{law}", which has no gains to tune, got a table',
        )
    elif values.get("tuning.parameters") == {}:
        yield at("tuning.parameters", f"must name at least one of {', '.join(names)}, got nothing")


@rule_over("control.law", "tuning.steps")
def _bounds_hold_the_gain(values):
    law = values["control.law"]
    for name, (low, high) in _tuned_bounds(values).items():
        key = f"tuning.parameters.{name}"
        gain = values.get(f"control.{name}")
        issues = [
            issue
            for end, value in (("low", low), ("high", high))
            for issue in _refused(law, name, f"parameters.{name}.{end}", value)
        ]
        if low >= high:
            yield at(f"{key}.high", f"must be above low = {shown(low)}, got {shown(high)}")
        elif issues:
            yield from issues
        elif low <= 0:
            yield at(f"{key}.low", f"must be greater than 0, got {shown(low)}")
        elif gain is not None:
            entries = gain if isinstance(gain, tuple) else (gain,)
            if not all(low <= entry <= high for entry in entries):
                yield Issue(
                    tuple(key.split(".")),
                    f"must be bounds around control.{name} = {shown(gain)}, "
                    f"got {shown(low)} to {shown(high)}",
                    (("control", name),),
                )


def _refused(law, name, place, value):
    """Yield an issue if a key of the law rejects the value at a place of `[tuning]`."""
    table = table_of(law)
    message = refusal(table, name, value) if name in table.model_fields else None
    if message is not None:
        yield at(f"tuning.{place}", message)


@rule_over("control.law", "tuning.steps")
def _ordered_gains_cannot_cross(values):
    bounds = _tuned_bounds(values)
    for lower, upper in values["control.law"].declaration.ordered:
        if lower not in bounds and upper not in bounds:
            continue
        highest = bounds[lower][1] if lower in bounds else values.get(f"control.{lower}")
        lowest = bounds[upper][0] if upper in bounds else values.get(f"control.{upper}")
        if highest is not None and lowest is not None and highest > lowest:
            yield at(
                f"tuning.parameters.{lower if lower in bounds else upper}",
                f"must keep {lower} below {upper}, got bounds that let {shown(highest)} meet "
                f"{shown(lowest)}",
            )


@rule_over("control.law", "tuning.steps")
def _widths_are_those_of_the_law(values):
    law = values["control.law"]
    yield from _foreign(values, "smoothing", law.declaration.widths)
    for name in law.declaration.widths:
        width = values.get(f"tuning.smoothing.{name}")
        if width is not None:
            yield from _refused(law, name, f"smoothing.{name}", width)


@rule_over("control.law", "tuning.steps")
def _widths_are_not_tuned_as_well(values):
    widths = values["control.law"].declaration.widths
    for name in _entries(values, "smoothing"):
        if name in widths and name in _tuned_bounds(values):
            yield at(
                f"tuning.smoothing.{name}",
                f"must be left out where tuning.parameters.{name} is given, "
                f"got {shown(values[f'tuning.smoothing.{name}'])}",
            )


@rule("tuning.steps", "dispersion")
def _something_is_dispersed(steps, dispersion):
    if dispersion is None:
        yield at("dispersion", "must say over what the gains are tuned, got nothing", True)


@rule("tuning.steps", "dispersion.design")
def _more_cases_can_be_drawn(steps, design):
    if design == "latin-hypercube":
        yield at(
            "dispersion.design",
            'must be "independent" or "sobol" for tuning, which draws as many cases as it '
            f"needs, got {shown(design)}",
        )


@rule("tuning.optimiser")
def _optimiser_is_one_of_optax(name):
    if name in USUAL_OPTIMISERS or name == "cma-es":
        return
    from jaxsat.scenario.optimisers import OptimiserSettings

    try:
        OptimiserSettings(name)
    except ArgumentError as error:
        yield at("tuning.optimiser", f"{error.rule}, got {shown(name)}")


@rule("tuning.optimiser", "control.law")
def _some_laws_have_no_derivatives(name, law):
    for applies, why in (
        (law.declaration.searched, "which searches in flight"),
        (law.declaration.commands_actuators, "whose alarms and pulses have no derivatives"),
    ):
        if applies and name != "cma-es":
            message = f'must be "cma-es" under the law "{law}", {why}, got {shown(name)}'
            yield at("tuning.optimiser", message)


@rule("tuning.optimiser", "tuning.cost.recovery")
def _recovery_has_no_derivative(name, recovery):
    if recovery is not None and name != "cma-es":
        yield at(
            "tuning.cost.recovery",
            f'must be left out unless tuning.optimiser is "cma-es", got {shown(recovery)}',
        )


@rule("tuning.starts", "tuning.screened")
def _enough_points_are_screened(starts, screened):
    if 0 < screened < starts:
        yield at("tuning.screened", f"must be 0 or at least starts = {starts}, got {screened}")


@rule("tuning.horizon_s", "simulation.duration_s", "simulation.save_every_s")
def _horizons_fit(horizons, duration, save_every):
    for place, horizon in enumerate(horizons or ()):
        if horizon > duration or not is_multiple(horizon, save_every):
            yield Issue(
                ("tuning", "horizon_s", place),
                f"must be multiples of simulation.save_every_s = {shown(save_every)} up to "
                f"simulation.duration_s = {shown(duration)}, got {shown(horizon)}",
            )


@rule("tuning.held_out_seed", "simulation.seed")
def _verdict_has_cases_of_its_own(held_out, seed):
    if held_out == seed:
        yield at("tuning.held_out_seed", f"must not be simulation.seed, got {seed} twice")


@rule("tuning.steps", "tuning.cases", "tuning.fresh_cases")
def _cases_have_numbers(steps, cases, fresh):
    if fresh and steps * cases > MAX_CASES:
        yield at(
            "tuning.steps", f"must be at most {MAX_CASES} divided by cases = {cases}, got {steps}"
        )
