"""The worst case of a requirement in one call: the search, its result, and its scenario."""

import shlex
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from scipy.special import ndtri

from jaxsat.core.declaration.quantities import DISPERSIBLE
from jaxsat.core.declaration.requirements import comparisons
from jaxsat.core.errors import ArgumentError
from jaxsat.report.document import Document
from jaxsat.report.printers import notebook_text
from jaxsat.report.requirements import judgements
from jaxsat.report.worst_case_document import quantity_text, worst_case_document
from jaxsat.scenario import Scenario, dump
from jaxsat.scenario.build.datasets import simulated_finely
from jaxsat.scenario.parts.requirements import RequirementTable
from jaxsat.simulation.trajectory import Outcome
from jaxsat.store.labelled import LabelledArrays
from jaxsat.studies.columns import DRAWN
from jaxsat.studies.ensemble import Study
from jaxsat.synthesis.execution import Execution, Listener, folder_of_call, plain_data, write_record
from jaxsat.synthesis.flights import (
    Batch,
    Flights,
    chosen_requirement,
    excess_of,
    identity_of,
    space_of,
    study_of_requirements,
    unit_of,
)
from jaxsat.synthesis.tuning.strategies import require_package
from jaxsat.synthesis.worst_case.search import Ball, search

KIND = "worst case"
"""Kind of the output folder."""

CASE = "case.toml"

LEAST_FLIGHTS = 100


@dataclass(frozen=True)
class SearchSettings:
    """Settings of a search, checked at construction.

    `flights` of the search, and as many random ones; `within`, the part of all cases among which
    the worst one is sought. Raises `ArgumentError` for invalid numbers.
    """

    flights: int = 2000
    within: float = 0.9973

    def __post_init__(self):
        if self.flights < LEAST_FLIGHTS:
            raise ArgumentError("flights", f"must be at least {LEAST_FLIGHTS}", self.flights)
        if not 0 < self.within < 1:
            raise ArgumentError("within", "must be between 0 and 1", self.within)


class WorstQuantity(NamedTuple):
    """The `values` of a drawn quantity in the worst case, and how far out they are.

    `sigmas` are standard normal numbers with the same quantiles; an attitude has three.
    """

    quantity: str
    unit: str
    values: list[float]
    sigmas: list[float]


class WorstCase(NamedTuple):
    """The least `margin` found, in `unit`, and the case that has it.

    It is that of the case flown alone, and minus infinity where that ended early, as `outcome`
    says; `signal` decided it, at `time` (s). The case is `distance` standard deviations from the
    middle of all cases, at most `radius`; `quantities` are its draws, and `again` flies it again.
    `searched` and `random` are the least margins of the search and of as many random cases, and
    `flights` counts those of both. Of the `gradients` along which the search descended so many were
    `trusted`, as central differences agreed with them.
    """

    title: str
    requirement: str
    sentence: str
    settings: SearchSettings
    margin: float
    signal: str
    time: float
    unit: str
    outcome: str
    distance: float
    radius: float
    quantities: list[WorstQuantity]
    searched: float
    random: float
    flights: int
    gradients: int
    trusted: int
    again: str

    _repr_markdown_ = notebook_text

    @property
    def document(self) -> Document:
        """The document that `jaxsat worst` prints."""
        return worst_case_document(plain_data(self))

    @property
    def beats_random(self) -> bool:
        """Whether the search found a lower margin than as many random cases."""
        return self.searched < self.random

    def as_data(self) -> dict[str, Any]:
        """Return the data of a record, see `plain_data`."""
        return {**self._asdict(), "beats_random": self.beats_random}


