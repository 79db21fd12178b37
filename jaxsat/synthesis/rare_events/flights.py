"""Flights of an estimate, batch by batch, in a folder by which the same call resumes."""

import io
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field

import jax
import numpy as np
from jaxtyping import Float, UInt32

from jaxsat.core.declaration.actuators import ACTUATORS
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
    """Flights of the cases of a study, with the outcome of the requirement of that name.

    `tell` is called with the number of flights so far.
    """

    study: Study
    requirement: str
    folder: ResumableFolder
    executor: AbstractExecutor | None
    tell: Callable[[int], None]
    batches: list[Batch] = field(default_factory=list)
    count: int = 0

    def margins(
        self, points: Float[np.ndarray, "cases dimension"], noise: UInt32[np.ndarray, " cases"]
    ) -> Float[np.ndarray, " cases"]:
        """Return the margins of the next batch; minus infinity for a case that ended early."""
        place = PLACE.format(len(self.batches))
        content = self.folder.read(place)
        batch = None if content is None else _unpacked(content)
        if batch is None:
            batch = {"point": points, "noise": noise, **self._flown(points, noise)}
            self.folder.write(place, _packed(batch))
        elif not np.array_equal(batch["point"], points):
            raise OutputError(f"{self.folder.path} holds another estimate; give another folder.")
        self.batches.append(batch)
        self.count += len(points)
        self.tell(self.count)
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


def _packed(batch: Batch) -> bytes:
    file = io.BytesIO()
    np.savez(file, **jax.tree.map(np.asarray, batch))
    return file.getvalue()


def _unpacked(content: bytes) -> Batch:
    with np.load(io.BytesIO(content), allow_pickle=False) as arrays:
        return {name: arrays[name] for name in arrays.files}


def listed_flights(folder: ResumableFolder) -> tuple[np.ndarray, np.ndarray]:
    """Return points (flights, dimension) of all flights in a folder, and their noise seeds.

    Raises `OutputError` for a folder without flights.
    """
    batches: list[Batch] = []
    while (content := folder.read(PLACE.format(len(batches)))) is not None:
        batches.append(_unpacked(content))
    if not batches:
        raise OutputError(f"{folder.path} holds no flights yet.")
    points, noise = (np.concatenate([one[name] for one in batches]) for name in ("point", "noise"))
    return points, noise
