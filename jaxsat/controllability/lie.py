"""Vector fields on SO(3) × R³, their Lie brackets by automatic differentiation, and the rank of the
Lie algebra at one state, moving or disturbed.

A state is flat: the nine entries of the attitude matrix R (rows first, orbit frame to body frame),
the three body rates and, if wanted, the time. The fields extend to all 3 × 3 matrices, are
tangent to SO(3), and so are their brackets; `to_tangent` reads them in six coordinates: the
rotation rate a of Ṙ = −skew(a) R (eq. (10)) and ω̇. Fields are equinox modules, so brackets nest to
any depth, jit without retracing when numbers change, and vmap.

The bracket has the sign of the paper, [f, g] = Dg·f − Df·g.

For the rank every bracket of the drift (exact orbit term) and the control fields is body-fixed and
polynomial in the rates, so it is a small array of coefficients and ad_f is one matrix: depth 7
takes milliseconds where nested `jax.jvp` words take minutes, which confirm it in the tests.
"""

import itertools
from collections.abc import Callable, Sequence
from typing import Literal

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.core.array_types import Matrix, RealScalar, Vector
from jaxsat.core.attitude import skew
from jaxsat.core.once import latest

State = Float[Array, " n"]
VectorField = Callable[[State], State]


def pack(attitude: Matrix, omega: Vector, time: float | int | Array | None = None) -> State:
    """Return a flat state of 12 entries, or 13 with the time (s) as a state; rates in rad/s."""
    parts = [attitude.reshape(9), omega]
    if time is not None:
        parts.append(jnp.reshape(jnp.asarray(time, omega.dtype), (1,)))
    return jnp.concatenate(parts)


def to_tangent(state: State, velocity: State) -> Float[Array, " d"]:
    """Return tangent coordinates (a, ω̇[, ṫ]) of a velocity at a state, with Ṙ = −skew(a) R."""
    attitude, rate = state[:9].reshape(3, 3), velocity[:9].reshape(3, 3)
    turn = -rate @ attitude.T
    a = 0.5 * jnp.stack([turn[2, 1] - turn[1, 2], turn[0, 2] - turn[2, 0], turn[1, 0] - turn[0, 1]])
    return jnp.concatenate([a, velocity[9:]])


class DriftField(eqx.Module):
    """The drift of (14)-(15): attitude rate ω_r and J⁻¹(−ω × Jω + T_d).

    `disturbance` is a torque in N m or a function of the time in s; a function needs the state with
    time, whose own rate is then 1. `orbit` selects (11) exactly, ω_r = ω − R ω_e with
    ω_e = (0, −ω0, 0), or with R ≈ I as in the paper.
    """

    inertia: Matrix
    inverse: Matrix
    disturbance: Vector | Callable
    orbit_rate: RealScalar
    orbit: Literal["exact", "small angle"] = eqx.field(static=True)

    def __init__(
        self,
        inertia: Matrix,
        *,
        disturbance: Vector | Callable | None = None,
        orbit_rate: float | int | Array = 0.0,
        orbit: Literal["exact", "small angle"] = "exact",
    ):
        self.inertia = inertia
        self.inverse = jnp.linalg.inv(inertia)
        self.disturbance = jnp.zeros(3) if disturbance is None else disturbance
        self.orbit_rate = jnp.asarray(orbit_rate, inertia.dtype)
        self.orbit = orbit

    def __call__(self, state: State) -> State:
        """Return the velocity of the flat state."""
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
        frame_rate = attitude @ orbital if self.orbit == "exact" else orbital
        relative = omega - frame_rate
        momentum = self.inertia @ omega
        omega_dot = self.inverse @ (torque - jnp.cross(omega, momentum))
        attitude_dot = -skew(relative) @ attitude
        return jnp.concatenate([attitude_dot.reshape(9), omega_dot, jnp.ones_like(time)])


class ControlField(eqx.Module):
    """The control field [0; J⁻¹g] of a torque axis g (the J⁻¹ that (14)-(15) leave out)."""

    acceleration: Vector

    def __call__(self, state: State) -> State:
        """Return the velocity of the flat state (constant)."""
        head, tail = jnp.zeros(9, state.dtype), jnp.zeros_like(state[12:])
        return jnp.concatenate([head, self.acceleration, tail])


class LieBracket(eqx.Module):
    """[first, second] = D second · first − D first · second, itself a vector field."""

    first: VectorField
    second: VectorField

    def __call__(self, state: State) -> State:
        """Return the bracket at a flat state."""
        _, along_first = jax.jvp(self.second, (state,), (self.first(state),))
        _, along_second = jax.jvp(self.first, (state,), (self.second(state),))
        return along_first - along_second


def lie_bracket(first: VectorField, second: VectorField) -> LieBracket:
    """Return the field [first, second] = D second · first − D first · second."""
    return LieBracket(first, second)


def control_fields(inertia: Matrix, torque_axes: Float[Array, "3 m"]) -> tuple[ControlField, ...]:
    """Return one control field per torque axis."""
    accelerations = jnp.linalg.solve(inertia, torque_axes)
    return tuple(ControlField(accelerations[:, i]) for i in range(torque_axes.shape[1]))


