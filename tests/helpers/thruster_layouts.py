"""Thruster layouts of the tests."""

import numpy as np

from jaxsat.spacecraft.least_propellant import LeastPropellant
from jaxsat.spacecraft.thrusters import ThrusterSet


def canted(force=0.05, half=(0.1, 0.1, 0.15), cant=0.4):
    """Torques (3, 8) and forces of eight canted thrusters at the corners of a box."""
    positions, forces = [], []
    for x in (-1, 1):
        for y in (-1, 1):
            for z in (-1, 1):
                positions.append(np.array([x, y, z]) * half)
                turn = x * y * z
                side, up = np.sin(cant) * turn, np.cos(cant)
                direction = np.array([side * y, -side * x + 0.3 * turn * z, -z * up])
                forces.append(force * direction / np.linalg.norm(direction))
    positions, forces = np.array(positions), np.array(forces)
    return np.cross(positions, forces).T, forces.T


def pairs(torque=(1.0, 1.5, 2.0)):
    """Six thrusters, one either way about each axis."""
    columns = np.diag(torque)
    return np.stack([columns, -columns], axis=2).reshape(3, 6)


def thruster_set(torque, min_on=0.0, **times):
    """Thrusters of these torques; times are the same for all."""
    count = torque.shape[1]
    given = {name: np.full(count, value) for name, value in times.items()}
    flow = 0.001 * np.linalg.norm(torque, axis=0)
    return ThrusterSet(torque, np.zeros((3, count)), flow, np.full(count, min_on), **given)


def allocated(torque, torques=3):
    """The allocation by least ∫ |torque| dt."""
    cost = np.linalg.norm(torque, axis=0)
    return LeastPropellant.of(torque, cost, np.eye(3)[:, :torques], tabled=True)
