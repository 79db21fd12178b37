"""Settling criteria and settling time, all compatible with vmap."""

import math
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from jaxsat.core.array_types import RealScalar
from jaxsat.core.checks import as_float, as_optional_float
from jaxsat.core.quotients import reciprocal
from jaxsat.core.ranges import SETTLED_RATE, SETTLED_TURN, SETTLED_W

SETTLED_BEFORE = 0.9
"""Latest start of settling, as a fraction of the horizon, without a `dwell`."""


class Tolerances(eqx.Module):
    """Settling criteria: upper limits of |w|, |z| (rad, wrapped) and |ω_r| (rad/s).

    The relative rate is ω - C (0, -ω0, 0)ᵀ, the rate of change of the attitude. The state must stay
    within the limits to the end, for at least `dwell` seconds; None is a tenth of the horizon.
    """

    w: RealScalar = eqx.field(converter=as_float, default=SETTLED_W)
    z: RealScalar = eqx.field(converter=as_float, default=SETTLED_TURN)
    relative_rate: RealScalar = eqx.field(converter=as_float, default=SETTLED_RATE)
    dwell: RealScalar | None = eqx.field(converter=as_optional_float, default=None)

    @staticmethod
    def of_keys(
        tilt_rad: float | None = None,
        turn_rad: float = SETTLED_TURN,
        rate_rad_s: float = SETTLED_RATE,
        dwell_s: float | None = None,
    ) -> "Tolerances":
        """Return the tolerances for the keys of a scenario's `[settled]`."""
        w = SETTLED_W if tilt_rad is None else math.tan(tilt_rad / 2)
        return Tolerances(w, turn_rad, rate_rad_s, dwell_s)

    def of_rate(self, orbit_rate: float | RealScalar) -> "Tolerances":
        """Return the tolerances of a law without a target attitude: of the inertial rate alone.

        At rest the inertial rate is the orbit's.
        """
        return Tolerances(math.inf, math.inf, self.relative_rate + orbit_rate, self.dwell)

    def text(self, attitude: bool = True) -> str:
        """Return the settling criterion as a line; without `attitude` of the inertial rate."""
        end = " to the end"
        if self.dwell is not None:
            end += f", {float(self.dwell):g} s at least"
        return self.limits_text(attitude) + end

    def limits_text(self, attitude: bool = True) -> str:
        """Return the limits of a settled state as one line, without the dwell."""
        w, z, rate = (float(limit) for limit in (self.w, self.z, self.relative_rate))
        if not attitude:
            return f"|ω| < {rate:g} rad/s"
        of_attitude = f"|w| < {w:g}, |z| < {z:g} rad, " if math.isfinite(w) else ""
        return f"{of_attitude}relative rate |ω_r| < {rate:g} rad/s"


def wrap_angle(angle: Float[Array, "*n"]) -> Float[Array, "*n"]:
    """Wrap an angle to [-π, π), rad."""
    return angle - 2 * jnp.pi * jnp.floor(angle * (0.5 / jnp.pi) + 0.5)


def excess(
    w: Float[Array, "*times 2"],
    z: Float[Array, "*times"],
    relative_rate: Float[Array, "*times 3"],
    tolerances: Tolerances,
) -> Float[Array, "*times 3"]:
    """Return |w|, |z| (wrapped) and |ω_r| over their tolerances, less 1: negative inside."""
    sizes = (_length(w), jnp.abs(wrap_angle(z)), _length(relative_rate))
    limits = (tolerances.w, tolerances.z, tolerances.relative_rate)
    parts = [size * reciprocal(limit) for size, limit in zip(sizes, limits, strict=True)]
    return jnp.stack(parts, axis=-1) - 1


def within(
    w: Float[Array, "times 2"],
    z: Float[Array, " times"],
    relative_rate: Float[Array, "times 3"],
    tolerances: Tolerances,
) -> Bool[Array, " times"]:
    """Whether all tolerances are met at each time; false after the early end of a run (NaN)."""
    return jnp.all(excess(w, z, relative_rate, tolerances) < 0, axis=-1)


def _length(vector: Float[Array, "*times n"]) -> Float[Array, "*times"]:
    return jnp.sqrt(jnp.sum(vector**2, axis=-1))


class SettlingTracker(NamedTuple):
    """Settling start, from observations of a run one after the other.

    A condition holds while its excess is negative. `start` (s) is infinite while one does not;
    `time` (s) and `excess` are those of the last observation.
    """

    start: RealScalar
    time: RealScalar
    excess: Float[Array, " n"]

    @staticmethod
    def initial(time: RealScalar, conditions: int) -> "SettlingTracker":
        """Return the tracker before the first observation, which will be at `time` (s)."""
        return SettlingTracker(time + jnp.inf, time, jnp.full(conditions, -1.0, time.dtype))

    def observe(self, time: RealScalar, excess: Float[Array, " n"]) -> "SettlingTracker":
        """Return the tracker after an observation at `time` (s), excesses linear in between."""
        enters = (self.excess >= 0) & (excess < 0)
        fall = jnp.where(enters, self.excess - excess, 1.0)
        part = jnp.max(jnp.where(enters, self.excess / fall, 0.0))
        return self.observe_after_entry(self.time + part * (time - self.time), time, excess)

    def observe_after_entry(
        self, entry: RealScalar, time: RealScalar, excess: Float[Array, " n"]
    ) -> "SettlingTracker":
        """Return the tracker as `observe`, with conditions met, if so, from `entry` (s) on."""
        start = jnp.where(jnp.isinf(self.start), entry, self.start)
        return SettlingTracker(jnp.where(jnp.all(excess < 0), start, jnp.inf), time, excess)

    def settling_time(
        self, end: RealScalar, begin: float | RealScalar = 0.0, dwell: RealScalar | None = None
    ) -> RealScalar:
        """Return the start (s), if it is at least `dwell` seconds before the `end`, else infinity.

        A recently settled state has not been shown to last: None is a tenth of the horizon, see
        `SETTLED_BEFORE`.
        """
        latest = begin + SETTLED_BEFORE * (end - begin) if dwell is None else end - dwell
        return jnp.where(self.start <= latest, self.start, jnp.inf)