def bracket_words(
    drift: VectorField, controls: Sequence[VectorField], depth: int
) -> dict[str, VectorField]:
    """Return right-nested brackets [x, [y, …, g]] with at most `depth` letters, by name.

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
    """Return vector fields at a state, one column each, in tangent coordinates."""
    return jnp.stack([to_tangent(state, field(state)) for field in fields], axis=1)


DEPTH = 7
_LEVEL = 1e-8  # threshold on singular values of normalised columns


@latest(4)
def _monomials(degree: int):
    """Return exponents up to a degree, derivative matrices, multiplication by small monomials."""
    powers = [p for p in itertools.product(range(degree + 1), repeat=3) if sum(p) <= degree]
    powers.sort(key=lambda p: (sum(p), p))
    index = {p: k for k, p in enumerate(powers)}
    size = len(powers)
    derivative = np.zeros((3, size, size))
    for k, p in enumerate(powers):
        for axis in range(3):
            if p[axis]:
                lower = tuple(p[i] - (i == axis) for i in range(3))
                derivative[axis, index[lower], k] = p[axis]
    small = [p for p in powers if sum(p) <= 2]
    times = np.zeros((len(small), size, size))
    for s, q in enumerate(small):
        for k, p in enumerate(powers):
            product = (p[0] + q[0], p[1] + q[1], p[2] + q[2])
            if sum(product) <= degree:
                times[s, index[product], k] = 1.0
    return index, derivative, times


def _drift(
    inertia: Float[np.ndarray, "3 3"],
    omega: Float[np.ndarray, "3"],
    disturbance: Float[np.ndarray, "3"],
    degree: int,
) -> Float[np.ndarray, "6 k"]:
    """Return Taylor coefficients about `omega` of the drift: rate ω and J⁻¹(−ω × Jω + T_d)."""
    index, _, times = _monomials(degree)
    inverse = np.linalg.inv(inertia)

    def product(x, y):
        return inverse @ (-np.cross(x, inertia @ y) - np.cross(y, inertia @ x))

    coefficients = np.zeros((6, times.shape[1]))
    coefficients[:3, 0] = omega
    coefficients[3:, 0] = 0.5 * product(omega, omega) + inverse @ disturbance
    unit = np.eye(3)
    for i in range(3):
        linear = index[tuple(int(e) for e in unit[i])]
        coefficients[i, linear] = 1.0
        coefficients[3:, linear] = product(omega, unit[i])
        for j in range(i, 3):
            power = index[tuple(int(e) for e in unit[i] + unit[j])]
            coefficients[3:, power] += product(unit[i], unit[j]) * (0.5 if i == j else 1.0)
    return coefficients


def _ad_drift(drift: Float[np.ndarray, "6 k"], degree: int) -> Float[np.ndarray, "n n"]:
    """Return the matrix of Y ↦ [f, Y] = DY·f − Df·Y + (f_a × Y_a) on stacked coefficients."""
    _, derivative, times = _monomials(degree)
    size = times.shape[1]
    small = times.shape[0]

    def multiply(polynomial):
        return np.tensordot(polynomial[:small], times, axes=1)

    along = sum(multiply(drift[3 + i]) @ derivative[i] for i in range(3))
    matrix = np.zeros((6, size, 6, size))
    for row in range(6):
        matrix[row, :, row, :] += along
        for i in range(3):
            matrix[row, :, 3 + i, :] -= multiply(derivative[i] @ drift[row])
    for i, j, k in ((0, 1, 2), (1, 2, 0), (2, 0, 1)):
        matrix[i, :, k, :] += multiply(drift[j])
        matrix[i, :, j, :] -= multiply(drift[k])
    return matrix.reshape(6 * size, 6 * size)


def _span(columns: Float[np.ndarray, "n k"]) -> Float[np.ndarray, "n r"]:
    """Return an orthonormal basis of the numerical span of columns, normalised above round-off."""
    lengths = np.linalg.norm(columns, axis=0)
    long = lengths > _LEVEL * np.max(lengths, initial=0.0)
    unit_columns = columns[:, long] / lengths[long]
    if not unit_columns.shape[1]:
        return unit_columns
    basis, values, _ = np.linalg.svd(unit_columns, full_matrices=False)
    return basis[:, values > _LEVEL * values[0]]


def rank_at_state(
    inertia: Float[np.ndarray, "3 3"],
    accelerations: Float[np.ndarray, "3 m"],
    *,
    omega: Float[np.ndarray, "3"] | None = None,
    disturbance: Float[np.ndarray, "3"] | None = None,
    count_drift: bool = False,
    depth: int = DEPTH,
) -> int:
    """Compute the rank at rate `omega` (rad/s) under a torque (N m), of brackets up to `depth`.

    `accelerations` are the columns J⁻¹g (rad/s²). The orbit rate does not enter: with the exact
    orbit term it commutes with all body-fixed fields. The drift itself counts only with
    `count_drift`. A numerical lower bound: deeper brackets could add directions.
    """
    inertia = inertia / (np.trace(inertia) / 3.0)
    rest = np.zeros(3)
    omega = rest if omega is None else omega
    disturbance = rest if disturbance is None else disturbance
    # Another unit of time multiplies omega by s and the torque by s²: bring both near 1.
    speed = max(float(np.linalg.norm(omega)), float(np.sqrt(np.linalg.norm(disturbance))))
    if speed > 0:
        omega, disturbance = omega / speed, disturbance / speed**2
    degree = max(depth - 1, 2)
    _, derivative, times = _monomials(degree)
    size = times.shape[1]
    drift = _drift(inertia, omega, disturbance, degree)
    operators = [_ad_drift(drift, degree)]
    constants = np.zeros((6, size, accelerations.shape[1]))
    constants[3:, 0, :] = accelerations
    for column in _span(accelerations).T:
        along = np.tensordot(column, derivative, axes=1)
        operators.append(np.kron(np.eye(6), along))
    layer = _span(constants.reshape(6 * size, -1))
    values = [drift[:, :1]] if count_drift else []
    for _ in range(depth):
        values.append(layer.reshape(6, size, -1)[:, 0, :])
        if layer.shape[1] == 0:
            break
        layer = _span(np.concatenate([operator @ layer for operator in operators], axis=1))
    return _span(np.concatenate(values, axis=1)).shape[1]
