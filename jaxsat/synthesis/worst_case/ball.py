"""The likely cases in a space of independent standard normal numbers: a ball about its origin."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float
from scipy.special import chdtri


class Ball(NamedTuple):
    """The ball of this `dimension` and `radius`, in standard deviations."""

    dimension: int
    radius: float

    @staticmethod
    def with_probability(dimension: int, probability: float) -> "Ball":
        """Return the ball that holds this part of all cases."""
        return Ball(dimension, float(np.sqrt(chdtri(dimension, 1 - probability))))

    def draws(self, generator: np.random.Generator, count: int) -> Float[np.ndarray, "count d"]:
        """Draw normal numbers in the ball, each again until it is inside."""
        x = generator.standard_normal((count, self.dimension))
        while (outside := np.linalg.norm(x, axis=1) > self.radius).any():
            x[outside] = generator.standard_normal((int(outside.sum()), self.dimension))
        return x

    def reflected(self, y: Float[np.ndarray, "n d"]) -> Float[np.ndarray, "n d"]:
        """Return points as they are inside the ball, and reflected at its surface outside.

        The image of the whole space is the ball, and its surface no end of it: a strategy without
        bounds can surround a minimum there.
        """
        length = np.linalg.norm(y, axis=1, keepdims=True)
        folded = self.radius - np.abs(np.mod(length, 2 * self.radius) - self.radius)
        return y * (folded / np.where(length > 0, length, 1.0))

    def least_along(
        self, gradient: Float[np.ndarray, " d"], held: Float[np.ndarray, " d"]
    ) -> Float[np.ndarray, " d"]:
        """Return the point where a function of this gradient, if it were linear, is least.

        `held` has the coordinates that stay, which have no gradient, and zeros for others.
        """
        left = np.sqrt(max(self.radius**2 - held @ held, 0.0))
        return held - left * gradient / np.linalg.norm(gradient)
