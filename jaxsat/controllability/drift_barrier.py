"""What the drift makes of torques of one sign: half spaces of momentum that are never left.

The free body keeps |H|² and H·J⁻¹H, H = Jω in body axes, so with J1 > J2 > J3 it keeps
Φ = (1 − J2/J1) H1² − (J2/J3 − 1) H3² = (m₊·H)(m₋·H) for |H|² ≠ 0 and cannot cross either separatrix
plane m±·H = 0. If every torque has m·τ ≥ 0 for one of them, the half space m·H ≥ 0 is never left:
the rank may be 6 and the drift may return, and still rest is not reached from the other side.

That is the only obstacle. Let A be the momenta reached from rest. By recurrence it is closed under
the drift both ways, it is a cone (the drift is homogeneous), and it takes torques up; so its
directions hold the polhode of every torque and the arc from each of them to every torque. With
torques on both strict sides of both planes such arcs meet a separatrix, hence ±e2; the arcs from
there sweep the four sectors between the planes one after the other, so A is everything. Reversing
time and H gives the same system, so rest is reached from everywhere. Attitudes follow with rank 6:
those reached over one momentum are a subsemigroup of SO(3) with interior, which in a compact group
is all of it. Where two moments agree both planes are H·e = 0, e the axis of symmetry; a sphere
keeps H itself, and then every half space is a barrier.
"""

import numpy as np
from jaxtyping import Float

from jaxsat.controllability.cone import TorqueCone

SPHERE = 1e-9
"""Moments that differ relatively by less are those of a sphere."""


def separatrix_normals(
    inertia: Float[np.ndarray, "3 3"],
) -> tuple[tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]], Float[np.ndarray, "3"]] | None:
    """Unit normals m± of the separatrix planes in momentum (torque) space, and the middle axis.

    None for a sphere, which has no such planes.
    """
    (j3, j2, j1), axes = np.linalg.eigh(inertia)
    if j1 - j3 <= SPHERE * j1:
        return None
    e3, e2, e1 = axes.T
    first = np.sqrt(max(j1 - j2, 0.0) / j1) * e1
    third = np.sqrt(max(j2 - j3, 0.0) / j3) * e3
    length = float(np.linalg.norm(first + third))
    return ((first + third) / length, (first - third) / length), e2


def momentum_barrier(
    inertia: Float[np.ndarray, "3 3"], cone: TorqueCone, tolerance: float
) -> Float[np.ndarray, "3"] | None:
    """A unit vector m, if there is one, such that the momentum m·Jω never falls: m·τ ≥ 0, m·f ≥ 0.

    More exactly the half space m·Jω ≥ 0 is never left. Components of unit torques below `tolerance`
    count as zero. None says that one-signed torques and the drift reach both sides of every
    separatrix plane; with rank 6 the spacecraft is then controllable without disturbance.
    """
    planes = separatrix_normals(inertia)
    if planes is None:
        if cone.two_sided == 3:
            return None
        return cone.neither[:, 0] if cone.opposed is None else -cone.opposed
    for normal in planes[0]:
        heights = normal @ cone.rays
        if not np.any(heights < -tolerance):
            return normal
        if not np.any(heights > tolerance):
            return -normal
    return None
