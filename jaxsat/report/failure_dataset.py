"""The table of all failures as a labelled dataset."""

from collections.abc import Sequence

import xarray as xr

from jaxsat.controllability import FailureCase, Judgement, failure_arrays
from jaxsat.core.text import clean
from jaxsat.store.provenance import provenance_attributes


def failure_dataset(
    cases: Sequence[FailureCase],
    judgement: Judgement,
    *,
    title: str,
    scenario: str,
    verdict: str,
    findings: Sequence[str],
) -> xr.Dataset:
    """Every failure case with rank, margin and what is lost; the judgement in the attributes.

    `verdict` is a sentence, `findings` are sentences of the document, a line each in an attribute.
    """
    names = cases[0].working  # the first case has no failure
    arrays = failure_arrays(cases, names)
    meaning = {
        "failed": "whether the actuator has failed",
        "rank": "rank of the Lie algebra at rest, of `dimension`",
        "dimension": "dimension of the states that the conserved momentum leaves",
        "verdict": "what the rest can do",
        "controllable": "every attitude and rate of these states can be reached",
        "borderline": "the margin is too small to be sure",
        "margin": "smallest singular value of the normalised generating vectors (directions)",
        "turn_time": "time to turn 1 rad about the axis hardest to reach, 1 N m a thruster",
        "directions": "dimension of the torques of both signs without the drift",
        "torques": "shape of the set of torques",
        "laws": "laws of jaxsat that can be flown, by the torques they need",
        "lost": "what the failure takes away",
        "once_stopped": "the verdict once friction has stopped the wheels that coast",
    }
    units = {"margin": "1", "turn_time": "s"}
    variables = {}
    for name, values in arrays.items():
        dimensions = ("case", "actuator")[: values.ndim]
        attributes = {"long_name": meaning[name]}
        if name in units:
            attributes["units"] = units[name]
        variables[name] = (dimensions, values, attributes)
    attributes = {
        "title": clean(title),
        "scenario": scenario,
        "verdict": clean(verdict),
        "findings": "\n".join(map(clean, findings)),
        "rank": judgement.rank,
        "margin": judgement.margin,
        "turn_time_s": judgement.turn_time,
        **provenance_attributes(),
    }
    return xr.Dataset(variables, {"actuator": list(names)}, attributes)
