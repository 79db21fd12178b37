"""Rules of the `[tuning]` table."""

from jaxsat.scenario.checks import is_multiple
from jaxsat.scenario.control_tables import LAWS
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.rules import at, rule, rule_over
from jaxsat.scenario.tuning_tables import SMOOTHABLE, TUNABLE, ParametersTable, SmoothingTable
from jaxsat.scenario.wording import refusal, shown

USUAL_OPTIMISERS = ("adam", "adamw", "lion", "rmsprop", "sgd")
"""Known to be optimisers that will do, so that optax, which takes its time, is not asked."""

MOST_CASES = 2**29
"""Of all steps; the numbers from there on are those of the validation cases."""

THRESHOLDS = ("lower_threshold_rad_s", "upper_threshold_rad_s")


def _bounds(values, name):
    """low, high of a tuned key, or None where it is not tuned or not readable."""
    ends = [values.get(f"tuning.parameters.{name}.{end}") for end in ("low", "high")]
    return None if None in ends else ends


def _tuned(values):
    """Tuned keys with their readable bounds."""
    found = {name: _bounds(values, name) for name in ParametersTable.model_fields}
    return {name: ends for name, ends in found.items() if ends is not None}


@rule_over("control.law", "tuning.steps")
def _gains_are_those_of_the_law(values):
    law = values["control.law"]
    known, tuned = TUNABLE.get(law, {}), _tuned(values)
    for name in tuned:
        if name not in known:
            what = f"one of {', '.join(known)}" if known else "left out"
            yield at(
                f"tuning.parameters.{name}",
                f'must be {what} under the law "{law}", got {shown(name)}',
            )
    # tables that are invalid in themselves have no readable bounds and their own message
    if not tuned and all(
        values.get(f"tuning.parameters.{name}", 0) is None for name in ParametersTable.model_fields
    ):
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
    if name in LAWS[law].model_fields:
        for end, value in (("low", low), ("high", high)):
            message = refusal(LAWS[law], name, value)
            if message is not None:
                yield at(f"tuning.parameters.{name}.{end}", message)


@rule_over("control.law", "tuning.steps")
def _thresholds_cannot_cross(values):
    tuned = _tuned(values)
    if not any(name in tuned for name in THRESHOLDS):
        return
    given = [values.get(f"control.{name}") for name in THRESHOLDS]
    highest = tuned[THRESHOLDS[0]][1] if THRESHOLDS[0] in tuned else given[0]
    lowest = tuned[THRESHOLDS[1]][0] if THRESHOLDS[1] in tuned else given[1]
    if highest is not None and lowest is not None and highest > lowest:
        name = next(name for name in THRESHOLDS if name in tuned)
        yield at(
            f"tuning.parameters.{name}",
            "must keep lower_threshold_rad_s below upper_threshold_rad_s, got bounds that let "
            f"{shown(highest)} meet {shown(lowest)}",
        )


@rule_over("control.law", "tuning.steps")
def _widths_are_those_of_the_law(values):
    law = values["control.law"]
    known = SMOOTHABLE.get(law, ())
    for name in SmoothingTable.model_fields:
        if values.get(f"tuning.smoothing.{name}") is not None and name not in known:
            what = f"one of {', '.join(known)}" if known else "left out"
            yield at(
                f"tuning.smoothing.{name}",
                f'must be {what} under the law "{law}", got {shown(name)}',
            )


@rule_over("control.law", "tuning.steps")
def _widths_are_not_tuned_as_well(values):
    for name in SmoothingTable.model_fields:
        width = values.get(f"tuning.smoothing.{name}")
        if width is not None and name in _tuned(values):
            yield at(
                f"tuning.smoothing.{name}",
                f"must be left out where tuning.parameters.{name} is given, got {shown(width)}",
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
    if name in USUAL_OPTIMISERS:
        return
    from jaxsat.tuning.optimisers import Descent

    try:
        Descent(name)
    except ValueError as error:
        text = str(error).removeprefix("Argument `optimiser` ").replace(", but got", ", got")
        yield at("tuning.optimiser", text.rstrip(".").replace(repr(name), shown(name)))


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
    if fresh and steps * cases > MOST_CASES:
        yield at(
            "tuning.steps", f"must be at most {MOST_CASES} divided by cases = {cases}, got {steps}"
        )
