"""Flexible modes of panels and booms, which the body excites as it turns.

Hybrid coordinates (Likins, JPL Technical Report 32-1329, 1970), to first order in the deflection.
A mode of the frequency Ω with the body held, the damping ratio ζ and the coupling d, in √kg m of
the mode normalised to 1 kg, has the amplitude η:

    d²η/dt² + 2 ζ Ω dη/dt + Ω² η = -d·dω/dt,    h = d dη/dt

and adds the momentum h to that of the body. Substituting d²η/dt² into the body's equation reduces
its inertia by d dᵀ and adds the torque d (2 ζ Ω dη/dt + Ω² η). The state here is the angle
θ = η / |d|: that of a rigid appendage of the inertia |d|² on a spring about the axis d,
independent of the body's size. Without damping and torque

    E = ωᵀJω / 2 + h·ω + Σ |d|² ((dθ/dt)² + Ω² θ²) / 2

and the momentum J ω + Σ h in inertial axes are constant.
"""

from collections.abc import Sequence
from typing import Any, ClassVar

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Float

from jaxsat.core.array_types import Matrix, Vector
from jaxsat.core.checks import as_float, positive
from jaxsat.spacecraft.axes import of_each, unit_axes
from jaxsat.spacecraft.effector import AbstractEffector, Effect, EffectorContext, Storage


class ModeStates(eqx.Module):
    """State of flexible modes: angles η / |d| (rad), and their rates (rad/s)."""

    angle: Float[Array, " k"] = eqx.field(converter=as_float)
    rate: Float[Array, " k"] = eqx.field(converter=as_float)


class FlexibleModes(AbstractEffector):
    """k flexible modes with couplings d along `axes` (3, k), which are scaled to unit length.

    `coupling` (√kg m) is the size of d, `frequency` (rad/s) that with the body held, `damping` the
    ratio; each is one number, or one for each mode. The inertia of the spacecraft is that with all
    modes at rest. Modes take no command. Raises `ValueError` for an axis, a coupling or a frequency
    of zero.
    """

    kind: ClassVar[str] = "flexible_mode"
    even: ClassVar[bool] = True

    axes: Float[Array, "3 k"]
    coupling: Float[Array, " k"] = eqx.field(converter=positive("coupling"))
    frequency: Float[Array, " k"] = eqx.field(converter=positive("frequency"))
    damping: Float[Array, " k"]
    failures: None = None

    def __init__(
        self,
        axes: ArrayLike | list,
        coupling: ArrayLike | list,
        frequency: ArrayLike | list,
        damping: ArrayLike | list = 0.0,
    ):
        self.axes = unit_axes(as_float(axes))
        self.coupling = of_each(coupling, self.count)
        self.frequency = of_each(frequency, self.count)
        self.damping = of_each(damping, self.count)
        self.failures = None

    @classmethod
    def from_tables(
        cls, tables: Sequence[Any], context: EffectorContext
    ) -> "tuple[FlexibleModes, ModeStates]":
        """Return the modes of checked tables `[[flexible_mode]]`, and their initial states."""
        couplings = np.array([one.coupling_sqrt_kg_m for one in tables], float).T
        modes = cls(
            couplings,
            np.linalg.norm(couplings, axis=0),
            np.array([one.frequency_rad_s for one in tables]),
            np.array([one.damping for one in tables]),
        )
        return modes, ModeStates([one.angle_rad for one in tables], np.zeros(len(tables)))

    @property
    def count(self) -> int:
        """Number of modes."""
        return self.axes.shape[1]

    @property
    def command_size(self) -> int:
        """Number of components of the command: zero."""
        return 0

    def init(self) -> ModeStates:
        """Return the state with all modes at rest."""
        return ModeStates(jnp.zeros(self.count), jnp.zeros(self.count))

    def momentum(self, state: ModeStates) -> Vector:
        """Return Σ h in body axes, N m s."""
        return self.axes @ (self.coupling**2 * state.rate)

    def storage(self) -> Storage | None:
        """Return None, as flexible modes cannot store momentum: it oscillates."""
        return None

    def free_inertia(self) -> Matrix:
        """Return -Σ d dᵀ, kg m²."""
        return -(self.axes * (self.coupling**2)[None]) @ self.axes.T

    def driven(self, state, command, struck) -> "tuple[FlexibleModes, Float[Array, '0']]":
        """Return the modes and their command unchanged: flexible modes do not fail."""
        return self, command

    def piece(self, mode: tuple, command: Array) -> tuple:
        """Return an empty piece, as the torque follows from the state."""
        return ()

    def _spring(self, state: ModeStates) -> Float[Array, " k"]:
        damped = 2 * self.damping * state.rate + self.frequency * state.angle
        return self.frequency * damped

    def effect(self, piece: tuple, t, plant, state: ModeStates) -> Effect:
        """Return the torque of springs and dampers on the body (N m), and -Σ d dᵀ (kg m²)."""
        torque = self.axes @ (self.coupling**2 * self._spring(state))
        return Effect(torque, self.free_inertia())

    def torque(self, piece: tuple, effect: Effect, state: ModeStates, acceleration):
        """Return zero, as no actuator makes the torque of flexible modes."""
        return jnp.zeros(3)

    def derivative(self, piece: tuple, plant, state: ModeStates, acceleration) -> ModeStates:
        """Return dθ/dt and d²θ/dt² where the body has this dω/dt (rad/s²)."""
        excitation = acceleration @ self.axes
        return ModeStates(state.rate, -self._spring(state) - excitation)

    def stored(self, state: ModeStates) -> dict[str, Array]:
        """Return the angle of each mode (rad), by the name of its signal."""
        return {"mode_angle": state.angle}
