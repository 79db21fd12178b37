"""What of a memory's motion is known exactly, and need not be integrated."""

import abc

import equinox as eqx
from jaxtyping import Array, Float, PyTree


class AbstractIntegratingFactor(eqx.Module):
    """The integrating factor e^(At) at one instant, of a memory with d/dt memory = A memory + b.

    In the *rotating frame*, e^(-At) memory, the memory changes by b alone: its integrator takes no
    steps for the sake of A, above all of oscillations.
    """

    @abc.abstractmethod
    def into_frame(self, memory: PyTree) -> PyTree:
        """e^(-At) memory."""

    @abc.abstractmethod
    def out_of_frame(self, framed: PyTree) -> PyTree:
        """The memory that `into_frame` takes to `framed`."""

    @abc.abstractmethod
    def rate_in_frame(self, rate_error: Float[Array, "2"]) -> PyTree:
        """e^(-At) b, the time derivative of e^(-At) memory, at a rate error of the law, rad/s."""