def worst_case(
    scenario: Scenario,
    requirement: str | None = None,
    *,
    flights: int = 2000,
    within: float = 0.9973,
    out: str | Path | None = None,
    execution: Execution = Execution(),
    listener: Listener = Listener(),
) -> WorstCase:
    """Search the dispersions of a scenario for the case with the least margin of a requirement.

    The requirement is that of this id, or the only one that studies judge. The search, see
    `jaxsat.synthesis.worst_case.search`, is among the likeliest cases, the part `within` of all.
    With `out` flights, results and the scenario of the worst case are kept in that folder, and the
    same call resumes.

    Raises `MissingTable` for a scenario without requirements or dispersions, `ArgumentError` for
    invalid numbers or a requirement that studies do not judge or no case, `OutputError` for a
    folder that cannot be used, and `ValueError` for an engine that cannot run the study, or without
    the package of the strategy.
    """
    settings = SearchSettings(flights, within)
    require_package("A search for the worst case")
    scenario, study = study_of_requirements(scenario, execution, listener)
    table = chosen_requirement(scenario, study, requirement)
    listener.approve([execution.work(replace(study, count=2 * flights))])
    identity = identity_of(scenario, study) | {"requirement": table.id, "settings": vars(settings)}
    with folder_of_call(out, KIND, identity, execution.elsewhere) as folder:
        evaluations = Flights(study, table.id, folder, execution.executor, listener)

        def evaluate(points: np.ndarray, noise: np.ndarray) -> np.ndarray:
            evaluations.margins(points, noise)
            return _comparable(evaluations.batches[-1])

        ball = Ball.with_probability(sum(study.case_factory.dimensions().values()), within)
        whole = space_of(study).whole
        counts = search(evaluate, ball, whole, flights, scenario.simulation.seed)
        batch = evaluations.together()
        if excess := excess_of(batch, scenario):
            listener.warn(excess)
        margins = _comparable(batch)
        worst = int(np.argmin(margins))
        if margins[worst] == np.inf:
            raise ArgumentError("requirement", "must be judged in some case", table.id)
        quantities = list(_quantities(study, batch, worst))
        case = _case(scenario, batch, worst, table, quantities)
        case, dataset = simulated_finely(case, listener.remark)
        unit, size = unit_of(table)
        least_of = lambda *parts: float(np.concatenate(parts).min()) / size  # noqa: E731
        result = WorstCase(
            scenario.title,
            table.id,
            table.text or table.formula,
            settings,
            *_judged(dataset, table),
            unit,
            dataset.attrs["outcome_explanation"],
            float(np.linalg.norm(ndtri(batch["point"][worst]))),
            ball.radius,
            quantities,
            least_of(margins[: counts.common], margins[flights:]),
            least_of(margins[:flights]),
            len(margins),
            counts.gradients,
            counts.trusted,
            f"jaxsat simulate {shlex.quote(str(folder.path / CASE))}",
        )
        if out is not None:
            folder.write(CASE, dump(case))
            write_record(folder, "jaxsat.synthesis.worst_case", "worst-case", result)
        return result


def _comparable(batch: Batch) -> np.ndarray:
    """Return margins with minus infinity for cases that ended early, and infinity for those that
    never began, as nothing has what they drew."""
    margins = np.where(np.isnan(batch["margin"]), -np.inf, batch["margin"])
    return np.where(batch["code"] == int(Outcome.IMPOSSIBLE_CASE), np.inf, margins)


def _judged(dataset: LabelledArrays, table: RequirementTable) -> tuple[float, str, float]:
    """Return margin, deciding signal and time (s) of a run; the margin in `unit_of` its table."""
    judgement = next(one for one in judgements(dataset) if one.id == table.id)
    sizes = {one.unit: one.size for one in comparisons(table.parsed)}
    margin = judgement.margin * sizes[judgement.unit] / unit_of(table)[1]
    return (-np.inf if np.isnan(margin) else margin), judgement.signal, judgement.time


def _quantities(study: Study, batch: Batch, number: int) -> Iterator[WorstQuantity]:
    sigmas = iter(ndtri(batch["point"][number]).tolist())
    for name, count in study.case_factory.dimensions().items():
        unit, values = DISPERSIBLE[name].unit.removesuffix("1"), batch[DRAWN + name][number]
        own = [next(sigmas) for _ in range(count)]
        yield WorstQuantity(name, unit, np.ravel(values).tolist(), own)


def _case(
    scenario: Scenario,
    batch: Batch,
    number: int,
    table: RequirementTable,
    quantities: list[WorstQuantity],
) -> Scenario:
    """Return the scenario whose simulated case is the flight with this number."""
    assert scenario.dispersion is not None
    place = {
        "case": int(batch["noise"][number]),
        "point": tuple(batch["point"][number].tolist()),
    }
    lines = [quantity_text(one._asdict()) for one in quantities]
    text = "\n".join([f"Worst case found of {table.id}, {table.text or table.formula}", *lines])
    dispersion = scenario.dispersion.model_copy(update=place)
    return scenario.model_copy(update={"dispersion": dispersion, "description": text})
