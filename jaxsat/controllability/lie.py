"""Vector fields on SO(3) × R³ and their Lie brackets by automatic differentiation.

A state is flat: the nine entries of the attitude matrix R (rows first, orbit frame to body frame),
the three body rates and, if wanted, the time. The fields extend to all 3 × 3 matrices, are
tangent to SO(3), and so are their brackets; `to_tangent` reads them in six coordinates: the
rotation rate a of Ṙ = −skew(a) R (eq. (10)) and ω̇. Fields are equinox modules, so brackets nest to
any depth, jit without retracing when numbers change, and vmap.

The bracket has the sign of the paper, [f, g] = Dg·f − Df·g.
"""

from collections.abc import Callable, Sequence
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.core.attitude import skew

State = Float[Array, " n"]
VectorField = Callable[[State], State]


def pack(
    attitude: Float[Array, "3 3"], omega: Float[Array, "3"], time: float | int | Array | None = None
) -> State:
    """Flat state of 12 entries, or 13 with the time (s) as a state; rates in rad/s."""
    parts = [attitude.reshape(9), omega]
    if time is not None:
        parts.append(jnp.reshape(jnp.asarray(time, omega.dtype), (1,)))
    return jnp.concatenate(parts)


def to_tangent(state: State, velocity: State) -> Float[Array, " d"]:
    """Tangent coordinates (a, ω̇[, ṫ]) of a velocity at a state, with Ṙ = −skew(a) R."""
    attitude, rate = state[:9].reshape(3, 3), velocity[:9].reshape(3, 3)
    turn = -rate @ attitude.T
    a = 0.5 * jnp.stack([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return jnp.concatenate([a, velocity[9:]])


class DriftField(eqx.Module):
    """The drift of (14)-(15): attitude rate ω_r and J⁻¹(−ω × Jω + T_d).

    `disturbance` is a torque in N m or a function of the time in s; a function needs the state with
    time, whose own rate is then 1. `orbit` chooses (11) exactly, ω_r = ω − R ω_e with
    ω_e = (0, −ω0, 0), or with R ≈ I as the paper has it.
    """

    inertia: Float[Array, "3 3"]
    inverse: Float[Array, "3 3"]
    disturbance: Float[Array, "3"] | Callable
    orbit_rate: Float[Array, ""]
    orbit: Literal["exact", "small angle"] = eqx.field(static=True)

    def __init__(
        self,
        inertia: Float[Array, "3 3"],
        *,
        disturbance: Float[Array, "3"] | Callable | None = None,
        orbit_rate: float | int | Array = 0.0,
        orbit: Literal["exact", "small angle"] = "exact",
    ):
        self.inertia = inertia
        self.inverse = jnp.linalg.inv(inertia)
        self.disturbance = jnp.zeros(3) if disturbance is None else disturbance
        self.orbit_rate = jnp.asarray(orbit_rate, inertia.dtype)
        self.orbit = orbit

    def __call__(self, state: State) -> State:
        """Velocity of the flat state."""
        attitude, omega, time = state[:9].reshape(3, 3), state[9:12], state[12:]
        if callable(self.disturbance):
            if time.shape != (1,):
                raise ValueError(
                    "Argument `state` must carry the time as its thirteenth entry when the "
                    f"disturbance is a function of time, but got {state.shape[0]} entries"
                )
            torque = self.disturbance(time[0])
        else:
            torque = self.disturbance
        orbital = jnp.zeros(3, omega.dtype).at[1].set(-self.orbit_rate)
        seen = attitude @ orbital if self.orbit == "exact" else orbital
        relative = omega - seen
        momentum = self.inertia @ omega
        omega_dot = self.inverse @ (torque - jnp.cross(omega, momentum))
        attitude_dot = -skew(relative) @ attitude
        return jnp.concatenate([attitude_dot.reshape(9), omega_dot, jnp.ones_like(time)])


class ControlField(eqx.Module):
    """The control field [0; J⁻¹g] of a torque axis g (the J⁻¹ that (14)-(15) leave out)."""

    acceleration: Float[Array, "3"]

    def __call__(self, state: State) -> State:
        """Velocity of the flat state (constant)."""
        head, tail = jnp.zeros(9, state.dtype), jnp.zeros_like(state[12:])
        return jnp.concatenate([head, self.acceleration, tail])


class LieBracket(eqx.Module):
    """[first, second] = D second · first − D first · second, itself a vector field."""

    first: VectorField
    second: VectorField

    def __call__(self, state: State) -> State:
        """Value of the bracket at a flat state."""
        _, along_first = jax.jvp(self.second, (state,), (self.first(state),))
        _, along_second = jax.jvp(self.first, (state,), (self.second(state),))
        return along_first - along_second


def lie_bracket(first: VectorField, second: VectorField) -> LieBracket:
    """The bracket [first, second] = D second · first − D first · second as a vector field."""
    return LieBracket(first, second)


def control_fields(
    inertia: Float[Array, "3 3"], torque_axes: Float[Array, "3 m"]
) -> tuple[ControlField, ...]:
    """One control field a torque axis."""
    accelerations = jnp.linalg.solve(inertia, torque_axes)
    return tuple(ControlField(accelerations[:, i]) for i in range(torque_axes.shape[1]))


def bracket_words(
    drift: VectorField, controls: Sequence[VectorField], depth: int
) -> dict[str, VectorField]:
    """Right-nested brackets [x, [y, …, g]] with at most `depth` letters, by name.

    They span the part of the Lie algebra of that depth; the drift itself is left out, and so are
    brackets of two control fields alone, which vanish.
    """
    letters = {"f": drift, **{f"g{i + 1}": field for i, field in enumerate(controls)}}
    layer: dict[str, VectorField] = {name: letters[name] for name in letters if name != "f"}
    words = dict(layer)
    for level in range(2, depth + 1):
        outer = letters if level > 2 else {"f": drift}
        layer = {
            f"[{name},{word}]": lie_bracket(letter, field)
            for name, letter in outer.items()
            for word, field in layer.items()
        }
        words.update(layer)
    return words


def tangent_matrix(fields: Sequence[VectorField], state: State) -> Float[Array, "d k"]:
    """Values of vector fields at a state, one column each, in tangent coordinates."""
    return jnp.stack([to_tangent(state, field(state)) for field in fields], axis=1)
