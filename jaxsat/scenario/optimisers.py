"""Optimisers of optax by name, with learning-rate schedule and clipping; or CMA-ES."""

import inspect
from dataclasses import dataclass

import jax
import jax.numpy as jnp
import optax

from jaxsat.core.errors import ArgumentError

SCHEDULES = ("constant", "cosine", "exponential")
DERIVATIVE_FREE = "cma-es"
"""Name of the derivative-free optimiser in a scenario."""

FINAL_RATE_FRACTION = 0.05
"""Learning rate at the end of a decaying schedule, relative to the start."""


@dataclass(frozen=True)
class OptimiserSettings:
    """An optimiser of optax by its name there, with a learning rate, its schedule and clipping.

    A gradient longer than `clip` is shortened to it. `DERIVATIVE_FREE` is not of optax and uses no
    learning rate or clipping. Raises `ArgumentError` for a name that is no optimiser of optax, or
    for an optimiser that needs more than gradients.
    """

    optimiser: str = "adam"
    learning_rate: float = 0.1
    schedule: str = "cosine"
    clip: float = 1.0

    def __post_init__(self):
        for name in ("learning_rate", "clip"):
            if not getattr(self, name) > 0:
                raise ArgumentError(name, "must be positive", getattr(self, name))
        if self.schedule not in SCHEDULES:
            raise ArgumentError("schedule", f"must be one of {SCHEDULES}", repr(self.schedule))
        if not self.derivative_free:
            _require_optimiser(self.optimiser)

    @property
    def derivative_free(self) -> bool:
        """Whether the optimiser uses no derivatives."""
        return self.optimiser == DERIVATIVE_FREE

    def transformation(self, steps: int) -> optax.GradientTransformation:
        """Return the transformation of gradients into steps, for a run of `steps`."""
        optimiser = getattr(optax, self.optimiser)(learning_rate=self._rate(steps))
        return optax.chain(optax.clip_by_global_norm(self.clip), optimiser)

    def _rate(self, steps: int) -> optax.Schedule:
        rate, steps = self.learning_rate, max(steps, 1)
        if self.schedule == "cosine":
            return optax.cosine_decay_schedule(rate, steps, alpha=FINAL_RATE_FRACTION)
        if self.schedule == "exponential":
            return optax.exponential_decay(rate, steps, FINAL_RATE_FRACTION)
        return optax.constant_schedule(rate)


def _require_optimiser(name: str) -> None:
    factory = getattr(optax, name, None)
    problem = ArgumentError(
        "optimiser",
        "must be an optimiser of optax that needs gradients alone, such as adam, adamw, lion, "
        "rmsprop or sgd",
        repr(name),
    )
    if (
        not inspect.isfunction(factory)
        or "learning_rate" not in inspect.signature(factory).parameters
    ):
        raise problem
    try:
        transformation, point = factory(learning_rate=0.1), jnp.ones(2)
        with jax.numpy_dtype_promotion("standard"):  # optax counts steps in integers
            transformation.update(point, transformation.init(point), point)
    except Exception as error:
        raise problem from error
