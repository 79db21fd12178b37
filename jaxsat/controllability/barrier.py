"""Half spaces of momentum that drift and torques of one sign never leave.

The free body keeps |H|² and H·J⁻¹H, H = Jω in body axes, so with J1 > J2 > J3 it keeps
Φ = (1 − J2/J1) H1² − (J2/J3 − 1) H3² = (m₊·H)(m₋·H) for |H|² ≠ 0 and cannot cross either separatrix
plane m±·H = 0. If every torque has m·τ ≥ 0 for one of them, the half space m·H ≥ 0 is never left:
the rank may be 6 and the drift may return, and still rest is not reached from the other side.

That is the only obstacle. Let A be the momenta reached from rest. By recurrence it is closed under
the drift both ways, it is a cone (the drift is homogeneous), and it is closed under torques; so its
directions hold the polhode of every torque and the arc from each of them to every torque. With
torques on both strict sides of both planes such arcs meet a separatrix, hence ±e2; the arcs from
there sweep the four sectors between the planes one after the other, so A is everything. Reversing
time and H gives the same system, so rest is reached from everywhere. Attitudes follow with rank 6:
those reached over one momentum are a subsemigroup of SO(3) with interior, which in a compact group
is all of it. Where two moments agree both planes are H·e = 0, e the axis of symmetry; a sphere
keeps H itself, and then every half space is a barrier.

Beside one wheel along a, H = Jω + a h turns about b = J⁻¹a both ways, as [w, f] of the wheel w is
that rotation, and as before with the drift. A part of the sphere |H| = const that neither leaves
is made of circles b·H = s on which b·(H × KH) vanishes, K = J⁻¹. With e and e' across b that is the
second harmonic, e·Ke - e'·Ke' and e·Ke', and s times the first, b × Kb. All vanish for s = 0 alone
where K is a multiple of one across b, so that b is normal to a separatrix plane: both do not
leave either half of the sphere, and torques on both sides of the plane must. They vanish for every
s where b is an axis of symmetry, too: then torques, turned about b, push H to all sides unless none
is on one side of the plane. In all other cases wheel and drift turn H into any direction (but where
it is along a principal axis with a wheel about it), so that one torque of one sign is enough.
"""

import numpy as np
from jaxtyping import Float

from jaxsat.controllability.cone import TorqueCone

SPHERE = 1e-9
"""Tolerance on the relative difference of the moments of a sphere."""


def separatrix_normals(
    inertia: Float[np.ndarray, "3 3"],
) -> tuple[tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3"]], Float[np.ndarray, "3"]] | None:
    """Return unit normals m± of the separatrix planes in momentum space, and the middle axis.

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
    inertia: Float[np.ndarray, "3 3"],
    cone: TorqueCone,
    tolerance: float,
    turned_about: Float[np.ndarray, "3"] | None = None,
) -> Float[np.ndarray, "3"] | None:
    """Return a unit vector m, if any, such that the momentum m·H never falls: m·τ ≥ 0, m·f ≥ 0.

    More exactly, the half space m·H ≥ 0 is invariant. Components of unit torques below `tolerance`
    are zero. None means that one-signed torques and the drift reach both sides of every separatrix
    plane; with rank 6 the spacecraft is then controllable without disturbance.

    Beside one wheel along a, `cone` is that of the thrusters and `turned_about` is J⁻¹a, about
    which the wheel turns H both ways: only a plane across it is never crossed then.
    """
    planes = separatrix_normals(inertia)
    if turned_about is not None:
        about = turned_about / np.linalg.norm(turned_about)
        across = [] if planes is None else [np.linalg.norm(np.cross(about, m)) for m in planes[0]]
        if planes is not None and min(across) > tolerance:
            return None
        normals = (about,)
    elif planes is None:
        if cone.two_sided == 3:
            return None
        return cone.neither[:, 0] if cone.opposed is None else -cone.opposed
    else:
        normals = planes[0]
    for normal in normals:
        heights = normal @ cone.rays
        if not np.any(heights < -tolerance):
            return normal
        if not np.any(heights > tolerance):
            return -normal
    return None
