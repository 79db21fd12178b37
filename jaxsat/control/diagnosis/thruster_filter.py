"""Rate changes that thrusters were not commanded to make.

The residual is the measured change of angular momentum less the expected one, over the inertia. A
thruster has these kinds of failure in the plane of (a, b) of `jaxsat.control.diagnosis.isolation`:

    dead (1, 0), degraded (s, 0), stuck on (1, 1), stuck at (1, s), leaking (s, s), reversed (2, 0).
"""

import math
from typing import ClassVar, NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.control.diagnosis.isolation import (
    DiagnosedKind,
    Hypotheses,
    Residual,
    most_likely,
    stacked_parts,
)
from jaxsat.control.diagnosis.residual import (
    BELIEVED_SIGMAS,
    RESTLESSNESS,
    TEST_SIGMAS,
    TRACKING,
    AbstractResidualFilter,
    ActuatorCondition,
    FilterMemory,
    Prediction,
    Reading,
    believed,
    momentum_with_rotors,
)
from jaxsat.core.array_types import BoolScalar, RealScalar, Vector
from jaxsat.core.checks import finite, not_negative, positive
from jaxsat.spacecraft.dynamics import RigidBody
from jaxsat.spacecraft.modulation import AbstractModulation
from jaxsat.spacecraft.wheels import Wheels

SLOW_TRACKING = 0.03
"""Fraction of the error of the torque besides a flow that is corrected at each sample."""

STEADY_GAIN = (math.sqrt(RESTLESSNESS**2 + 4 * RESTLESSNESS) - RESTLESSNESS) / 2
"""Steady-state gain K of the filter: K²/(1-K) is `RESTLESSNESS`."""

STEADY_VARIANCE = 1 / (1 - STEADY_GAIN)
"""Steady-state variance of the innovations, over that of the noise."""

FIRST_SAMPLES, MOST_SAMPLES, LAST_SAMPLES = 3.0, 300.0, 300.0
"""Samples that the prior of no external torque counts for, and after which its estimate is frozen:
it would learn what a thruster lacks now and then. While errors of commanded torques outweigh all
samples, the estimate is a mean of the last ones: it follows these errors, too."""


LEAST_TURN = math.radians(1.0)
"""Turn (rad) at rest by an external torque that the estimate tells from none."""


def samples_of_torque(rate_noise: float, period: float, natural_frequency: float) -> float:
    """Return the number of samples after which the estimate of the external torque is frozen.

    It is `MOST_SAMPLES`, or more so that `LEAST_TURN` is `BELIEVED_SIGMAS` of the estimate: a
    steady acceleration a turns a body by a/ω² under a law of natural frequency ω (rad/s).
    """
    noise = STEADY_GAIN * math.sqrt(STEADY_VARIANCE) * rate_noise / period
    sigmas = noise / (natural_frequency**2 * LEAST_TURN)
    return max(MOST_SAMPLES, (BELIEVED_SIGMAS * sigmas) ** 2)


class ThrusterModel(eqx.Module):
    """Torques `torque` (3, m) at full thrust (N m), and the modulation of duties into pulses.

    Thrust begins `opening_delay` (s) after a command to open, on average over its rise, and ends
    `closing_delay` (s) after one to shut. The thrusters of the plant may differ from this model.
    """

    torque: Float[Array, "3 m"] = eqx.field(converter=finite("torque"))
    min_on_time: Float[Array, " m"] = eqx.field(converter=not_negative("min_on_time"))
    opening_delay: Float[Array, " m"] = eqx.field(converter=not_negative("opening_delay"))
    closing_delay: Float[Array, " m"] = eqx.field(converter=not_negative("closing_delay"))
    modulation: AbstractModulation

    @property
    def count(self) -> int:
        """Number of thrusters."""
        return self.torque.shape[1]

    def on_times(
        self, duty: Float[Array, " m"], memory: PyTree, period: RealScalar
    ) -> tuple[Float[Array, " m"], Float[Array, " m"], PyTree]:
        """Return on-times (s) by the duties of a period in it and in the next, and the memory.

        On-times are ∫ thrust dt over full thrust, as commanded.
        """
        pulses, memory = self.modulation(duty, memory, period, self.min_on_time)
        real = pulses.off > pulses.on
        on, off = pulses.on + self.opening_delay[None], pulses.off + self.closing_delay[None]

        def within(begin, end):
            length = jnp.clip(off, begin, end) - jnp.clip(on, begin, end)
            thrust = pulses.level * jnp.maximum(length, 0.0)
            return jnp.sum(jnp.where(real, thrust, 0.0), axis=0)

        return within(0.0, period), within(period, 2 * period), memory


