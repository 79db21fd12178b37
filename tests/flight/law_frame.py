"""The frame of laws written after docs/your-own-law.md: their model, period and numbers."""

import jax
import jax.numpy as jnp

from jaxsat import AbstractSampledController, RigidBody
from jaxsat.core.declaration import number
from jaxsat.core.declaration.keys import Numeric

PERIOD = number("period_s", "Time between samples", "s", above=0, default=0.25)


class AbstractVisitor(AbstractSampledController):
    """A law whose attributes are its model, and its numbers in the order of their keys."""

    model: RigidBody
    period: jax.Array

    @classmethod
    def from_table(cls, values, context):
        return cls(context.model, *cls.numbers(values))

    @classmethod
    def numbers(cls, values):
        """The values of keys that are numbers."""
        keys = cls.declaration.keys
        return [jnp.asarray(values[key.name]) for key in keys if isinstance(key.kind, Numeric)]


def attitude_error(state):
    """The vector part of the quaternion, the shorter way round."""
    q = state.attitude.as_quaternion().q
    return jnp.where(q[0] < 0, -1.0, 1.0) * q[1:]
