"""Causes of failing cases: what separates them from others, and measured effects of changes."""

from collections.abc import Callable, Iterator, Mapping
from typing import NamedTuple

import numpy as np

from jaxsat.core.allocation import torque_directions
from jaxsat.scenario import Scenario
from jaxsat.scenario.derived import believed_axes
from jaxsat.scenario.parts.wheels import rotors
from jaxsat.scenario.quantities import inertia_matrix
from jaxsat.studies.ensemble import DRAWN
from jaxsat.studies.sensitivities import Sensitivities, Sensitivity, numbers_of
from jaxsat.synthesis.controller_design.candidates import Candidate
from jaxsat.synthesis.controller_design.studies import Columns
from jaxsat.synthesis.controller_design.variants import (
    DISTURBANCE,
    DURATION,
    NOISE,
    entries,
    multiplied,
    narrowed,
    stronger,
    turned,
)
from jaxsat.synthesis.controller_design.vehicle import VehicleVerdict, coupling

MOST_FLOWN = 400
"""Largest number of failing cases that are flown again."""

MOST_NAMED = 5
"""Largest number of reported quantities that separate failing cases."""

CHANCE = 1.001
"""Torque factor whose effect shows mere chance."""

COUPLING = "coupling c"

TENTH = "a tenth of the"


class Separation(NamedTuple):
    """A quantity by which failing cases differ, with 10, 50 and 90 percentiles of both groups."""

    name: str
    share: float
    failing: tuple[float, float, float]
    settled: tuple[float, float, float]


class Remedy(NamedTuple):
    """A change, and how many of the failing cases flown with it settle."""

    change: str
    settled: int
    flown: int

    @property
    def cost(self) -> float:
        """Factor of cases that it must settle beyond a change that is easier to make."""
        return 1.25 if self.change.startswith(TENTH) else 1.0


def separations(
    scenario: Scenario, columns: Columns, two_torques: bool = False
) -> tuple[Separation, ...]:
    """Return the quantities that significantly separate failing cases, the strongest first."""
    settled = np.isfinite(columns["settling_time"])
    numbers = drawn_numbers(scenario, columns, two_torques)
    measure = Sensitivities([settled])
    for name, values in numbers.items():
        measure.add(name, values)
    (ranking,) = measure.ranked()
    return tuple(
        _separation(entry, numbers[entry.name], settled) for entry in ranking if entry.matters
    )[:MOST_NAMED]


def drawn_numbers(
    scenario: Scenario, columns: Columns, two_torques: bool = False
) -> dict[str, np.ndarray]:
    """Return all drawn numbers, the size of the initial rate, and for two torques c."""
    numbers: dict[str, np.ndarray] = {}
    for key, values in columns.items():
        if key.startswith(DRAWN):
            numbers |= numbers_of(key.removeprefix(DRAWN), np.asarray(values))
    if f"{DRAWN}omega" in columns:
        numbers["size of omega"] = np.linalg.norm(columns[f"{DRAWN}omega"], axis=1)
    if two_torques and f"{DRAWN}inertia" in columns:
        numbers[COUPLING] = _couplings(scenario, columns)
    return numbers


def remedies(
    chosen: Candidate, others: tuple[Candidate, ...], verdict: VehicleVerdict
) -> Iterator[tuple[str, Callable[[], Scenario]]]:
    """Yield changes that may help, with their scenarios; the first shows the effect of chance."""
    scenario = chosen.scenario
    yield ("0.1 % more torque, to show the effect of chance", lambda: stronger(scenario, CHANCE))
    yield "twice the torque", lambda: stronger(scenario, 2.0)
    yield "twice the time", lambda: multiplied(scenario, 2.0, DURATION)
    if _has(scenario, NOISE):
        yield "half the noise of the sensors", lambda: multiplied(scenario, 0.5, NOISE)
    if _has(scenario, DISTURBANCE):
        yield "half the disturbance", lambda: multiplied(scenario, 0.5, DISTURBANCE)
    for name, key in (("inertia", "inertia"), ("thrust", "torque_gain"), ("axes", "misalignment")):
        table = getattr(scenario.dispersion, _key(key), None)
        if table is not None and table.distribution == "uniform":
            yield f"half the error of the {name}", lambda key=key: narrowed(scenario, _key(key))
            yield (
                f"{TENTH} error of the {name}",
                lambda key=key: narrowed(scenario, _key(key), 0.1),
            )
    if verdict.turn is not None and any(verdict.turn) and not verdict.holds:
        yield "the nearest attitude that can be held", lambda: turned(scenario, verdict.turn or ())
    for other in others:
        yield f"the law {other.name}", lambda other=other: other.scenario


def _has(scenario: Scenario, keys: Mapping[str, tuple[str, ...]]) -> bool:
    """Whether any of these numbers is not zero."""
    data = scenario.model_dump(exclude_none=True, include={*keys})
    return any(np.any(table[key]) for table, key in entries(data, keys))


def _key(name: str) -> str:
    return "misalignment_rad" if name == "misalignment" else name


def _separation(entry: Sensitivity, values: np.ndarray, settled: np.ndarray) -> Separation:
    def percentiles(sample: np.ndarray) -> tuple[float, float, float]:
        low, middle, high = np.percentile(sample, (10, 50, 90)).tolist()
        return low, middle, high

    return Separation(
        entry.name,
        entry.first_order.value,
        percentiles(values[~settled]),
        percentiles(values[settled]),
    )


def _couplings(scenario: Scenario, columns: Columns) -> np.ndarray:
    """Return c of every drawn body, about the nominal torque axes."""
    nominal = inertia_matrix(scenario.spacecraft.inertia_kg_m2)
    directions = torque_directions(believed_axes(scenario))
    scale = np.sqrt(1 + np.asarray(columns[f"{DRAWN}inertia"]))
    bodies = nominal * scale[:, :, None] * scale[:, None, :]
    products = columns.get(f"{DRAWN}products_of_inertia")
    if products is not None:
        extra = np.asarray(products) * np.diag(nominal).min()
        for place, (i, j) in enumerate(((0, 1), (0, 2), (1, 2))):
            bodies[:, i, j] += extra[:, place]
            bodies[:, j, i] += extra[:, place]
    bodies = bodies - rotors(scenario.wheel)
    return np.array([coupling(body, directions) for body in bodies])