def _parts(information, weighted, uncertainty) -> Float[Array, "kinds 2 m"]:
    """Return the most likely (a, b) of every kind; b of one stuck on is its real full thrust."""
    aa, ab, bb = information
    y, z = weighted
    one, zero = jnp.ones_like(y), jnp.zeros_like(y)
    loss, stuck = most_likely(y, aa), most_likely(z - ab, bb)
    certain = 1 / uncertainty**2
    fully = (z - ab + certain) / (bb + certain)
    leak = most_likely(y + z, aa + 2 * ab + bb)
    return stacked_parts(
        (one, zero), (loss, zero), (one, fully), (one, stuck), (leak, leak), (2 * one, zero)
    )


class Late(NamedTuple):
    """Missing on-time (s) of failed thrusters that may come late, and the effect of wheels.

    `turned` (rad/s) is the rate that the momentum of wheels would give the body, None without.
    """

    on_time: Float[Array, " m"]
    turned: Vector | None = None


class ThrusterFilter(AbstractResidualFilter):
    """A Kalman filter of the rate about three axes alike, with a scalar variance.

    With `wheels` the rate is that of the body if they held no momentum, which wheel motors leave
    unchanged. `model` is the law's model of the plant, `rate_noise` (rad/s) the standard deviation
    of such a rate, and `most_samples` as of `samples_of_torque`. Thrust that a failed thruster
    lacks may come late: for some samples its effect is in doubt, and not taken for a failure of
    another. Commands are on-times, s. Its `own` memory is `Late`.
    """

    hypotheses: ClassVar[Hypotheses] = Hypotheses(
        kinds=tuple(range(DiagnosedKind.REVERSED + 1)),
        free=(DiagnosedKind.DEGRADED, DiagnosedKind.STUCK_AT, DiagnosedKind.LEAKING),
        full=DiagnosedKind.STUCK_ON,
        level=1.0,
        parts=_parts,
    )
    restarts_at_losses: ClassVar[bool] = False

    model: RigidBody
    thrusters: ThrusterModel
    rate_noise: RealScalar = eqx.field(converter=positive("rate_noise"))
    wheels: Wheels | None = None
    most_samples: RealScalar = eqx.field(converter=positive("most_samples"), default=MOST_SAMPLES)

    @property
    def count(self) -> int:
        """Number of thrusters."""
        return self.thrusters.count

    @property
    def noise(self) -> Float[Array, "1"]:
        """Standard deviation of an estimated rate, rad/s."""
        return self.rate_noise[None]

    def read(self, reading: Reading) -> Float[Array, "3 1"]:
        """Return the rate (rad/s) that the body would have with the momentum of the wheels."""
        turned = self._turned(reading)
        return (reading.rate if turned is None else reading.rate + turned)[:, None]

    def _turned(self, reading: Reading) -> Vector | None:
        """Return the rate (rad/s) that the momentum of wheels would give the body; None without."""
        if self.wheels is None:
            return None
        momentum = momentum_with_rotors(self.wheels, reading)
        return self.model.spacecraft.inverse_inertia @ (self.wheels.axes @ momentum)

    def init(self, reading: Reading) -> FilterMemory:
        """Return the memory before the first estimated rate."""
        rate = self.read(reading)
        none = jnp.zeros((3, self.count), rate.dtype)
        no, variance = jnp.array(False), self.noise**2
        own = Late(none[0], self._turned(reading))
        errors = jnp.zeros((self.count + 5, 3, 1), rate.dtype)
        return FilterMemory(rate, variance, none, none, errors, none[0, 0], no, own)

    def predicted(
        self,
        reading: Reading,
        commanded: Float[Array, " m"],
        condition: ActuatorCondition,
        period: RealScalar,
        memory: FilterMemory,
    ) -> Prediction:
        """Predict the effect of on-times (s), and of unwatched and gyroscopic torques."""
        on_time, body = commanded, self.model.spacecraft
        inverse = body.inverse_inertia
        effect = inverse @ self.thrusters.torque
        turned = self._turned(reading)
        middle = (memory.estimate[:, 0] + self.read(reading)[:, 0]) / 2
        turning = middle if turned is None else middle - (memory.own.turned + turned) / 2
        gyroscopic = -period * (inverse @ jnp.cross(turning, body.inertia @ middle))
        expected = condition.part * on_time + condition.flow * period
        besides = self.believed(condition, period)
        change = effect @ expected + gyroscopic + period * (inverse @ besides)
        # Of a symmetrical body the parts of the moments are large, although their sum is not.
        moments = jnp.diagonal(body.inertia)
        turns = period * jnp.cross(turning, jnp.diag(moments * turning)) @ inverse.T
        by_others = jnp.zeros((2, 3))
        if turned is not None:
            by_others = by_others.at[0].set(turned - memory.own.turned)
        if reading.unwatched is not None:
            by_others = by_others.at[1].set(period * (inverse @ reading.unwatched))
            change = change + by_others[1]
        # Flows and the torque from outside are estimated from rates, with the model's own errors.
        thrusts = (effect * (condition.part * on_time)[None]).T
        known = jnp.sum(thrusts, axis=0) + gyroscopic + by_others[1] - by_others[0]
        by_moment = -turns - jnp.diag(moments * known) @ inverse.T
        squares = jnp.sum((effect * expected[None]) ** 2) + jnp.sum(by_others**2)
        missing = jnp.where(condition.failed, 1 - condition.part, -condition.part) * on_time
        return Prediction(
            change[:, None],
            squares + jnp.sum(turns**2),
            jnp.concatenate([thrusts, by_others, by_moment])[:, :, None],
            effect * missing[None],
            effect * period,
            lambda _, left: Late(
                jnp.where(condition.failed, left * memory.own.on_time + missing, 0.0), turned
            ),
            period,
            passing=jnp.sum((effect * memory.own.on_time[None]) ** 2),
        )

    def tracked(
        self,
        residual: Residual,
        condition: ActuatorCondition,
        period: RealScalar,
        quiet: BoolScalar,
    ) -> ActuatorCondition:
        """Correct the flows of failed thrusters, and the external torque.

        Without a flow the torque is the mean of the samples, each weighted by its information.
        Torques that the model has wrong, by thrust or inertia, err alike in many samples, which
        together say no more than one with the variance `wrong`, over that of the noise: the
        information of n samples is 1/(1/n + wrong), and grows by (1 - n wrong)² with each.
        """
        body = self.model.spacecraft
        effect = period * (body.inverse_inertia @ self.thrusters.torque)
        more = jnp.sum(effect * residual.innovation, axis=0) / jnp.sum(effect**2, axis=0)
        flows = condition.failed & (condition.flow > 0)
        flow = jnp.clip(condition.flow + TRACKING * more, 0.0, 1.0)
        opposed, steady = jnp.any(flows), cast(RealScalar, residual.steady)
        noise = STEADY_VARIANCE * self.rate_noise**2
        wrong = jnp.maximum(residual.variance[0] / noise - 1, 0.0) / STEADY_GAIN**2
        new = jnp.maximum(1 - wrong * condition.samples, 0.0) ** 2
        each = jnp.where(quiet & (condition.samples < self.most_samples), 1.0, 0.0)
        each = each * (steady * STEADY_GAIN / period) ** 2
        weight = each * new * noise / residual.variance[0]
        beyond = jnp.maximum(wrong * condition.samples - 1, 0.0) / jnp.where(wrong > 0, wrong, 1.0)
        samples = condition.samples + weight - each * beyond / LAST_SAMPLES
        mean = weight / (samples + FIRST_SAMPLES) + each * (1 - new) / LAST_SAMPLES
        mean = mean / jnp.where(steady > 0, steady, 1.0)
        part = jnp.where(opposed, SLOW_TRACKING / period, mean)
        doubted = condition.torque - self.believed(condition, period)
        error = residual.innovation[:, 0] - steady * (body.inverse_inertia @ doubted)
        return condition._replace(
            flow=jnp.where(flows, flow, condition.flow),
            torque=condition.torque + part * (body.inertia @ error),
            samples=jnp.where(opposed, 0.0, samples),
        )

    def believed(self, condition: ActuatorCondition, period: RealScalar) -> Vector:
        """Return the part of the estimated external torque that stands out of its noise, N m."""
        rate = self.model.spacecraft.inverse_inertia @ condition.torque * period
        root_samples = jnp.sqrt(condition.samples + FIRST_SAMPLES)
        sigma = STEADY_GAIN * jnp.sqrt(STEADY_VARIANCE) * self.rate_noise / root_samples
        part = believed(jnp.sum((rate / sigma) ** 2))
        opposed = jnp.any(condition.failed & (condition.flow > 0))
        return jnp.where(opposed, 1.0, part) * condition.torque

    def torque_of(self, acceleration: Vector) -> Vector:
        """Return the torque (N m) of an acceleration (rad/s²)."""
        return self.model.spacecraft.inertia @ acceleration

    def test_command(self, period: RealScalar, sigma: Float[Array, "1"]) -> Float[Array, " m"]:
        """Return duties of pulses that stand out of errors of a rate (rad/s)."""
        effect = self.model.spacecraft.inverse_inertia @ self.thrusters.torque
        on_time = TEST_SIGMAS * sigma / jnp.sqrt(jnp.sum(effect**2, axis=0))
        return jnp.minimum(jnp.maximum(on_time, self.thrusters.min_on_time) / period, 1.0)
