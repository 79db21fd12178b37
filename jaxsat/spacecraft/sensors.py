"""Measurement noise of a sampled controller: attitude, rate, and momenta of reaction wheels."""

from collections.abc import Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree, UInt32
from numpy.typing import DTypeLike

from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.core.attitude import WZ, AbstractAttitude, Quaternion
from jaxsat.core.checks import as_optional_float, not_negative, require_positive
from jaxsat.core.noise import fold_in, name_number, sample_noise
from jaxsat.spacecraft.outages import outside_outages, require_outage
from jaxsat.spacecraft.sensor_failures import TachometerFailures
from jaxsat.spacecraft.wheels import WheelMomenta


def as_key(value) -> UInt32[Array, "2"]:
    """Return key data as two 32-bit words."""
    return jnp.asarray(value, jnp.uint32)


class Sensors(eqx.Module):
    """White Gaussian noise of measurements, independent on each axis and at each sample.

    `rate_noise` (rad/s) is the standard deviation on each component of ω. `attitude_noise` (rad) is
    that of each component of a small rotation, in body axes, between the true attitude and the
    measured one. The noise is a function of `key` (two 32-bit words) and of the sample's number.
    """

    rate_noise: RealScalar = eqx.field(converter=not_negative("rate_noise"), default=0.0)
    attitude_noise: RealScalar = eqx.field(converter=not_negative("attitude_noise"), default=0.0)
    key: UInt32[Array, "2"] = eqx.field(converter=as_key, default=(0, 0))

    @classmethod
    def from_table(cls, values: Mapping[str, Any], key: UInt32[Array, "2"]) -> "Sensors":
        """Return the noise of a checked table `[sampling]` of a scenario."""
        return cls(values["rate_noise_rad_s"], values["attitude_noise_rad"], key)

    def __call__(
        self, sample: IntScalar, attitude: AbstractAttitude, omega: Vector
    ) -> tuple[AbstractAttitude, Vector]:
        """Return the measured attitude, in the true one's parameters, and the measured ω, rad/s."""
        return self.with_noise(self.noise(sample, omega.dtype), attitude, omega)

    def noise(self, sample: IntScalar, dtype: DTypeLike) -> Float[Array, "6"]:
        """Return standard normal numbers of a sample, three for rate and three for attitude."""
        return sample_noise(self.key, sample, 6, dtype)

    def with_noise(
        self, noise: Float[Array, "6"], attitude: AbstractAttitude, omega: Vector
    ) -> tuple[AbstractAttitude, Vector]:
        """Return the measured attitude and ω (rad/s) with this noise."""
        turned = turned_slightly(attitude, self.attitude_noise * noise[3:])
        return turned, omega + self.rate_noise * noise[:3]

    def drawn(self, first: IntScalar, count: int, dtype: DTypeLike) -> "DrawnSensors":
        """Return these sensors for `count` samples from number `first` on, with all their noise."""
        noise = jax.vmap(lambda sample: self.noise(sample, dtype))(first + jnp.arange(count))
        return DrawnSensors(self, noise, first)


class DrawnSensors(eqx.Module):
    """Sensors with noise drawn in advance for consecutive samples from number `first` on."""

    sensors: Sensors
    noise: Float[Array, "samples 6"]
    first: IntScalar

    def __call__(
        self, sample: IntScalar, attitude: AbstractAttitude, omega: Vector
    ) -> tuple[AbstractAttitude, Vector]:
        """Return the measured attitude and ω (rad/s), equal to those of `sensors`."""
        return self.sensors.with_noise(self.noise[sample - self.first], attitude, omega)


def turned_slightly(attitude: AbstractAttitude, rotation: Vector) -> AbstractAttitude:
    """Return the attitude after a small rotation of the body (rad, body axes), same parameters.

    The angle is 2 arctan(|rotation| / 2), |rotation| to third order. A turn z stays within π of its
    former value.
    """
    return in_parameters_of(attitude, attitude.as_quaternion().turned(rotation))


def in_parameters_of(attitude: AbstractAttitude, other: Quaternion) -> AbstractAttitude:
    """Return `other` in the parameters of `attitude`; a turn z stays within π of the first's."""
    if isinstance(attitude, Quaternion):
        return other
    if isinstance(attitude, WZ):
        wz = other.as_wz()
        change = jnp.mod(wz.z - attitude.z + jnp.pi, 2 * jnp.pi) - jnp.pi
        return WZ(wz.w, attitude.z + change)
    return other.as_dcm()


