"""The Lie algebra rank condition of a layout, with margin, turn time and ranks at other states."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from jaxsat.controllability.decision import (
    RANK_OF_DIMENSION,
    ClosedForm,
    closure_growth,
    decide_rank,
    decided_turn_time,
    one_thruster_condition,
    two_thruster_condition,
)
from jaxsat.controllability.layout import TOLERANCE, Numbers, TorqueLayout, make_layout
from jaxsat.controllability.lie import rank_at_state
from jaxsat.controllability.linear import (
    LinearControllability,
    NoEquilibriumError,
    linear_controllability,
)
from jaxsat.controllability.local import LocalControllability, small_time_local_controllability
from jaxsat.controllability.wording import rank_verdict
from jaxsat.core.once import once_property

# Generic directions, for "moving" and "disturbed" states.
_MOVING = np.array([0.6180, -0.5291, 0.8437])
_DISTURBED = np.array([0.7071, 0.4142, -0.5773])


@dataclass(frozen=True, eq=False)
class Analysis:
    """Result of `analyse`.

    - `rank`: 0, 2, 5 or 6, the smallest over all states, drift not counted.
    - `controllable`: rank 6.
    - `borderline`: the smallest singular value that is not exactly zero is below `tolerance`, so
      round-off or the last digits of the data decide; `rank` then counts values above `rounding`.
    - `margin`: smallest singular value of the normalised generating vectors (0 to about 1), zero
      if and only if the numbers as given are not controllable. It depends on directions alone: it
      measures the trust in the decision, not how quickly the spacecraft turns.
    - `turn_time`: time in s to turn by one radian about the hardest axis with thrusters of 1 N m,
      infinite if not controllable; see `turn_time`.
    - `verdict`: one sentence.
    - `singular_values`: all three, largest first; exact zeros are zeros.
    - `exact_rank`: the rank of the numbers exactly as given, whatever the margin.
    - `generators`: brackets that span S, the strongest of the list.
    - `growth`: dimension of the closure after each round, ending when a round adds nothing.
    - `reached`, `missing`: orthonormal body torque directions inside and outside J S.
    - `closed_form`: (25) for two thrusters, (35) for one, else None.
    - `physical`: no principal moment exceeds the sum of the other two.
    - `away_from_rest`, `local`, `linear`: ranks at other states, small-time local controllability
      at rest, linear controllability in the orbit frame; computed at first use.
    """

    rank: int
    controllable: bool
    borderline: bool
    margin: float
    turn_time: float
    verdict: str
    singular_values: Float[np.ndarray, "3"]
    tolerance: float
    rounding: float
    exact_rank: int
    generators: tuple[str, ...]
    growth: tuple[int, ...]
    reached: Float[np.ndarray, "3 d"]
    missing: Float[np.ndarray, "3 e"]
    closed_form: ClosedForm | None
    physical: bool
    inertia: Float[np.ndarray, "3 3"]
    torque_axes: Float[np.ndarray, "3 m"]
    disturbance: Float[np.ndarray, "3"] | None
    orbit_rate: float

    @once_property
    def away_from_rest(self) -> dict[str, int]:
        """Rank with motion and with T_d; see `ranks_away_from_rest`."""
        return ranks_away_from_rest(self.inertia, self.reached, self.disturbance)

    @once_property
    def local(self) -> LocalControllability:
        """Small-time local controllability at rest; see `small_time_local_controllability`."""
        return small_time_local_controllability(
            self.inertia, self.torque_axes, tolerance=self.tolerance
        )

    @once_property
    def linear(self) -> LinearControllability | None:
        """The system linearised in the orbit frame, None where that is no equilibrium."""
        try:
            return linear_controllability(
                self.inertia, self.torque_axes, self.orbit_rate, tolerance=self.tolerance
            )
        except NoEquilibriumError:
            return None


def ranks_away_from_rest(
    inertia: Float[np.ndarray, "3 3"],
    reached: Float[np.ndarray, "3 d"],
    disturbance: Float[np.ndarray, "3"] | None = None,
) -> dict[str, int]:
    """Compute the rank with motion and with T_d, a lower bound from brackets to depth 7.

    `inertia` in kg m²; `reached` spans J S (body torques); `disturbance` in N m, of which only the
    direction matters (default: a generic one). "at rest" has T_d = 0; a moving state is a generic
    one; "drift counted" adds f itself to the span.
    """
    if reached.shape[1] == 3:
        moving = (6, 6, 6, 6, 6)
    else:
        scale = float(np.max(np.abs(inertia)))
        accelerations = np.linalg.solve(inertia / scale, reached)
        torque = _DISTURBED if disturbance is None else disturbance
        torque = torque / np.max(np.abs(torque))
        still = np.zeros(3)
        cases = [
            (_MOVING, still, False),
            (_MOVING, still, True),
            (still, torque, False),
            (_MOVING, torque, False),
            (_MOVING, torque, True),
        ]
        moving = tuple(
            rank_at_state(
                inertia, accelerations, omega=omega, disturbance=push, count_drift=counts_drift
            )
            for omega, push, counts_drift in cases
        )
    return {
        "at rest": RANK_OF_DIMENSION[reached.shape[1]],
        "moving": moving[0],
        "moving, drift counted": moving[1],
        "at rest, disturbed": moving[2],
        "moving, disturbed": moving[3],
        "moving, disturbed, drift counted": moving[4],
    }


def _closed_form(inertia: Numbers, layout: TorqueLayout) -> ClosedForm | None:
    live = [i for i, axis in enumerate(layout.integer_axes) if any(axis)]
    if len(live) == 1:
        return one_thruster_condition(inertia, layout.torque_axes[:, live])
    if len(live) == 2:
        return two_thruster_condition(inertia, layout.torque_axes[:, live])
    return None


def analyse(
    inertia: Numbers,
    torque_axes: Numbers,
    *,
    disturbance: Numbers | None = None,
    orbit_rate: float | int = 0.0,
    tolerance: float | int = TOLERANCE,
    labels: Sequence[str] | None = None,
) -> Analysis:
    """Decide whether a spacecraft with these thrusters can be steered in attitude and rate.

    `inertia` (kg m²): (3,) principal moments or a symmetric (3, 3) matrix. `torque_axes`: (3, m),
    columns the torque directions of the working thrusters in body axes, each of either sign, any
    length, any m. `disturbance` (3,) in N m: direction of T_d for `away_from_rest`. `orbit_rate`
    (rad/s) is for `linear` alone: with the exact (11) it cancels from every bracket and changes no
    rank. `labels` name the thrusters in `generators` (default g1, g2, …).

    `tolerance`: a deciding singular value below it makes the verdict borderline. Singular values
    change no faster than the relative error of the data (times about ten), so the default 5e-6
    covers the uncertainty of six printed digits (5e-7) or single-precision storage, and so axes
    that are 1e-4 degrees apart; it is far above the effect of rounded inputs (128 eps cond(J)),
    which replaces it when larger. Inertia known to a
    percent calls for 1e-2. A small value need not mean that an uncontrollable layout is near: close
    to two equal moments the margin of one thruster falls with a high power of the distance.

    Conditions (13), (25), (35); brackets as in (20)-(33) with J⁻¹ restored. Works in NumPy and
    integers, the same with JAX in 32-bit mode. Raises ValueError or TypeError for wrong shapes,
    entries that are not finite, an inertia that is not symmetric positive definite, or a tolerance
    outside (0, 1).
    """
    if not 0.0 < tolerance < 1.0:
        raise ValueError(f"Argument `tolerance` must lie between 0 and 1, but got {tolerance}")
    layout = make_layout(inertia, torque_axes, labels=labels)
    torque = None
    if disturbance is not None:
        torque = np.asarray(disturbance, dtype=float)
        if torque.shape != (3,) or not np.all(np.isfinite(torque)) or not np.any(torque):
            raise ValueError(
                "Argument `disturbance` must be three finite torques, not all zero, but got "
                f"{torque.tolist()}"
            )
    everyone = tuple(range(len(layout.labels)))
    decision = decide_rank(layout, everyone, tolerance)
    moments = np.linalg.eigvalsh(layout.inertia)
    return Analysis(
        rank=decision.rank,
        controllable=decision.controllable,
        borderline=decision.borderline,
        margin=decision.margin,
        turn_time=decided_turn_time(decision, layout.inertia, layout.torque_axes),
        verdict=rank_verdict(decision, len(everyone)),
        singular_values=decision.singular_values,
        tolerance=decision.tolerance,
        rounding=layout.rounding,
        exact_rank=decision.exact_rank,
        generators=decision.generators,
        growth=closure_growth(layout, everyone),
        reached=decision.reached,
        missing=decision.missing,
        closed_form=_closed_form(inertia, layout),
        physical=bool(moments[2] <= (moments[0] + moments[1]) * (1.0 + 1e-12)),
        inertia=layout.inertia,
        torque_axes=layout.torque_axes,
        disturbance=torque,
        orbit_rate=float(orbit_rate),
    )
