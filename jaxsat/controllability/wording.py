"""Verdicts as text, for the command line, the table of failures and the written page."""

import numpy as np
from jaxtyping import Float

from jaxsat.control.flyable_laws import FLYABLE
from jaxsat.controllability.cone import TorqueCone, direction_words, torque_cone
from jaxsat.controllability.decision import RankDecision
from jaxsat.controllability.judgement import Judgement
from jaxsat.controllability.rod_wording import rod_sentence, rods_lost
from jaxsat.core.text import capitalised, fixed_text, number_text


def _direction(vector: Float[np.ndarray, "3"]) -> str:
    vector = vector * np.sign(vector[np.argmax(np.abs(vector))])
    return "(" + ", ".join(fixed_text(entry, 3) for entry in vector) + ")"


def rank_verdict(decision: RankDecision, count: int) -> str:
    """Return one sentence about the rank of `count` torques of both signs."""
    names = ", ".join(decision.generators)
    if decision.borderline and decision.exact_rank != decision.rank:
        return (
            f"Borderline: rank {decision.rank} of 6 to rounding, although the numbers exactly as "
            f"given have rank {decision.exact_rank}; treat as not controllable."
        )
    if decision.borderline:
        smallest = decision.singular_values[decision.dimension - 1]
        return (
            f"Borderline: rank {decision.rank} of 6 for the numbers as given, but the singular "
            f"value that decides, {smallest:.1e}, is below the tolerance {decision.tolerance:.0e}."
        )
    if decision.rank == 6:
        margin = number_text(decision.margin, 3)
        return f"Controllable: rank 6 of 6, margin {margin}, from {names} and [f,·]."
    if decision.rank == 5:
        return (
            "Not controllable: rank 5 of 6 at rest; no torque or bracket acts along the body "
            f"torque direction {_direction(decision.missing[:, 0])}."
        )
    if decision.rank == 2:
        return (
            "Not controllable: rank 2 of 6 at rest; only the rotation about the principal axis "
            f"{_direction(decision.reached[:, 0])} can be commanded."
        )
    reason = "no thrusters" if count == 0 else "every torque axis is zero"
    return f"Not controllable: rank 0 of 6, {reason}."


def _rank_lost(decision: RankDecision, directions: int) -> str:
    if decision.rank == 0:
        return "all control"
    if decision.rank == 2:
        return f"all but rotation about {_axis(decision.reached[:, 0])}"
    if decision.rank == 5:
        return f"angular acceleration along torque {_axis(decision.missing[:, 0])}"
    if directions == 3:
        return "nothing"
    if directions == 2:
        return "direct torque about one axis; reached through the drift"
    return "direct torque about two axes; small-time control"


def _coasts_beside_thrusters(judgement: Judgement) -> bool:
    """Whether coasting wheels decide the authority of thrusters."""
    is_undecided = judgement.verdict in ("by drift", "not decided") and judgement.laws == "none"
    return bool(judgement.coasting) and is_undecided and bool(np.any(judgement.actuators.torques))


def _lost_ways(cone: TorqueCone) -> str:
    """Return the torques that one-sided thrusters cannot make, as text."""
    assert cone.opposed is not None
    return f"torque along {direction_words(cone.opposed)}"


def both_signs_by(judgement: Judgement) -> str:
    """Return the kinds of actuators that make the torques of both signs: alone, or together.

    Empty where no torque has both signs.
    """
    if judgement.orbit is not None:
        return "magnetorquers and wheels" if judgement.orbit.wheels else "magnetorquers"
    actuators, dimension = judgement.actuators, judgement.cone.two_sided
    wheels = np.ones(len(actuators.wheels), bool)
    makers = {
        "thrusters": torque_cone(actuators.torques, actuators.two_sided).two_sided,
        "wheels": torque_cone(actuators.wheel_axes, wheels).two_sided,
    }
    alone = [kind for kind, both_signs in makers.items() if both_signs == dimension]
    if not dimension:
        return ""
    return " or ".join(alone) or " and ".join(makers)


def lost_words(judgement: Judgement) -> str:
    """Return the control authority that a failure removes, as text."""
    wheels, cone = judgement.level_set, judgement.cone
    if judgement.orbit is not None:
        return rods_lost(judgement, judgement.orbit)
    if _coasts_beside_thrusters(judgement):
        return f"every law, while wheels coast with {judgement.coasting:.3g} N m s"
    if judgement.decision is None:
        assert wheels is not None
        return _wheels_lost(judgement)
    if not judgement.one_signed:
        return _rank_lost(judgement.decision, cone.span)
    ways = _lost_ways(cone)
    if judgement.rank < 6:
        return f"{_rank_lost(judgement.decision, cone.span)}; {ways}"
    if judgement.barrier is not None and judgement.verdict == "uncontrollable":
        return f"{ways}; removal of angular momentum along {direction_words(judgement.barrier)}"
    if judgement.verdict == "by drift":
        return f"{ways}; reached through the drift, by no law"
    return ways


