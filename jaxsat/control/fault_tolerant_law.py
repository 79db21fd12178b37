"""How the law that diagnoses its thrusters is built of a table."""

from collections.abc import Iterable, Mapping
from typing import Any, NamedTuple, TypeVar, cast

import jax
import numpy as np
from jaxtyping import Float

from jaxsat.control.context import LawContext, ThrusterContext, UnsuitableModel
from jaxsat.control.diagnosis import Diagnosis, ResidualFilter
from jaxsat.control.fault_tolerant import FaultTolerant, SettlingLaws
from jaxsat.control.leaks import Leaks
from jaxsat.control.presets import coasting
from jaxsat.control.pulse_rounding import PulseRounding
from jaxsat.control.quaternion_feedback import QuaternionFeedback
from jaxsat.control.reconfiguration import (
    FailedSet,
    Left,
    Reconfiguration,
    failed_sets,
    limit_about,
)
from jaxsat.control.settling_laws import build_three_slew
from jaxsat.control.supervisor import ThreeSlewSettling
from jaxsat.core.allocation import torque_directions
from jaxsat.core.checks import as_array
from jaxsat.core.inertia import normal_axes

LEAST_NOISE = 1e-3
"""Of the rate that the strongest thruster changes in a period: of rates told without noise."""

DIGITS = 9
"""Of planes and limits that count as the same."""


Tree = TypeVar("Tree")


class Steps(NamedTuple):
    """The largest rate (rad/s) that a least pulse changes, and the noise of measured rates."""

    pulse: float
    noise: float


def build_fault_tolerant(values: Mapping[str, Any], context: LawContext) -> FaultTolerant:
    """The law of a table, with the tables of all that may fail.

    A plane in which the two torques cannot steer the third axis counts as less than a plane.
    """
    thrusters = cast(ThrusterContext, context.thrusters)
    torque = np.asarray(thrusters.model.torque)
    effect = np.asarray(context.model.spacecraft.inverse_inertia) @ torque
    sizes = np.sqrt(np.sum(effect**2, axis=0))
    least = LEAST_NOISE * values["period_s"] * float(sizes.max())
    given = values["rate_noise_rad_s"]
    noise = max(thrusters.rate_noise, least) if given is None else given
    pulse = float(np.max(sizes * thrusters.pulse))
    sets = failed_sets(torque)
    sets, settling = _settling(values, context, torque, sets, Steps(pulse, noise))
    residual = ResidualFilter(
        model=context.model,
        thrusters=thrusters.model,
        rate_noise=noise,
        uncertainty=values["torque_uncertainty"],
    )
    return FaultTolerant(
        healthy=QuaternionFeedback.from_table(values, context),
        diagnosis=Diagnosis(
            residual,
            values["cusum_reference"],
            values["cusum_threshold"],
            values["isolation_margin"],
        ),
        reconfiguration=Reconfiguration.of(torque, thrusters.cost, sets),
        rounding=PulseRounding(effect, thrusters.pulse),
        settling=settling,
        period=values["period_s"],
    )


def _settling(
    values: Mapping[str, Any],
    context: LawContext,
    torque: Float[np.ndarray, "3 m"],
    sets: tuple[FailedSet, ...],
    steps: Steps,
) -> tuple[tuple[FailedSet, ...], SettlingLaws | None]:
    """The sets, and the laws of those that leave a plane; None where no set does."""
    places: dict[tuple, int | None] = {}
    laws: list[tuple[ThreeSlewSettling, np.ndarray, Leaks]] = []
    of_set, known = [], []
    for one in sets:
        place = None
        if one.directions is not None:
            axes = _plane_axes(context, one.directions)
            limit = limit_about(np.delete(torque, one.failed, axis=1), axes)
            key = (one.failed, *np.round(axes, DIGITS).ravel().tolist(), round(limit, DIGITS))
            if key not in places:
                law = _law(values, context, axes, limit, steps, torque, one.failed)
                places[key] = None if law is None else len(laws)
                laws += [] if law is None else [law]
            place = places[key]
            if place is None:
                one = one._replace(left=Left.LESS, directions=None)
        known.append(one)
        of_set.append(place or 0)
    if not laws:
        return tuple(known), None
    stacked = _stacked(law for law, _, _ in laws)
    directions = np.stack([directions for _, directions, _ in laws])
    leaks = _stacked(leaks for _, _, leaks in laws)
    return tuple(known), SettlingLaws(stacked, as_array(np.array(of_set)), directions, leaks)


def _stacked(trees: Iterable[Tree]) -> Tree:
    """One tree, with a leading axis, of many alike."""
    return jax.tree.map(lambda *leaves: as_array(np.stack(leaves)), *trees)


def _plane_axes(
    context: LawContext, directions: Float[np.ndarray, "3 2"]
) -> Float[np.ndarray, "3 2"]:
    """The axes x and y of the normal form of two torques."""
    axes, _ = normal_axes(np.asarray(context.model.spacecraft.inertia), directions)
    return axes[:2].T


def _law(
    values: Mapping[str, Any],
    context: LawContext,
    axes: np.ndarray,
    limit: float,
    steps: Steps,
    torque: Float[np.ndarray, "3 m"],
    failed: tuple[int, ...],
) -> tuple[ThreeSlewSettling, np.ndarray, Leaks] | None:
    """The law of three slews about two axes, and those about which it commands."""
    table = {
        "period_s": values["period_s"],
        "observe_ripple": True,
        "estimate_axes": True,
        "ripple_amplitude_N_m": None,
        "ripple_frequency_rad_s": None,
    }
    own = context._replace(torque_axes=axes, torque_limit=limit)
    try:
        law = build_three_slew(table, own)
    except UnsuitableModel:
        return None
    law = coasting(law, steps.pulse, steps.noise)
    least = np.asarray(cast(ThrusterContext, context.thrusters).pulse)
    leaks, law = Leaks.of(law, torque, failed, least)
    return law, torque_directions(axes), leaks
