"""Rank of the Lie algebra at one state, moving or disturbed.

Every bracket of the drift (exact orbit term) and the control fields is body-fixed and polynomial in
the rates, so it is a small array of coefficients and ad_f is one matrix: depth 7 takes
milliseconds where nested `jax.jvp` words take minutes. `lie.py` confirms it in the tests.
"""

import itertools

import numpy as np
from jaxtyping import Float

from jaxsat.core.once import latest

DEPTH = 7
_LEVEL = 1e-8  # singular values below this, of normalised columns, count as zero


@latest(4)
def _monomials(degree: int):
    """Exponents up to a degree, derivative matrices, multiplication by small monomials."""
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
    """Taylor coefficients about `omega` of the drift: rate ω and J⁻¹(−ω × Jω + T_d)."""
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
    """Matrix of Y ↦ [f, Y] = DY·f − Df·Y + (f_a × Y_a) on stacked coefficients."""
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
    """Orthonormal basis of the numerical span of the columns, normalised unless mere rounding."""
    lengths = np.linalg.norm(columns, axis=0)
    long = lengths > _LEVEL * np.max(lengths, initial=0.0)
    kept = columns[:, long] / lengths[long]
    if not kept.shape[1]:
        return kept
    basis, values, _ = np.linalg.svd(kept, full_matrices=False)
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
    """Rank, at body rate `omega` (rad/s) under a torque (N m), of brackets of at most `depth`.

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
