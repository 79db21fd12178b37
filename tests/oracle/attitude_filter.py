"""A multiplicative Kalman filter in NumPy and SciPy, in inertial axes and with whole matrices.

Nine states: attitude error, bias error, and the noise of the rate last measured, which is not
estimated (Schmidt's consider filter); Joseph form, one inverse for each measured attitude. A late
attitude is put where it belongs and everything since is computed again. Rotations are SciPy's,
from body to inertial axes.
"""

import numpy as np
from scipy.linalg import block_diag, expm
from scipy.spatial.transform import Rotation


def cross_matrix(v):
    return np.cross(np.eye(3), v)


def differs(one, other):
    """Whether any of two tuples' objects is not the same one."""
    return any(x is not y for x, y in zip(one, other, strict=True))


class Oracle:
    """`gyro` is (σv, σu), `tracker` the 3x3 covariance of the measured attitude in body axes."""

    def __init__(self, period, gyro, tracker, attitude, attitude_sigma, bias_sigma):
        self.period, (self.density, self.walk), self.tracker = period, gyro, tracker
        self.variance = self.density**2 / period + self.walk**2 * period / 12
        noise = self.variance * np.eye(3)
        covariance = block_diag(attitude_sigma**2 * np.eye(3), bias_sigma**2 * np.eye(3), noise)
        self.first = (attitude, np.zeros(3), covariance)
        self.kept = []

    def run(self, rates, attitudes):
        """Attitude, bias and 9x9 covariance at the last of `rates`.

        `attitudes` are measured ones by sample number, or lists of what was measured, in which a
        vector is (in body axes, in inertial axes, deviation).
        """

        def after(state, number):
            if number:
                state = self.moved(state, rates[number - 1], rates[number])
            return self.corrected(state, attitudes.get(number))

        return self.through(len(rates), lambda number: (attitudes.get(number),), after)

    def through(self, count, measured, after):
        """The state at the last of `count` samples: from the first one on at which something else
        was `measured` than at the last call."""
        kept = self.kept
        new = (number for number, one in enumerate(kept) if differs(one[0], measured(number)))
        del kept[min(next(new, count), count) :]
        self.recall(kept[-1][2] if kept else None)
        for number in range(len(kept), count):
            state = after(kept[-1][1] if kept else self.first, number)
            kept.append((measured(number), state, self.noted()))
        return kept[-1][1]

    def noted(self):
        """What else is known after a sample."""

    def recall(self, noted):
        """Begin again where this was `noted`, or at the start."""

    def moved(self, state, before, after):
        attitude, bias, covariance = state
        half = self.period / 2
        angle = half * (before + after - 2 * bias)
        angle = angle + self.period**2 / 12 * np.cross(before - bias, after - bias)
        turn = expm(-cross_matrix(angle))
        identity, zero = np.eye(3), np.zeros((3, 3))
        transition = np.block(
            [
                [turn, -half * (turn + identity), -half * turn],
                [zero, identity, zero],
                [zero, zero, zero],
            ]
        )
        disturbed = np.block(
            [[-half * identity, -half * identity], [identity, zero], [zero, identity]]
        )
        size = np.repeat([self.walk**2 * self.period, self.variance], 3)
        covariance = transition @ covariance @ transition.T
        covariance = covariance + disturbed @ np.diag(size) @ disturbed.T
        return self.turned(attitude, angle), bias, covariance

    @staticmethod
    def turned(attitude, angle):
        return attitude * Rotation.from_rotvec(angle)

    @staticmethod
    def corrected_by(attitude, error):
        return attitude * Rotation.from_quat([*error / 2, 1])

    def corrected(self, state, measured):
        if measured is None:
            return state
        for one in measured if isinstance(measured, list) else [measured]:
            vector = isinstance(one, tuple)
            state = self.after_vector(state, *one) if vector else self.after_attitude(state, one)
        return state

    def after_attitude(self, state, measured):
        between = (state[0].inv() * measured).as_mrp()  # tan(θ/4) along the axis
        error = 4 * between / (1 - between @ between)
        return self.updated(state, error, np.eye(3), self.tracker)

    def after_vector(self, state, measured, reference, deviation):
        """Of a vector only the least rotation counts that brings it to where it was measured."""
        expected = state[0].inv().apply(reference)
        axis = np.cross(measured, expected)
        sine = np.linalg.norm(axis)
        angle = np.arctan2(sine, measured @ expected)
        error = 2 * np.tan(angle / 2) * axis / sine
        return self.updated(state, error, cross_matrix(expected), deviation**2 * np.eye(3))

    def updated(self, state, error, rows, noise):
        """The state after a rotation vector of which `rows` were measured with this covariance."""
        attitude, bias, covariance = state
        observed = np.zeros((3, 9))
        observed[:, :3] = rows
        innovation = observed @ covariance @ observed.T + noise
        gain = covariance @ observed.T @ np.linalg.inv(innovation)
        gain[6:] = 0
        error = gain @ rows @ error
        left = np.eye(9) - gain @ observed
        covariance = left @ covariance @ left.T + gain @ noise @ gain.T
        return self.corrected_by(attitude, error[:3]), bias + error[3:6], covariance