def _wheels_lost(judgement: Judgement) -> str:
    wheels = judgement.level_set
    assert wheels is not None
    if judgement.laws == "three torques":
        return "nothing"
    if judgement.dimension == 6:
        if judgement.cone.normal is not None:
            loss = f"direct torque of both signs about {_axis(judgement.cone.normal)}"
        else:
            loss = _lost_ways(judgement.cone) if judgement.one_signed else "two torques"
        return loss if judgement.rank == 6 else f"{loss}; rank {judgement.rank} of 6"
    if not wheels.rests:
        return f"rest at any attitude, while wheels coast with {judgement.coasting:.3g} N m s"
    if wheels.axes == 2:
        normal = _axis(wheels.missing[:, 0])
        rest = "rest, except where the momentum is normal to it"
        if wheels.coasting:
            rest = "rest, except where the momentum along it is that of the coasting wheels"
        return f"torque about {normal}; " + (rest if wheels.momentum else "Jω along it stays zero")
    if wheels.turned_about is None and wheels.coasting:
        return "rest, except where the momentum is that of the wheels"
    if wheels.turned_about is None:
        return "rest, except where the momentum is along the wheel axis"
    return f"all but rotation about {direction_words(wheels.turned_about)}"


def verdict_sentence(judgement: Judgement) -> str:
    """Return the verdict and its reason, in a sentence or two."""
    if judgement.orbit is not None:
        return rod_sentence(judgement, judgement.orbit)
    if _coasts_beside_thrusters(judgement):
        start = {"by drift": "Controllable by drift", "not decided": "Not decided"}
        least = "" if judgement.rank == 6 else " at least"
        return (
            f"{start[judgement.verdict]}: rank {judgement.rank} of 6{least}; "
            f"{cone_words(judgement.cone)}. Wheels that coast with {judgement.coasting:.3g} N m s "
            "couple the axes, which no law for two torques models."
        )
    if judgement.decision is None:
        return _wheel_sentence(judgement)
    by_rank = rank_verdict(judgement.decision, len(judgement.actuators.names))
    rank = f"rank {judgement.rank} of 6, margin {number_text(judgement.margin, 3)}"
    cone = judgement.cone
    if judgement.decision.borderline:
        return by_rank
    if judgement.verdict == "borderline":
        return f"Borderline: the data do not determine the signs of the deciding torques; {rank}."
    if judgement.verdict == "by drift":
        return (
            f"Controllable by drift: {rank}, and the drift returns; {cone_words(cone)}. "
            "No law of jaxsat uses it."
        )
    if not judgement.one_signed:
        return by_rank
    if judgement.verdict == "controllable":
        return f"Controllable: {rank}; {cone_words(cone)}."
    if judgement.barrier is None or judgement.rank < 6:
        return f"{by_rank} {cone_words(cone).capitalize()}."
    normal = direction_words(judgement.barrier)
    return (
        f"Not controllable, although the rank is 6 of 6: {cone_words(cone)}. Neither torques nor "
        f"drift leave the half space m·Jω ≥ 0 with m = {normal}."
    )


def cone_words(cone: TorqueCone) -> str:
    """Return the attainable torques, and a direction without torque, as text."""
    normal = cone.normal
    if cone.two_sided == 3:
        return "the torques positively span all three axes"
    if normal is not None:
        text = f"two torques of both signs, in the plane with normal {direction_words(normal)}"
        if cone.opposed is None:
            return f"{text}; no torque about the normal"
        other = direction_words(cone.opposed)
        return f"{text}, and towards {direction_words(normal)} alone; none towards {other}"
    if cone.span == 0:
        return "no torque at all"
    text = f"the torques are a {cone.kind}"
    if cone.two_sided:
        text += f", of both signs along {_axis(cone.both_signs[:, 0])} alone"
    if cone.opposed is not None:
        text += f"; none towards {direction_words(cone.opposed)}"
    if cone.span < 3:
        axes = " and ".join(_axis(axis) for axis in cone.neither.T)
        text += f"; none of either sign along {axes}"
    return text


def _axis(direction: Float[np.ndarray, "3"]) -> str:
    """Return a direction as text, up to its sign."""
    entry = direction[np.argmax(np.abs(direction))]
    return direction_words(direction * np.sign(entry)).removeprefix("+")


