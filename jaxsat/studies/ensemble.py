"""A study: n dispersed copies of a closed loop, and the columns of each in a store."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import jax
import numpy as np

from jaxsat.core.attitude import pointing_error
from jaxsat.core.checks import require_counts
from jaxsat.core.declaration.quantities import DISPERSIBLE
from jaxsat.core.declaration.units import data_unit
from jaxsat.core.once import once_property
from jaxsat.simulation.engine.interface import AbstractEngine, Replay, program_identity
from jaxsat.simulation.engine.program import Program
from jaxsat.simulation.engine.progress import Outputs
from jaxsat.store.chunks import Column, Coordinate
from jaxsat.store.labels import ATTITUDE_SENSOR, components, distinct
from jaxsat.studies.columns import (
    DRAWN,
    ERRORS,
    HISTORY,
    HISTORY_TIME,
    REQUIREMENT,
    REQUIREMENTS,
    attitude_sensors,
    columns_of,
    histories_of,
    history_of,
    requirement_columns,
)
from jaxsat.studies.designs import AbstractDesign, LatinHypercube
from jaxsat.studies.dispersions import Dispersed, StudyCase
from jaxsat.studies.quantities import QUANTITIES
from jaxsat.studies.recovery import FailureRecovery


@dataclass(frozen=True)
class Study:
    """The definition of a study: a program over dispersed copies, a design, an engine, n cases.

    `description` is plain data that, with seed, design, engine and program, identifies a study in a
    store: the scenario and its dispersions. `remark` belongs to the results, such as the reason for
    another engine. `history` is the number of instants, evenly over the horizon, at which signals
    of every case are kept; None keeps none. `names` are those of all thrusters, a two-sided one
    twice, and wheels; without them parts are numbered. Raises `ValueError` if the design has
    another size than the study, or `history` does not suit the program.
    """

    program: Program
    design: AbstractDesign
    engine: AbstractEngine
    count: int
    chunk: int = 256
    gains: Mapping[str, Any] | None = None
    description: Mapping[str, Any] = field(default_factory=dict)
    remark: str | None = None
    history: int | None = None
    names: tuple[str, ...] = ()

    def __post_init__(self):
        if not isinstance(self.program.case_factory, Dispersed):
            raise TypeError("Argument `program` must run dispersed copies.")
        require_counts(count=self.count, chunk=self.chunk)
        if self.history is not None:
            self.program.evenly(self.history)
        if isinstance(self.design, LatinHypercube) and self.design.size != self.count:
            raise ValueError(
                f"A Latin hypercube must have the study's size {self.count}, "
                f"but got {self.design.size}."
            )

    @property
    def case_factory(self) -> Dispersed:
        """The factory of dispersed cases."""
        return self.program.case_factory  # pyright: ignore[reportReturnType]

    @once_property
    def failures(self) -> FailureRecovery | None:
        """Evaluation of failures in flight; None without any."""
        program, copies = self.program, self.case_factory
        duration = float(np.asarray(program.interval)) * program.intervals  # nothing to compile
        return FailureRecovery.of(
            copies.loop, copies.start, duration, program.tolerances, self.names
        )

    @property
    def has_fixed_size(self) -> bool:
        """Whether the cases depend on their total number, so that none may be left out."""
        return isinstance(self.design, LatinHypercube)

    def cases(self, numbers: np.ndarray) -> StudyCase:
        """Return the cases with these numbers, as input of the engine."""
        points = self.design.points(numbers, self.case_factory.dimensions())
        return StudyCase(self.design.noise(np.asarray(numbers)).astype(np.uint32), points)

    def evaluate(self, numbers: np.ndarray) -> Outputs:
        """Return the outputs of these cases."""
        return self.engine.evaluate(self.program, self.cases(numbers), self.gains)

    def values(self, numbers: np.ndarray) -> dict[str, np.ndarray]:
        """Return the store columns of these cases. Histories change no bit of other columns."""
        if self.history is None:
            return self._by_column(self.evaluate(numbers))
        instants = self.program.evenly(self.history)
        outputs, signals = self.engine.observed(
            self.program, self.cases(numbers), self.gains, instants
        )
        names = histories_of(self.case_factory.loop)
        histories = {HISTORY + name: np.asarray(history_of(signals, name)) for name in names}
        return self._by_column(outputs) | histories

    def _by_column(self, outputs: Outputs) -> dict[str, np.ndarray]:
        """Store columns of the outputs, with those of failures."""
        columns = _by_column(outputs)
        if self.failures is None:
            return columns
        draws = {name: np.asarray(values) for name, values in outputs.drawn.items()}
        return columns | self.failures.values(columns, draws)

    def replay(self, number: int) -> Replay:
        """Return one case with its history, bit for bit as in any study."""
        case = jax.tree.map(lambda x: x[0], self.cases(np.array([number])))
        return self.engine.replay(self.program, case, self.gains)

    def columns(self) -> dict[str, Column]:
        """Return the store columns of a case."""
        names = self.case_factory.dispersions.names
        draws = {DRAWN + name: self._draw_column(name) for name in names}
        columns = columns_of(self.case_factory.loop)
        if self.program.error_every:
            columns = columns | {name: column for name, (_, column) in ERRORS.items()}
        if self.failures is not None:
            columns = columns | self.failures.columns()
        columns = columns | requirement_columns(self.program.requirements) | draws
        if self.history is not None:
            for name, column in histories_of(self.case_factory.loop).items():
                shape, dims = (self.history, *column.shape), (HISTORY_TIME, *column.dims)
                columns[HISTORY + name] = column._replace(shape=shape, dims=dims)
        return columns

    def coordinates(self) -> dict[str, Coordinate]:
        """Return the labels of the axes of the columns."""
        sizes = {
            axis: size
            for column in self.columns().values()
            for axis, size in zip(column.dims, column.shape, strict=True)
        }
        labels = {axis: Coordinate(self._components(axis, size)) for axis, size in sizes.items()}
        if ATTITUDE_SENSOR in labels:
            labels[ATTITUDE_SENSOR] = Coordinate(attitude_sensors(self.case_factory.loop))
        if REQUIREMENT in labels and self.program.requirements is not None:
            labels[REQUIREMENT] = Coordinate(self.program.requirements.names)
        if HISTORY_TIME in labels:
            times = tuple(self._history_times or ())
            labels[HISTORY_TIME] = Coordinate(times, "s", "time since the start")
        return labels

    def _components(self, axis: str, size: int) -> tuple[str, ...]:
        """Names of parts, if the study has exactly `size`, else names of components."""
        begin = f"{axis} "
        names = [one.removeprefix(begin) for one in self.names if one.startswith(begin)]
        return tuple(distinct(names)) if len(names) == size else components(axis, size)

    def _draw_column(self, name: str) -> Column:
        quantity = DISPERSIBLE[name]
        size = QUANTITIES[name].size(self.case_factory.loop)
        unit = data_unit(quantity.unit)
        if size == 1:
            return Column((), "float64", unit, quantity.meaning)
        axis = quantity.axis or f"{name}_component"
        return Column((size,), "float64", unit, quantity.meaning, (axis,))

    @property
    def _history_times(self) -> list[float] | None:
        if self.history is None:
            return None
        interval = float(np.asarray(self.program.interval))
        return (self.program.evenly(self.history) * interval).tolist()

    def program_identity(self) -> dict[str, Any]:
        """Return the identity of the program that computes the cases.

        The program is traced for it, once for this and the first chunk.
        """
        return program_identity(self.engine, self.program, self.cases(np.arange(1)), self.gains)

    def identity(self) -> dict[str, Any]:
        """Return all data that affect the numbers of a case; the count only if it does."""
        return {
            **self.description,
            "history": self._history_times,
            "design": type(self.design).__name__,
            "seed": self.design.seed,
            "size": self.count if self.has_fixed_size else None,
            "engine": self.engine.identity(),
            "program": self.program_identity(),
            "gains": {name: np.asarray(g).tolist() for name, g in (self.gains or {}).items()},
        }


def _by_column(outputs: Outputs) -> dict[str, np.ndarray]:
    arrays = {name: values for name, values in outputs._asdict().items() if values is not None}
    draws = arrays.pop("drawn")
    arrays |= arrays.pop("parts")
    failures = arrays.pop("failures", {})
    errors, estimate = {}, arrays.pop("integration_error", None)
    if estimate is not None:
        errors = {name: getattr(estimate, part) for name, (part, _) in ERRORS.items()}
    margins = arrays.pop("requirements", None)
    if margins is not None:
        errors |= {name: getattr(margins, part) for name, (part, _) in REQUIREMENTS.items()}
    rotation = pointing_error(np.asarray(outputs.quaternion))
    arrays["pointing_error"] = np.linalg.norm(rotation, axis=-1)
    columns = {
        DRAWN + name: values[..., 0] if values.shape[-1] == 1 else values
        for name, values in draws.items()
    }
    return {**arrays, **failures, **errors, **columns}