class Tachometers(eqx.Module):
    """White Gaussian noise on the momentum that each wheel's tachometer measures, at each sample.

    `noise` (N m s) is the standard deviation for each wheel. The noise is a function of `key` (two
    32-bit words, which other sensors may share) and of the sample's number. A wheel's measurement
    is invalid for `outage` (s) from `outage_start` (s) on; an infinite start means never, None for
    both that no wheel has an outage. Another outage begins `outage_every` (s) after each begin,
    None or infinite for a single one. `failures` number the wheels, and strike after the first
    sample; a stuck tachometer repeats its last reading before that in no outage. Raises
    `ArgumentError` for negative noise or outages, and for outages that leave no time between them.
    """

    noise: Float[Array, " wheels"] = eqx.field(converter=not_negative("noise"))
    key: UInt32[Array, "2"] = eqx.field(converter=as_key, default=(0, 0))
    outage_start: Float[Array, " wheels"] | None = eqx.field(
        converter=as_optional_float, default=None
    )
    outage: Float[Array, " wheels"] | None = eqx.field(converter=as_optional_float, default=None)
    outage_every: Float[Array, " wheels"] | None = eqx.field(
        converter=as_optional_float, default=None
    )
    failures: TachometerFailures | None = None

    def __check_init__(self):
        require_outage(self.outage_start, self.outage, self.outage_every)
        if self.outage is not None:
            require_positive("outage", self.outage, zero_allowed=True)

    @property
    def repeats(self) -> bool:
        """Whether readings may be invalid or repeated."""
        return self.outage is not None or self.failures is not None

    def is_valid(self, sample: IntScalar, period: RealScalar) -> BoolScalar | None:
        """Whether all momenta of a sample are valid, None without outages and failures; `period`
        is in s."""
        works = self._works(sample, period)
        if self.failures is not None:
            alive = ~self.failures.dead(sample, period, self.noise.shape[0])
            works = alive if works is None else alive & works
        return None if works is None else jnp.all(works)

    def first_readings(self) -> Float[Array, " wheels"] | None:
        """Return the readings before the first sample, N m s; None without failures."""
        return None if self.failures is None else jnp.zeros_like(self.noise)

    def read(
        self,
        sample: IntScalar,
        period: RealScalar,
        measured: tuple[PyTree, ...],
        last: Float[Array, " wheels"],
    ) -> tuple[tuple[PyTree, ...], Float[Array, " wheels"]]:
        """Return what is read in place of `measured` states of effectors after the momenta `last`
        (N m s), and the next ones."""
        if self.failures is None:
            return measured, last
        conditions = self.failures.conditions(sample, period, self.key, last.shape[0])
        error = jnp.concatenate([one.error for one in conditions])
        repeats = jnp.stack([one.stuck | one.dead for one in conditions])

        def read(state: PyTree) -> PyTree:
            if not isinstance(state, WheelMomenta):
                return state
            return WheelMomenta(jnp.where(repeats, last, state.momentum + error))

        states = tuple(read(state) for state in measured)
        (momenta,) = [one.momentum for one in states if isinstance(one, WheelMomenta)]
        works = self._works(sample, period)
        return states, momenta if works is None else jnp.where(works, momenta, last)

    def _works(self, sample: IntScalar, period: RealScalar) -> Bool[Array, " wheels"] | None:
        return outside_outages(sample, period, self.outage_start, self.outage, self.outage_every)

    def __call__(self, sample: IntScalar, effectors: PyTree) -> tuple[PyTree, ...]:
        """Return states of effectors with the measured momenta of wheels, N m s."""
        own = fold_in(self.key, jnp.asarray(name_number("tachometers"), jnp.uint32))

        def measured(state: PyTree) -> PyTree:
            if not isinstance(state, WheelMomenta):
                return state
            momentum = state.momentum
            noise = sample_noise(own, sample, momentum.shape[0], momentum.dtype)
            return WheelMomenta(momentum + self.noise * noise)

        return tuple(measured(state) for state in effectors)
