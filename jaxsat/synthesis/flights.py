"""Flights that judge a requirement, batch by batch, in a folder by which the same call resumes."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Float, UInt32

from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.declaration.requirements import comparisons
from jaxsat.core.errors import ArgumentError
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.study import PILOTS, refined_study
from jaxsat.scenario.errors import MissingTable
from jaxsat.scenario.parts.requirements import RequirementTable
from jaxsat.scenario.resolution import excessive_error
from jaxsat.simulation.engine.progress import Outputs
from jaxsat.simulation.requirements import Requirements
from jaxsat.store.files import OutputError
from jaxsat.store.resumable import ResumableFolder
from jaxsat.studies.columns import DRAWN
from jaxsat.studies.dispersions import StudyCase
from jaxsat.studies.distributions import Discrete
from jaxsat.studies.ensemble import Study
from jaxsat.studies.executors import AbstractExecutor, Serial
from jaxsat.studies.splitting import Space
from jaxsat.synthesis.execution import Execution, Listener

PLACE = "flights/{:05}.npz"
"""File of a batch."""

ROUNDED = ("failure_kind", *(one.failed_quantity.name for one in ACTUATORS))
"""Discrete quantities, whatever distribution they are drawn from."""

Batch = dict[str, np.ndarray]


def space_of(study: Study) -> Space:
    """Return the space of the cases of a study."""
    copies = study.case_factory
    distributions = copies.dispersions.distributions
    whole = [
        jumps
        for name, count in copies.dimensions().items()
        for jumps in [name in ROUNDED or isinstance(distributions[name], Discrete)] * count
    ]
    return Space(np.array(whole, bool), copies.has_noise)


@dataclass
class Flights:
    """Flights of the cases of a study, with the outcome of the requirement of that name."""

    study: Study
    requirement: str
    folder: ResumableFolder
    executor: AbstractExecutor | None
    listener: Listener
    batches: list[Batch] = field(default_factory=list)
    count: int = 0

    def margins(
        self, points: Float[np.ndarray, "cases dimension"], noise: UInt32[np.ndarray, " cases"]
    ) -> Float[np.ndarray, " cases"]:
        """Return the margins of the next batch; minus infinity for a case that ended early."""
        place = PLACE.format(len(self.batches))
        batch = self.folder.read_arrays(place)
        if batch is None:
            batch = {"point": points, "noise": noise, **self._flown(points, noise)}
            self.folder.write_arrays(place, batch)
        elif not np.array_equal(batch["point"], points):
            raise OutputError(f"{self.folder.path} holds other flights; give another folder.")
        self.batches.append(batch)
        self.count += len(points)
        self.listener.progress(f"{self.requirement}: {self.count:,} flights", None)
        return np.where(np.isnan(batch["margin"]), -np.inf, batch["margin"])

    def together(self) -> Batch:
        """Return the arrays of all flights, by flight number."""
        return {
            name: np.concatenate([one[name] for one in self.batches]) for name in self.batches[0]
        }

    def _flown(self, points: np.ndarray, noise: np.ndarray) -> Batch:
        executor = Serial() if self.executor is None else self.executor
        work = _Part(self.study, self.requirement, points, noise)
        parts = dict(executor.run(work, range(-(-len(points) // work.size))))
        return {
            name: np.concatenate([parts[place][name] for place in range(len(parts))])
            for name in parts[0]
        }


@dataclass(frozen=True)
class _Part:
    """Fly a part of a batch, by its index."""

    study: Study
    requirement: str
    points: np.ndarray
    noise: np.ndarray

    @property
    def size(self) -> int:
        """Number of cases of a part."""
        return self.study.engine.batch_size

    def __call__(self, place: int) -> Batch:
        study, here = self.study, slice(place * self.size, (place + 1) * self.size)
        cases = StudyCase(self.noise[here], self.points[here])
        outputs = study.engine.evaluate(study.program, cases, study.gains)
        return dict(_kept(outputs, study.program.requirements, self.requirement))


def _kept(
    outputs: Outputs, requirements: Requirements | None, name: str
) -> Iterator[tuple[str, np.ndarray]]:
    """Yield the stored arrays of every flight: judgement, ending, and drawn numbers."""
    if requirements is None or outputs.requirements is None:
        raise TypeError("The program must judge requirements.")
    column = requirements.names.index(name)
    for key, values in zip(("margin", "comparison", "time"), outputs.requirements, strict=True):
        yield key, np.asarray(values)[:, column]
    yield "code", np.asarray(outputs.code)
    if outputs.integration_error is not None:
        yield "rate_error", np.asarray(outputs.integration_error.rate)
        yield "attitude_error", np.asarray(outputs.integration_error.attitude)
    for key, values in outputs.drawn.items():
        yield DRAWN + key, np.asarray(values)


def listed_flights(folder: ResumableFolder) -> tuple[np.ndarray, np.ndarray]:
    """Return points (flights, dimension) of all flights in a folder, and their noise seeds.

    Raises `OutputError` for a folder without flights.
    """
    batches: list[Batch] = []
    while (batch := folder.read_arrays(PLACE.format(len(batches)))) is not None:
        batches.append(batch)
    if not batches:
        raise OutputError(f"{folder.path} holds no flights yet.")
    points, noise = (np.concatenate([one[name] for one in batches]) for name in ("point", "noise"))
    return points, noise


def require_tables(scenario: Scenario) -> None:
    """Raise `MissingTable` for a scenario without requirements or dispersions."""
    if not scenario.requirement:
        raise MissingTable("[requirement]")
    if scenario.dispersion is None:
        raise MissingTable("dispersion")


def study_of_requirements(
    scenario: Scenario, execution: Execution, listener: Listener
) -> tuple[Scenario, Study]:
    """Return the scenario with steps as fine as it requires, and a study of it."""
    require_tables(scenario)
    listener.progress("compiling", None)
    scenario, study = refined_study(scenario, PILOTS, listener.remark, engine=execution.engine)
    if study.remark is not None:
        listener.remark(study.remark)
    return scenario, study


def chosen_requirement(scenario: Scenario, study: Study, name: str | None) -> RequirementTable:
    """Return the requirement of that id; raises `ArgumentError` if studies do not judge it."""
    requirements = study.program.requirements
    names = () if requirements is None else requirements.names
    if name is None and len(names) == 1:
        name = names[0]
    if name not in names:
        rule = f"must be one that studies judge: {', '.join(names) or 'there is none'}"
        raise ArgumentError("requirement", rule, name or "nothing")
    return next(one for one in scenario.requirement if one.id == name)


def identity_of(scenario: Scenario, study: Study) -> dict[str, Any]:
    """Return the data that affect the numbers of every flight."""
    identity = study.identity()
    own = {"engine": identity["engine"], "program": identity["program"]}
    return {"scenario": scenario.model_dump(mode="json"), **own}


def excess_of(flights: Batch, scenario: Scenario) -> str:
    """Return a warning where solver errors exceed those that the scenario allows."""
    errors = [
        float(np.nanmax(flights[name], initial=0.0)) if name in flights else None
        for name in ("rate_error", "attitude_error")
    ]
    return excessive_error((errors[0], errors[1]), scenario)


def unit_of(table: RequirementTable) -> tuple[str, float]:
    """Return the unit of the margin and its size in SI; SI where comparisons have several units."""
    units = {(one.unit, one.size) for one in comparisons(table.parsed)}
    return units.pop() if len(units) == 1 else ("SI", 1.0)
