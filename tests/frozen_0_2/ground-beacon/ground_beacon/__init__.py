"""A sensor of the direction to a radio beacon on the ground."""

import jax
import jax.numpy as jnp

from jaxsat import AbstractSensedVector, VectorDeclaration
from jaxsat.core.declaration import number
from jaxsat.core.earth import EARTH_RADIUS
from jaxsat.spacecraft.environment.orbit import EARTH_ROTATION, AbstractPlace


class Beacon(AbstractSensedVector):
    """The direction to a beacon, while it is above the horizon; refraction lifts it."""

    declaration = VectorDeclaration(
        summary="a radio beacon on the ground",
        keys=(
            number("latitude_rad", "Geocentric latitude", at_least=-1.6, at_most=1.6),
            number("longitude_rad", "Longitude", at_least=-3.2, at_most=6.3),
            number(
                "lift",
                "What is added to the direction along z of the body",
                at_least=0,
                default=0.0,
            ),
        ),
    )

    place: AbstractPlace
    latitude: jax.Array
    longitude: jax.Array
    lift: jax.Array

    @classmethod
    def from_table(cls, values, context):
        numbers = (values[name] for name in ("latitude_rad", "longitude_rad", "lift"))
        return cls(context.place, *(jnp.asarray(one, float) for one in numbers))

    def __call__(self, t):
        east = self.longitude + self.place.sidereal_angle + EARTH_ROTATION * t
        across = jnp.cos(self.latitude)
        zenith = jnp.stack([across * jnp.cos(east), across * jnp.sin(east), jnp.sin(self.latitude)])
        zenith = self.place.axes(t) @ zenith
        line = EARTH_RADIUS * zenith - self.place.distance(t) * self.place.up(t)
        return line / jnp.sqrt(line @ line), jnp.where(zenith @ line < 0, 1.0, 0.0)

    def distorted(self, t, vector):
        lifted = vector + self.lift * jnp.array([0.0, 0.0, 1.0])
        return lifted / jnp.sqrt(lifted @ lifted)
