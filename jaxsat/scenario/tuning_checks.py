"""Rules of the `[tuning]` table."""

from jaxsat.core.errors import ArgumentError
from jaxsat.scenario.checks import is_multiple
from jaxsat.scenario.control_tables import table_of
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.rules import at, rule, rule_over
from jaxsat.scenario.wording import refusal, shown, suggestion

USUAL_OPTIMISERS = ("adam", "adamw", "lion", "rmsprop", "sgd")
"""Known to be optimisers that will do, so that optax, which takes its time, is not asked."""

MAX_CASES = 2**29
"""Of all steps; the numbers from there on are those of the validation cases."""


def _given(values, table):
    """Names and valid values of the keys of `[tuning.parameters]` or `[tuning.smoothing]`."""
    prefix = f"tuning.{table}."
    found = {}
    for key, value in values.items():
        if key.startswith(prefix):
            name, _, part = key.removeprefix(prefix).partition(".")
            found.setdefault(name, {})[part] = value
    return found


def _tuned(values):
    """Tuned keys with their bounds where these are valid."""
    found = {
        name: (e.get("low"), e.get("high")) for name, e in _given(values, "parameters").items()
    }
    return {name: ends for name, ends in found.items() if None not in ends}


def _foreign(values, table, known):
    """What stands in a table by the keys of the law and is none of those that may."""
    law = values["control.law"]
    for name in _given(values, table):
        if name not in known:
            what = f"one of {', '.join(known)}" if known else "left out"
            message = f'must be {what} under the law "{law}", got {shown(name)}'
            yield at(f"tuning.{table}.{name}", message + suggestion(name, known))


@rule_over("control.law", "tuning.steps")
def _gains_are_those_of_the_law(values):
    law = values["control.law"]
    known = law.declaration.tunable
    yield from _foreign(values, "parameters", known)
    if not known:
        yield at(
            "tuning",
            f'must be left out under the law "{law}", which has no gains to tune, got a table',
        )
    elif values.get("tuning.parameters") == {}:
        yield at("tuning.parameters", f"must name at least one of {', '.join(known)}, got nothing")


@rule_over("control.law", "tuning.steps")
def _bounds_hold_the_gain(values):
    for name, (low, high) in _tuned(values).items():
        key = f"tuning.parameters.{name}"
        given = values.get(f"control.{name}")
        refused = list(_outside_its_range(values["control.law"], name, low, high))
        if low >= high:
            yield at(f"{key}.high", f"must be above low = {shown(low)}, got {shown(high)}")
        elif refused:
            yield from refused
        elif low <= 0:
            yield at(f"{key}.low", f"must be greater than 0, got {shown(low)}")
        elif given is not None:
            entries = given if isinstance(given, tuple) else (given,)
            if not all(low <= entry <= high for entry in entries):
                yield Issue(
                    tuple(key.split(".")),
                    f"must be bounds around control.{name} = {shown(given)}, "
                    f"got {shown(low)} to {shown(high)}",
                    (("control", name),),
                )


def _outside_its_range(law, name, low, high):
    """Bounds that the key itself would not take."""
    table = table_of(law)
    if name in table.model_fields:
        for end, value in (("low", low), ("high", high)):
            message = refusal(table, name, value)
            if message is not None:
                yield at(f"tuning.parameters.{name}.{end}", message)


@rule_over("control.law", "tuning.steps")
def _ordered_gains_cannot_cross(values):
    tuned = _tuned(values)
    for lower, upper in values["control.law"].declaration.ordered:
        if lower not in tuned and upper not in tuned:
            continue
        highest = tuned[lower][1] if lower in tuned else values.get(f"control.{lower}")
        lowest = tuned[upper][0] if upper in tuned else values.get(f"control.{upper}")
        if highest is not None and lowest is not None and highest > lowest:
            yield at(
                f"tuning.parameters.{lower if lower in tuned else upper}",
                f"must keep {lower} below {upper}, got bounds that let {shown(highest)} meet "
                f"{shown(lowest)}",
            )


@rule_over("control.law", "tuning.steps")
def _widths_are_those_of_the_law(values):
    law = values["control.law"]
    yield from _foreign(values, "smoothing", law.declaration.widths)
    for name in law.declaration.widths:
        width = values.get(f"tuning.smoothing.{name}")
        message = None if width is None else refusal(table_of(law), name, width)
        if message is not None:
            yield at(f"tuning.smoothing.{name}", message)


@rule_over("control.law", "tuning.steps")
def _widths_are_not_tuned_as_well(values):
    widths = values["control.law"].declaration.widths
    for name in _given(values, "smoothing"):
        if name in widths and name in _tuned(values):
            yield at(
                f"tuning.smoothing.{name}",
                f"must be left out where tuning.parameters.{name} is given, "
                f"got {shown(values[f'tuning.smoothing.{name}'])}",
            )


@rule("tuning.steps", "dispersion")
def _something_is_dispersed(steps, dispersion):
    del steps
    if dispersion is None:
        yield at("dispersion", "must say over what the gains are tuned, got nothing", True)


@rule("tuning.steps", "dispersion.design")
def _more_cases_can_be_drawn(steps, design):
    del steps
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
    declaration = law.declaration
    if name == "cma-es":
        return
    if declaration.searched:
        yield at(
            "tuning.optimiser",
            f'must be "cma-es" under the law "{law}", which searches in flight, got {shown(name)}',
        )
    if declaration.allocates:
        yield at(
            "tuning.optimiser",
            f'must be "cma-es" under the law "{law}", whose alarms and pulses have no derivatives, '
            f"got {shown(name)}",
        )


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
