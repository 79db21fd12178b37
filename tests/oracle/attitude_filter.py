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


class Oracle:
    """`gyro` is (σv, σu), `tracker` the 3x3 covariance of the measured attitude in body axes."""

    def __init__(self, period, gyro, tracker, attitude, attitude_sigma, bias_sigma):
        self.period, (self.density, self.walk), self.tracker = period, gyro, tracker
        self.variance = self.density**2 / period + self.walk**2 * period / 12
        noise = self.variance * np.eye(3)
        covariance = block_diag(attitude_sigma**2 * np.eye(3), bias_sigma**2 * np.eye(3), noise)
        self.first = (attitude, np.zeros(3), covariance)

    def run(self, rates, attitudes):
        """Attitude, bias and 9x9 covariance at the last of `rates`.

        `attitudes` are measured ones by sample number.
        """
        state = self.corrected(self.first, attitudes.get(0))
        for number in range(1, len(rates)):
            state = self.moved(state, rates[number - 1], rates[number])
            state = self.corrected(state, attitudes.get(number))
        return state

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
        return attitude * Rotation.from_rotvec(angle), bias, covariance

    def corrected(self, state, measured):
        if measured is None:
            return state
        attitude, bias, covariance = state
        observed = np.eye(3, 9)
        innovation = observed @ covariance @ observed.T + self.tracker
        gain = covariance @ observed.T @ np.linalg.inv(innovation)
        gain[6:] = 0
        between = (attitude.inv() * measured).as_mrp()  # tan(θ/4) along the axis
        error = gain @ (4 * between / (1 - between @ between))
        left = np.eye(9) - gain @ observed
        covariance = left @ covariance @ left.T + gain @ self.tracker @ gain.T
        step = Rotation.from_quat([*error[:3] / 2, 1])
        return attitude * step, bias + error[3:6], covariance
