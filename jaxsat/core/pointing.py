"""The attitude in the angles that people read, in degrees."""

import numpy as np

SEQUENCE = "3-2-1: yaw about z, then pitch about y, then roll about x"


def pointing_error(quaternion: np.ndarray) -> np.ndarray:
    """The rotation vectors (..., 3) from the orbit to the body frame, degrees, 180 long at most.

    `quaternion` (..., 4) has unit length, the scalar first. The length is the total pointing error;
    the components, in body axes, are the errors about them.
    """
    scalar, vector = quaternion[..., :1], quaternion[..., 1:]
    size = np.linalg.norm(vector, axis=-1, keepdims=True)
    angle = 2 * np.arctan2(size, np.abs(scalar))
    small = size < 1e-8  # angle / size is 2 there, to rounding
    factor = np.where(small, 2.0, angle / np.where(small, 1.0, size))
    return np.degrees(factor * np.where(scalar < 0, -1.0, 1.0) * vector)


def euler_angles(quaternion: np.ndarray) -> np.ndarray:
    """Roll, pitch and yaw (..., 3), degrees, of the `SEQUENCE` from the orbit to the body frame.

    Roll and yaw lie between -180 and 180, pitch between -90 and 90; at its ends only the sum or the
    difference of the others means something.
    """
    q0, q1, q2, q3 = np.moveaxis(quaternion, -1, 0)
    roll = np.arctan2(2 * (q0 * q1 + q2 * q3), q0**2 - q1**2 - q2**2 + q3**2)
    pitch = np.arcsin(np.clip(2 * (q0 * q2 - q1 * q3), -1.0, 1.0))
    yaw = np.arctan2(2 * (q0 * q3 + q1 * q2), q0**2 + q1**2 - q2**2 - q3**2)
    return np.degrees(np.stack([roll, pitch, yaw], axis=-1))
