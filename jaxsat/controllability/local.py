"""Small-time local controllability at rest (Sussmann's condition), apart from accessibility.

Accessibility (rank 6) means that the reachable set has an interior; small-time local
controllability (STLC) means that the start is inside it after any short time. Sussmann (SIAM J.
Control Optim. 25 (1987) 158-194): STLC holds at an equilibrium with full rank if every bad bracket
(f an odd, every control an even number of times) is spanned there by brackets of fewer letters.
"""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from jaxtyping import Float

from jaxsat.controllability import exact
from jaxsat.controllability.decision import decide_rank
from jaxsat.controllability.layout import TOLERANCE, Numbers, make_layout


@dataclass(frozen=True, eq=False)
class LocalControllability:
    """STLC at rest: "proved", "disproved" or "not decided", and the reason.

    `axes` are the torque directions (columns) of the proof, chosen such that their bad brackets
    ⟨w:w⟩ are neutralised; `bad` holds those brackets' components outside span{axes}, relative size
    (zeros for a proof). All for controls of both signs, T_d = 0, rest.
    """

    status: Literal["proved", "disproved", "not decided"]
    reason: str
    axes: Float[np.ndarray, "3 d"]
    bad: Float[np.ndarray, " d"]


def _neutral_pair(
    inertia: Float[np.ndarray, "3 3"], plane: Float[np.ndarray, "3 2"]
) -> tuple[Float[np.ndarray, "3 2"], Float[np.ndarray, "2"]]:
    """Return two directions of the plane with n·⟨w:w⟩ = 0, and the residual round-off.

    The form n·⟨w:w⟩ is indefinite or zero: of one sign it would push the free body through the
    plane one way only, against the conservation of volume and energy. Its null directions are real.
    """
    inverse = np.linalg.inv(inertia / np.max(np.abs(inertia)))
    normal = np.cross(plane[:, 0], plane[:, 1])

    def form(p, q):
        torque = np.cross(inverse @ p, q) + np.cross(inverse @ q, p)
        size = np.linalg.norm(inverse @ p) * np.linalg.norm(q)
        return float(normal @ torque), float(size)

    p, q = plane.T
    matrix = np.array([[form(p, p)[0], form(p, q)[0]], [form(p, q)[0], form(q, q)[0]]])
    values, vectors = np.linalg.eigh(matrix)
    ratio = np.sqrt(max(-values[0], 0.0)), np.sqrt(max(values[1], 0.0))
    if max(ratio) == 0.0:
        ratio = (1.0, 1.0)
    weights = np.array([[ratio[1], ratio[1]], [ratio[0], -ratio[0]]]) / np.hypot(*ratio)
    pair = plane @ vectors @ weights
    residuals = np.array([form(w, w)[0] / form(w, w)[1] for w in pair.T])
    return pair, residuals


def small_time_local_controllability(
    inertia: Numbers, torque_axes: Numbers, *, tolerance: float | int = TOLERANCE
) -> LocalControllability:
    """Decide whether every nearby state can be reached from rest within any short time.

    `inertia` (3,) or (3, 3) in kg m²; `torque_axes` (3, m), each torque of both signs. Rest means
    ω = 0 in inertial space with T_d = 0. At the equilibrium in the orbit frame the proofs remain
    valid, the disproofs do not: rank 6 of the linear system there proves STLC.

    - Rank below 6: disproved (accessibility is necessary for analytic systems).
    - Three independent axes: proved; two: proved, by two directions w1, w2 of their plane whose bad
      brackets vanish modulo the plane, the good ⟨w1:w2⟩ giving the third direction.
    - One axis: disproved, ⟨v:v⟩ is outside span{ad_f^k v} (Sussmann, SIAM J. Control Optim. 21
      (1983) 686-713): rates in its direction start on one side only. Large-time controllability
      through drift recurrence is unaffected.
    - A borderline layout is not decided.

    Raises ValueError as `analyse` does.
    """
    layout = make_layout(inertia, torque_axes)
    decision = decide_rank(layout, tuple(range(len(layout.labels))), tolerance)
    none = np.zeros((3, 0))
    if decision.borderline:
        return LocalControllability("not decided", "The rank itself is borderline.", none, none[0])
    if decision.rank < 6:
        reason = f"Rank {decision.rank} of 6: no open set of states is reachable from rest."
        return LocalControllability("disproved", reason, none, none[0])
    axes = exact.independent(layout.integer_axes)
    units = np.stack([exact.unit(axis) for axis in axes], axis=1)
    directions, values, _ = np.linalg.svd(layout.vectors[:, : len(layout.labels)])
    strong = values > decision.tolerance
    if len(axes) != int(np.sum(strong)):
        reason = "The torque axes are nearly dependent: their own rank is borderline."
        return LocalControllability("not decided", reason, none, none[0])
    if len(axes) == 3:
        reason = "Three independent torque axes: no bracket of the drift is needed."
        return LocalControllability("proved", reason, units, np.zeros(3))
    if len(axes) == 2:
        pair, residuals = _neutral_pair(layout.inertia, directions[:, :2])
        reason = (
            "Two independent torque axes: the bad brackets of the two directions lie in their "
            "plane, and the good bracket of both supplies the third axis."
        )
        return LocalControllability("proved", reason, pair, residuals)
    bad = exact.relative_product(exact.adjugate(layout.integer_inertia), axes[0], axes[0])
    reason = (
        "One torque axis: the bad bracket [[f,g],g] cannot be neutralised, so rates start on one "
        "side of it only; reaching the other side takes the drift, not a short time."
    )
    return LocalControllability("disproved", reason, units, np.array([np.linalg.norm(bad)]))
