"""Measurements of one sample as the input of flight code, with any sensors of vectors."""

import keyword
from collections import namedtuple
from collections.abc import Sequence
from typing import Any, NamedTuple

from jaxtyping import Array, Float

from jaxsat.control.navigation.estimator import Measurement
from jaxsat.core.array_types import Vector
from jaxsat.core.attitude import Quaternion
from jaxsat.core.declaration.sensors import OTHER_SENSORS
from jaxsat.core.once import once
from jaxsat.flight.flight import CannotExport, Input, Seen
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.wheels import wheel_momentum

MAX_MEASUREMENTS = 8
"""Largest number of measurements, each of which has a bit of the guard's status."""


class Measured(NamedTuple):
    """Measurements of one sample.

    `rate` is that of the gyro (rad/s), `attitude` the last one from the star tracker (unit
    quaternion, scalar first, relative to the orbit frame), `seen` whether one has arrived. With
    wheels, `wheel_momentum` is the momentum of each by its tachometer (N m s). Each sensor of a
    vector, such as a magnetometer, has the vector that was `measured` in body axes, the `reference`
    in the orbit frame at that time (both in the sensor's unit), and whether both have arrived.
    """

    rate: Vector
    attitude: Float[Array, "4"] | None
    seen: Array | None
    wheel_momentum: Float[Array, " wheels"] | None = None

    def measurement(self: Any) -> Measurement:
        """Return what an estimator is given."""
        attitude = None if self.attitude is None else Quaternion(self.attitude)
        vectors = tuple(getattr(self, name) for name in vector_names(self))
        return Measurement(self.rate, attitude, self.seen, vectors)


def vector_names(measured: Any) -> tuple[str, ...]:
    """Return the names of measurements of vectors, in the order of an estimator's."""
    return measured._fields[len(Measured._fields) :]


@once
def _with_vectors(names: tuple[str, ...]) -> Any:
    """Return the class `Measured` with further fields of these names."""
    fields = {*Measured._fields, *Input._fields}
    for name in names:
        if name in fields or name.startswith("_") or keyword.iskeyword(name):
            message = f"must have another name in flight code, got {name}"
            raise CannotExport(f"{OTHER_SENSORS}.{name}: {message}")
    base: Any = namedtuple(Measured.__name__, (*Measured._fields, *names))
    own = {"measurement": Measured.measurement, "__doc__": Measured.__doc__, "__slots__": ()}
    return type(Measured.__name__, (base,), own)


def measured_by(
    measurement: Measurement, vectors: Sequence[str], wheel_momentum: Array | None
) -> Any:
    """Return measurements as the input of a sample, `Measured` with those of `vectors` by name."""
    attitude = None if measurement.attitude is None else measurement.attitude.q
    rate: Any = measurement.rate
    fields = (rate, attitude, measurement.seen, wheel_momentum)
    return _with_vectors(tuple(vectors))(*fields, *measurement.vectors)


def vectors_of(loop: SampledLoop) -> list[str]:
    """Return the names of a loop's measurements of vectors."""
    sensors = () if loop.navigation is None else loop.navigation.vectors
    return [one.key for one in sensors]


def measured_example(loop: object, start: PlantState) -> Any:
    """Return measurements with the shapes of a loop's, those of `start` without an estimator."""
    momentum = wheel_momentum(start)
    if not isinstance(loop, SampledLoop) or loop.navigation is None:
        return Seen(start.attitude, start.omega, momentum)
    measured = measured_by(loop.navigation.example(), vectors_of(loop), momentum)
    count = 1 + sum(one is not None for one in (measured.attitude, momentum))
    if count + len(loop.navigation.vectors) > MAX_MEASUREMENTS:
        message = f"must be at most {MAX_MEASUREMENTS - count} sensors of vectors in flight code"
        raise CannotExport(f"{OTHER_SENSORS}: {message}, got {len(loop.navigation.vectors)}")
    return measured
