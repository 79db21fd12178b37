"""A Kalman filter by the dynamics in NumPy and SciPy, in inertial axes and with whole matrices.

Twelve states: errors of attitude, rate, unknown torque, and the momentum that tachometers measure.
The error of the rate at
the end of a step and that of the turn depend on each other: both are solved for at once. With a
gyro, three more for the error of its bias, the last ones. Joseph form, one inverse for each
measurement; a late attitude is put where it belongs and everything since is computed again.
Rotations are SciPy's, from body to inertial axes.
"""

import numpy as np
from scipy.linalg import block_diag, expm

from oracle.attitude_filter import Oracle, cross_matrix


class DynamicsOracle(Oracle):
    """`torques` are density, first deviation and random walk of unknown torques, `momentum` is the
    covariance of measured momenta, `gyro` its density, random walk and first deviation."""

    def __init__(
        self, period, inertia, torques, momentum, tracker, attitude, rate, sigmas, gyro=None
    ):
        self.period, self.inertia, self.tracker = period, inertia, tracker
        self.density, self.walk, self.momentum = torques[0], torques[2], momentum
        variances = np.repeat([sigmas[0] ** 2, sigmas[1] ** 2, torques[1] ** 2], 3)
        covariance = block_diag(np.diag(variances), momentum)
        others = np.concatenate([rate, np.zeros(6)])
        self.gyro_walk = 0.0
        if gyro is not None:
            density, self.gyro_walk, sigma = gyro
            self.gyro_variance = density**2 / period + self.gyro_walk**2 * period / 12
            covariance = block_diag(covariance, sigma**2 * np.eye(3))
            others = np.concatenate([others, np.zeros(3)])
        self.first = (attitude, others, covariance)
        self.kept, self.white = [], {}

    def run(self, momenta, torques, attitudes, rates=()):
        """Attitude, rate with unknown torque, error of momentum and bias, and covariance at the
        last of `momenta`; each of `torques` acted up to its sample, `attitudes` are as in
        `Oracle.run`, and `rates` those of the gyro by sample."""

        def after(state, number):
            if number:
                state = self.moved(state, momenta[number - 1], momenta[number], torques[number])
            state = self.corrected(state, attitudes.get(number))
            return self.after_rate(state, rates.get(number), number)

        def measured(number):
            return attitudes.get(number), rates.get(number)

        rates = dict(rates)
        return self.through(len(momenta), measured, after)

    def after_rate(self, state, measured, number):
        """The state after a rate; `white` has its innovation in parts of its deviations."""
        if measured is None:
            return state
        rate, _, _, bias = np.split(state[1], 4)
        observed = np.hstack([np.zeros((3, 3)), np.eye(3), np.zeros((3, 6)), np.eye(3)])
        noise = self.gyro_variance * np.eye(3)
        error, innovation = measured - rate - bias, observed @ state[2] @ observed.T + noise
        self.white[number] = np.linalg.solve(np.linalg.cholesky(innovation), error)
        return self.gained(state, error, observed, noise)

    def moved(self, state, before, after, torque):
        attitude, others, covariance = state
        rate, unknown, before = others[:3], others[3:6], before - others[6:9]
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
        noise, bias = disturbed @ size @ disturbed.T, len(covariance) - 12
        transition = block_diag(transition, np.eye(bias))
        noise = block_diag(noise, self.gyro_walk**2 * length * np.eye(bias))
        covariance = transition @ covariance @ transition.T + noise
        return (
            self.turned(attitude, angle),
            np.concatenate([following, unknown, np.zeros(3), others[9:]]),
            covariance,
        )

    def updated(self, state, error, rows, noise):
        observed = np.zeros((3, len(state[2])))
        observed[:, :3] = rows
        return self.gained(state, rows @ error, observed, noise)

    def gained(self, state, error, observed, noise):
        """The state after a measurement with this error of its prediction, and these rows."""
        attitude, others, covariance = state
        innovation = observed @ covariance @ observed.T + noise
        gain = covariance @ observed.T @ np.linalg.inv(innovation)
        step = gain @ error
        left = np.eye(len(covariance)) - gain @ observed
        covariance = left @ covariance @ left.T + gain @ noise @ gain.T
        return self.corrected_by(attitude, step[:3]), others + step[3:], covariance
