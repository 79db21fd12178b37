"""A Kalman filter without a gyro in NumPy and SciPy, in inertial axes and with whole matrices.

Twelve states: errors of attitude, rate and unknown torque, and the error of the momentum that
tachometers measure, which is not estimated (Schmidt's consider filter). The error of the rate at
the end of a step and that of the turn depend on each other: both are solved for at once. Joseph
form, one inverse for each measurement; a late attitude is put where it belongs and everything since
is computed again. Rotations are SciPy's, from body to inertial axes.
"""

import numpy as np
from scipy.linalg import block_diag, expm

from oracle.attitude_filter import Oracle, cross_matrix


class DynamicsOracle(Oracle):
    """`torques` are density, first deviation and random walk of unknown torques, `momentum` is the
    covariance of measured momenta."""

    def __init__(self, period, inertia, torques, momentum, tracker, attitude, rate, sigmas):
        self.period, self.inertia, self.tracker = period, inertia, tracker
        self.density, self.walk, self.momentum = torques[0], torques[2], momentum
        variances = np.repeat([sigmas[0] ** 2, sigmas[1] ** 2, torques[1] ** 2], 3)
        covariance = block_diag(np.diag(variances), momentum)
        self.first = (attitude, np.concatenate([rate, np.zeros(3)]), covariance)

    def run(self, momenta, torques, attitudes):
        """Attitude, rate with unknown torque, and covariance at the last of `momenta`; each of
        `torques` acted up to its sample, `attitudes` are as in `Oracle.run`."""
        state = self.corrected(self.first, attitudes.get(0))
        for number in range(1, len(momenta)):
            state = self.moved(state, momenta[number - 1], momenta[number], torques[number])
            state = self.corrected(state, attitudes.get(number))
        return state

    def moved(self, state, before, after, torque):
        attitude, (rate, unknown), covariance = state[0], np.split(state[1], 2), state[2]
        length, inertia, half = self.period, self.inertia, self.period / 2
        torque, spin_up = torque + unknown, (after - before) / length

        def acceleration(rate, total):
            return np.linalg.solve(inertia, torque - np.cross(rate, total) - spin_up)

        total = inertia @ rate + before
        first = acceleration(rate, total)
        slope = torque - np.cross(rate, total)
        curve = -np.cross(first, total) - np.cross(rate, slope)
        reached = total + length * slope + length**2 / 2 * curve
        last_rate = np.linalg.solve(inertia, reached - after)
        ends = first - acceleration(last_rate, reached) + np.cross(rate, last_rate)
        angle = half * (rate + last_rate) + length**2 / 12 * ends
        turn, one, zero = expm(-cross_matrix(angle)), np.eye(3), np.zeros((3, 3))
        turned = turn @ (total + half * torque)
        following = np.linalg.solve(inertia, turned + half * torque - after)
        # e - h ε' = h A ε and J ε' + e × turned = A (J ε - v) + h (A + 1) ξ + w + v'
        left = np.block([[one, -half * one], [-cross_matrix(turned), inertia]])
        right = np.block(
            [
                [half * turn, zero, zero, zero, zero],
                [turn @ inertia, half * (turn + one), -turn, one, one],
            ]
        )
        error = np.linalg.solve(left, right)  # of ε, ξ, v, w and v'
        transition = np.zeros((12, 12))
        transition[:3, :3] = turn
        transition[:6, 3:] = error[:, :9]
        transition[6:9, 6:9] = one
        disturbed = np.zeros((12, 9))  # by w, v' and the walk
        disturbed[:6, :6] = error[:, 9:]
        disturbed[9:, 3:6] = disturbed[6:9, 6:] = one
        size = block_diag(
            self.density**2 * length * one, self.momentum, self.walk**2 * length * one
        )
        covariance = transition @ covariance @ transition.T + disturbed @ size @ disturbed.T
        return self.turned(attitude, angle), np.concatenate([following, unknown]), covariance

    def updated(self, state, error, rows, noise):
        attitude, others, covariance = state
        observed = np.zeros((3, 12))
        observed[:, :3] = rows
        innovation = observed @ covariance @ observed.T + noise
        gain = covariance @ observed.T @ np.linalg.inv(innovation)
        gain[9:] = 0
        step = gain @ rows @ error
        left = np.eye(12) - gain @ observed
        covariance = left @ covariance @ left.T + gain @ noise @ gain.T
        return self.corrected_by(attitude, step[:3]), others + step[3:9], covariance