_ONE_WHEEL = {
    "controllable": "Controllable: {rank}, one wheel with thrusters",
    "by drift": "Controllable by drift: {rank} with one wheel; wheel and drift turn the momentum "
    "to where thrusters change it; no law of jaxsat uses it",
    "uncontrollable": "Not controllable: {rank} with one wheel",
}


def _wheel_sentence(judgement: Judgement) -> str:
    wheels = judgement.level_set
    assert wheels is not None
    rank = f"rank {judgement.rank} of {judgement.dimension}"
    if judgement.verdict == "borderline":
        return "Borderline: the data do not determine the deciding wheel axes or torques."
    if judgement.dimension == 6 and wheels.axes == 1:
        text = f"{_ONE_WHEEL[judgement.verdict].format(rank=rank)}; {cone_words(judgement.cone)}."
        if judgement.barrier is None or judgement.rank < 6:
            return text
        return f"{text} Neither thrusters nor drift nor wheel leave the half space " + (
            f"m·H ≥ 0 with m = {direction_words(judgement.barrier)}."
        )
    if judgement.dimension == 6 and wheels.axes == 3:
        return f"Controllable: {rank} by three independent wheel axes."
    count = len(judgement.actuators.wheels)
    few = "two wheels" if count == 2 else f"{count} wheels in a plane"
    if judgement.dimension == 6:
        return (
            f"Controllable: {rank}; {few} turn the body to any attitude, so that "
            f"{_momentum_changers(judgement)} in any inertial direction. "
            f"{cone_words(judgement.cone).capitalize()}."
            + ("" if FLYABLE[judgement.laws].everywhere else " No law of jaxsat uses them.")
        )
    where = "on the level set of the conserved momentum"
    if not wheels.rests:
        return (
            f"Not controllable: rest is possible at no attitude, because wheels coast with "
            f"{wheels.coasting:.3g} N m s normal to the others, and the total momentum is "
            f"{wheels.momentum:.3g} N m s."
        )
    if wheels.axes == 2:
        normal = _axis(wheels.missing[:, 0])
        if not wheels.momentum:
            return (
                f"Controllable: {rank} {where}. {capitalised(few)}, zero momentum: n·Jω stays zero "
                f"with n = {normal}; the bracket of the two remaining rates reaches every attitude."
            )
        return (
            f"Some attitudes: {rank} {where}. {capitalised(few)} with "
            f"{wheels.momentum:.3g} N m s of total momentum: the body can pass every "
            "attitude, but rest is possible only where the momentum "
            + (
                f"along n = {normal} is the {wheels.coasting:.3g} N m s of the wheels that coast."
                if wheels.coasting
                else f"is normal to n = {normal}."
            )
        )
    if wheels.turned_about is not None:
        axis = direction_words(wheels.turned_about)
        return f"Not controllable: {rank} {where}; one wheel turns the body about {axis} alone."
    return (
        f"Not controllable: {rank} {where}; with {wheels.momentum:.3g} N m s of total momentum "
        + (
            "rest is possible only where it is that of the wheels, one of which can change."
            if wheels.coasting
            else "rest is possible only where it is along the wheel axis."
        )
    )


def momentum_words(judgement: Judgement, magnetorquers: bool = False) -> str | None:
    """Return text on the wheels' momentum and what changes it; None without wheels.

    `magnetorquers` says whether some work.
    """
    wheels = judgement.level_set
    if wheels is None:
        return None
    start = f"Momentum: {wheels.momentum:.3g} N m s in total at the start"
    if magnetorquers:
        return f"{start}; magnetorquers take momentum across the field out of the wheels"
    if not np.any(judgement.actuators.torques):
        return f"{start}, conserved: no actuator removes momentum from the wheels"
    if wheels.axes == 1:
        return f"{start}; valid while the momentum of the wheel is small"
    clause = "two wheels turn" if wheels.axes == 2 else "the wheels turn"
    return f"{start}; {clause} the body, so that {_momentum_changers(judgement)} in any direction"


def _momentum_changers(judgement: Judgement) -> str:
    """Return the thrusters that change the momentum as text; a one-sided one suffices."""
    actuators = judgement.actuators
    pushing = np.any(actuators.torques, axis=0)
    if np.sum(pushing) > 1:
        return "thrusters change the momentum"
    (number,) = np.flatnonzero(pushing)
    way = "pushes both ways" if actuators.two_sided[number] else "pushes one way"
    return f"the one thruster, which {way}, changes the momentum"


def once_stopped_words(judgement: Judgement, stopped: Judgement | None) -> str | None:
    """Return the verdict after friction has stopped coasting wheels; None if it is the same."""
    if stopped is None or (stopped.verdict, stopped.rank) == (judgement.verdict, judgement.rank):
        return None
    return f"Once friction has stopped the coasting wheels: {verdict_sentence(stopped)}"
