"""The parts of the laws that settle, each flown alone: no scenario names these laws."""

import enum
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

from jaxsat.control.estimators import EstimatorMemory, ThirdAxisEstimator
from jaxsat.control.finite_time_rate import FiniteTimeRate, Signs
from jaxsat.control.normal_form import clipped, tilt_of
from jaxsat.control.oscillatory import Oscillation, Oscillator
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.control.slews import Leg, Slewing, SlewPlanner
from jaxsat.core.checks import as_float
from jaxsat.core.trees import choose
from jaxsat.spacecraft.dynamics import PlantState

RealScalar = Float[Array, ""]


def time_to_zero(law, omega3, c):
    """Seconds until |ω3| has fallen to the dead zone of a `FiniteTimeRate` whose references are
    tracked: d|ω3|/dt = -|c| a b (|ω3| - ε)^⅔."""
    a, b = law.factors(c)
    excess = jnp.maximum(jnp.abs(omega3) - law.dead_zone, 0.0)
    return 3 * jnp.cbrt(excess) / (jnp.abs(c) * a * b)


class FiniteTimeRateMemory(NamedTuple):
    """The signs, the estimator's memory and the rates asked for."""

    signs: Signs
    estimator: EstimatorMemory
    reference: Float[Array, "2"]


class FiniteTimeRateLaw(AbstractSampledController):
    """The finite-time law alone: stops the rotation from any rates; `period` is in s."""

    law: FiniteTimeRate
    estimator: ThirdAxisEstimator
    period: RealScalar = eqx.field(converter=as_float)

    def init(self, state: PlantState) -> FiniteTimeRateMemory:
        """The memory at the start: no signs are chosen, nothing is estimated."""
        reference = jnp.zeros(2, state.omega.dtype)
        return FiniteTimeRateMemory(
            self.law.init(state), self.estimator.init(self.law.form.seen(state).omega), reference
        )

    def step(
        self, t: RealScalar, state: PlantState, memory: FiniteTimeRateMemory
    ) -> tuple[Float[Array, "2"], FiniteTimeRateMemory]:
        """Estimate, signs, references, torque."""
        omega = self.law.form.seen(state).omega
        third, estimator = self.estimator.update(omega, memory.estimator, self.period)
        signs = self.law.signs(third, omega, memory.signs)
        tracking = self.law.tracking(third, omega, signs)
        torque = clipped(self.law.torque(omega, tracking), self.law.torque_limit)
        return self.law.form.command(torque), FiniteTimeRateMemory(signs, estimator, tracking.rate)

    def rate_error(self, state: PlantState, memory: FiniteTimeRateMemory) -> Float[Array, "2"]:
        """ω - ω_d, rad/s."""
        return self.law.form.seen(state).omega[:2] - memory.reference


class OscillatoryMemory(NamedTuple):
    """The oscillation asked for last, the estimator's memory and the rates asked for."""

    oscillation: Oscillation
    estimator: EstimatorMemory
    reference: Float[Array, "2"]


class OscillatoryLaw(AbstractSampledController):
    """Oscillator and estimator alone, from any attitude, without an end game.

    `torque_limit` (N m) cuts the commands, `period` is in s.
    """

    oscillator: Oscillator
    estimator: ThirdAxisEstimator
    torque_limit: RealScalar = eqx.field(converter=as_float)
    period: RealScalar = eqx.field(converter=as_float)

    def init(self, state: PlantState) -> OscillatoryMemory:
        """The memory at the start: no oscillation yet, nothing estimated."""
        omega = self.oscillator.form.seen(state).omega
        reference = jnp.zeros(2, omega.dtype)
        return OscillatoryMemory(self.oscillator.init(omega), self.estimator.init(omega), reference)

    def step(
        self, t: RealScalar, state: PlantState, memory: OscillatoryMemory
    ) -> tuple[Float[Array, "2"], OscillatoryMemory]:
        """Estimate, slow errors, oscillation, torque."""
        seen = self.oscillator.form.seen(state)
        third, estimator = self.estimator.update(
            seen.omega, memory.estimator, self.period, seen.attitude
        )
        seen = seen.relative_to(third.turn)
        tilt = tilt_of(seen.attitude)
        slow = self.oscillator.slow(t, tilt, third, memory.oscillation)
        wanted = self.oscillator.oscillation(slow, third)
        tracking = self.oscillator.tracking(t, seen, tilt, wanted)
        torque = clipped(self.oscillator.torque(seen.omega, tracking), self.torque_limit)
        return self.oscillator.form.command(torque), OscillatoryMemory(
            wanted, estimator, tracking.rate
        )

    def rate_error(self, state: PlantState, memory: OscillatoryMemory) -> Float[Array, "2"]:
        """ω - ω_d, rad/s."""
        return self.oscillator.form.seen(state).omega[:2] - memory.reference


class ThreeSlewMemory(NamedTuple):
    """The slews, and how many samples there were, at the first of which they were planned."""

    slewing: Slewing
    samples: Int[Array, ""]


class ThreeSlewLaw(AbstractSampledController):
    """The three slews alone: from rest in any attitude to rest in the orbit frame.

    Afterwards it holds the first two rates at zero. `period` is in s.
    """

    modes: ClassVar[type[enum.IntEnum]] = Leg

    planner: SlewPlanner
    period: RealScalar = eqx.field(converter=as_float)

    def init(self, state: PlantState) -> ThreeSlewMemory:
        """The memory at the start: nothing is planned."""
        return ThreeSlewMemory(self.planner.init(state.omega), jnp.array(0))

    def step(
        self, t: RealScalar, state: PlantState, memory: ThreeSlewMemory
    ) -> tuple[Float[Array, "2"], ThreeSlewMemory]:
        """Plan at the first sample, fly at every other."""
        t = memory.samples * self.period
        seen = self.planner.form.seen(state)
        flown = self.planner.advance(t, seen, memory.slewing, self.period)
        done = memory.slewing.leg == Leg.SLEWED
        flown = choose(done, memory.slewing, flown)
        plan = self.planner.plan(t, seen)
        slewing = choose(memory.samples > 0, flown, plan)
        stopped = slewing._replace(to_go=jnp.where(slewing.leg == Leg.SLEWED, 0.0, slewing.to_go))
        torque = clipped(self.planner.torque(seen.omega, stopped), self.planner.torque_limit)
        return self.planner.form.command(torque), ThreeSlewMemory(slewing, memory.samples + 1)

    def rate_error(self, state: PlantState, memory: ThreeSlewMemory) -> Float[Array, "2"]:
        """Rates less those of the profile; before the first sample the rates, rad/s."""
        omega = self.planner.form.seen(state).omega
        return omega[:2] - self.planner.references(memory.slewing)

    def mode(self, memory: ThreeSlewMemory) -> Int[Array, ""]:
        """The `Leg` under way."""
        return memory.slewing.leg
