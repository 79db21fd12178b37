"""What a filter of residuals is: innovations of readings, and what failures leave in them.

There is one filter for thrusters and one for wheels. Both know of each actuator in what condition
it is believed to be.
"""

import abc
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, Int, PyTree

from jaxsat.control.diagnosis.isolation import AnyResidual, Hypotheses

RealScalar = Float[Array, ""]

RESTLESSNESS = 0.25
"""Process noise over the noise of the rate, so that a signature decays by 0.39 a sample."""

TEST_SIGMAS = 6.0
"""Effect of a test pulse on what is read, over its noise."""

TRACKING = 0.1
"""Part of the error of a flow that is taken out with each sample."""


class ActuatorCondition(NamedTuple):
    """What is believed of each actuator: whether it has `failed`, and what it makes.

    The part `part` of what is commanded, and the part `flow` of full torque all the time, which is
    what brakes a wheel. `torque` (N m) is what acts besides all the time: on the spacecraft from
    outside, and where others oppose a flow and make not quite what they should. As many `samples`
    tell of it.
    """

    failed: Bool[Array, " m"]
    part: Float[Array, " m"]
    flow: Float[Array, " m"]
    torque: Float[Array, "3"]
    samples: RealScalar

    @staticmethod
    def sound(count: int) -> "ActuatorCondition":
        """All work, and nothing is known to act besides."""
        zero = jnp.zeros(count)
        return ActuatorCondition(zero > 0, zero + 1, zero, jnp.zeros(3), jnp.array(0.0))


class AbstractResidualFilter(eqx.Module):
    """What makes innovations of readings and commands, and knows what a failure leaves in them."""

    hypotheses: ClassVar[Hypotheses]

    uncertainty: eqx.AbstractVar[RealScalar]

    @property
    @abc.abstractmethod
    def count(self) -> int:
        """How many actuators there are."""

    @property
    @abc.abstractmethod
    def noise(self) -> RealScalar | Float[Array, " m"]:
        """Standard deviation of what is read."""

    @abc.abstractmethod
    def init(self, reading: PyTree) -> PyTree:
        """The filter's memory before the first reading."""

    @abc.abstractmethod
    def restarted(self, memory: PyTree, verdict: Bool[Array, ""], alarm: Bool[Array, ""]) -> PyTree:
        """The memory after a verdict, or an alarm, or neither."""

    @abc.abstractmethod
    def step(
        self,
        reading: PyTree,
        commanded: Float[Array, " m"],
        condition: "ActuatorCondition",
        period: RealScalar,
        memory: PyTree,
    ) -> tuple[AnyResidual, PyTree]:
        """The residual of the period (s) that ends with a reading, and the next memory."""

    @abc.abstractmethod
    def tracked(
        self,
        residual: AnyResidual,
        condition: "ActuatorCondition",
        period: RealScalar,
        quiet: Bool[Array, ""],
    ) -> "ActuatorCondition":
        """The condition with the flows that actuators make all the time, and the torque, corrected.

        The latter only while it is `quiet`: nothing is suspected.
        """

    @abc.abstractmethod
    def test_command(
        self, period: RealScalar, sigma: RealScalar | Float[Array, " m"]
    ) -> Float[Array, " m"]:
        """Commands of test pulses that stand out of errors of this standard deviation."""

    def torque_of(self, acceleration: Float[Array, "3"]) -> Float[Array, "3"]:
        """The torque (N m) that makes an acceleration (rad/s²); none of what is on board."""
        return jnp.zeros_like(acceleration)

    def named(
        self, kind: Int[Array, ""], actuator: Int[Array, ""], memory: PyTree
    ) -> Int[Array, ""]:
        """The kind of a verdict; here as it was found."""
        del actuator, memory
        return kind
