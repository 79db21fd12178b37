"""Judging a set of actuators: by torques, by wheels on their level set, by both."""

import dataclasses

import numpy as np
from jaxtyping import Bool, Float

from jaxsat.control.flyable_laws import Laws
from jaxsat.controllability.actuators import ActuatorSet
from jaxsat.controllability.barrier import momentum_barrier
from jaxsat.controllability.cone import ROUNDING, TorqueCone, torque_cone
from jaxsat.controllability.decision import (
    RANK_OF_DIMENSION,
    RankDecision,
    decide_rank,
    decided_turn_time,
    turn_time,
)
from jaxsat.controllability.judgement import Judgement, Verdict
from jaxsat.controllability.layout import (
    TOLERANCE,
    Numbers,
    TorqueLayout,
    inertia_matrix,
    make_layout,
)
from jaxsat.controllability.wheels import MomentumLevelSet, momentum_level_set, one_wheel_brackets


def actuator_layout(inertia: Numbers, actuators: ActuatorSet) -> TorqueLayout:
    """Return the brackets of thrusters and wheels, for `judge_only`; `inertia` with wheels locked.

    Turning or coasting rotors are no part of the inertia that a torque turns.
    """
    if np.any(actuators.free_rotors):
        inertia = inertia_matrix(inertia)[0] - actuators.free_rotors
    return make_layout(inertia, actuators.columns, labels=actuators.names)


def judge(
    inertia: Numbers, actuators: ActuatorSet, *, tolerance: float | int = TOLERANCE
) -> Judgement:
    """Judge controllability by these actuators; `inertia` (3,) or (3, 3), kg m², wheels locked.

    `tolerance` as in `analyse`. Raises ValueError as `make_layout` does.
    """
    everyone = tuple(range(len(actuators.names)))
    return judge_only(actuator_layout(inertia, actuators), actuators, everyone, tolerance)


def judge_once_stopped(
    judgement: Judgement, tolerance: float | int = TOLERANCE
) -> Judgement | None:
    """Return the judgement after friction has stopped the coasting wheels; None without any."""
    if not judgement.coasting:
        return None
    actuators = judgement.actuators
    locked_inertia = judgement.inertia + actuators.free_rotors
    return judge(locked_inertia, actuators.once_stopped, tolerance=tolerance)


def judge_only(
    layout: TorqueLayout, actuators: ActuatorSet, places: tuple[int, ...], tolerance: float | int
) -> Judgement:
    """Judge a subset, by ascending places in `actuators.names`, with the brackets of all.

    The other wheels coast.
    """
    judgement = _judge_set(layout, actuators, actuators.only(places), places, tolerance)
    thrusters = bool(np.any(judgement.actuators.torques))
    if not judgement.coasting or not thrusters or judgement.laws == "three torques":
        return judgement
    return _beside_coasting_wheels(judgement)


def _beside_coasting_wheels(stopped: Judgement) -> Judgement:
    """Return the judgement beside coasting wheels from that of `stopped` ones, below three torques.

    A coasting wheel adds a gyroscopic torque that is linear in ω. Double brackets at rest do not
    contain it, so the rank is no less than without. It does no work and has no divergence, so the
    drift returns as before: torques of both signs of rank 6 control. No law models it.
    """
    verdict: Verdict = "not decided"
    both_signs = stopped.decision is not None and not stopped.one_signed
    if stopped.verdict == "borderline":
        verdict = "borderline"
    elif both_signs and stopped.rank == 6:
        verdict = "by drift"
    return dataclasses.replace(stopped, verdict=verdict, laws="none", turn_time=np.nan)


def _judge_set(
    layout: TorqueLayout,
    actuators: ActuatorSet,
    healthy: ActuatorSet,
    places: tuple[int, ...],
    tolerance: float | int,
) -> Judgement:
    """Judge the `healthy` of all actuators, without the gyroscopic torque on thrusters."""
    thrusters = len(healthy.thrusters)
    jets = torque_cone(healthy.torques, healthy.two_sided, tolerance)
    wheels = momentum_level_set(layout.inertia, healthy, tolerance)
    if wheels.axes == 0:
        return _by_torques(layout, healthy.only(range(thrusters)), places[:thrusters], tolerance)
    signs = np.concatenate([healthy.two_sided, np.ones(len(places) - thrusters, bool)])
    cone = torque_cone(healthy.columns, signs, tolerance)
    if wheels.axes == 1 and jets.span:
        jets_alone = places[:thrusters]
        alone = _judge_set(
            layout, actuators, healthy.once_stopped.only(range(thrusters)), jets_alone, tolerance
        )
        return _with_one_wheel(healthy, cone, wheels, alone, tolerance)
    if jets.span == 0:
        verdict, laws = _wheels_alone(wheels, healthy.target_turns)
        rank, dimension = wheels.rank, wheels.dimension
    else:  # thrusters take momentum up in any inertial direction, wheels having turned the body
        verdict, rank, dimension = "controllable", 6, 6
        # Otherwise laws use the wheels alone, as in `_wheels_alone`.
        laws = _wheels_alone(wheels, healthy.target_turns)[1]
        laws = "three torques" if cone.two_sided == 3 else laws
    if wheels.borderline or cone.borderline:
        verdict = "borderline"
    return Judgement(
        inertia=layout.inertia,
        actuators=healthy,
        verdict=verdict,
        rank=rank,
        dimension=dimension,
        laws=laws,
        margin=wheels.margin,
        turn_time=np.nan,
        cone=cone,
        level_set=wheels,
    )


def _wheels_alone(wheels: MomentumLevelSet, target_turns: bool) -> tuple[Verdict, Laws]:
    """Return the verdict on wheels; those with momentum hold no turning attitude for long."""
    if wheels.axes == 3:
        return "controllable", "three torques"
    if wheels.axes == 2 and wheels.rests:
        if not wheels.momentum:
            return "controllable", "two wheels"
        return "some attitudes", "none" if target_turns else "nearest attitude"
    return "uncontrollable", "none"


def _with_one_wheel(
    healthy: ActuatorSet,
    cone: TorqueCone,
    wheels: MomentumLevelSet,
    alone: Judgement,
    tolerance: float,
) -> Judgement:
    """Judge by the torques of both signs and a gyrostat's brackets; `alone` has no wheel."""
    axis, inertia = wheels.directions[:, 0], alone.inertia
    directions, margin = one_wheel_brackets(inertia, healthy.torques, axis, tolerance)
    turned_about = np.linalg.solve(inertia / np.abs(inertia).max(), axis)
    barrier, strict = (
        momentum_barrier(inertia, alone.cone, level, turned_about)
        for level in (tolerance, ROUNDING)
    )
    laws: Laws = "three torques" if cone.two_sided == 3 else alone.laws
    if laws == "two torques" and np.any(healthy.stored):
        laws = "none"  # no law of two torques models the momentum
    verdict: Verdict = "uncontrollable"
    if laws != "none":
        verdict = "controllable"
    elif directions.shape[1] == 3 and barrier is None:
        verdict = "by drift"
    is_undecided = (
        laws == "none" and directions.shape[1] == 3 and (barrier is None) != (strict is None)
    )
    doubtful = alone.borderline and laws == alone.laws != "none"
    if cone.borderline or wheels.borderline or doubtful or is_undecided:
        verdict = "borderline"
    turn = alone.turn_time
    if cone.two_sided == 3:
        turn = turn_time(inertia, cone.both_signs)
    return Judgement(
        inertia=inertia,
        actuators=healthy,
        verdict=verdict,
        rank=RANK_OF_DIMENSION[directions.shape[1]],
        dimension=6,
        laws=laws,
        margin=margin,
        turn_time=turn if laws != "none" else np.nan,
        cone=cone,
        barrier=barrier if laws == "none" else None,
        level_set=wheels,
    )


def _by_torques(
    layout: TorqueLayout, healthy: ActuatorSet, places: tuple[int, ...], tolerance: float
) -> Judgement:
    """Judge thrusters alone, by the cone of their torques and the rank condition."""
    signs = healthy.two_sided
    cone = torque_cone(healthy.torques, signs, tolerance)
    decision = decide_rank(layout, places, tolerance)
    law_decision = decision
    if cone.two_sided == 2 and cone.span == 3:
        in_plane = _in_plane(healthy.torques, places, cone, tolerance)
        law_decision = decide_rank(layout, in_plane, tolerance)
    laws: Laws = "none"
    if cone.two_sided >= 2 and law_decision.controllable:
        laws = "three torques" if cone.two_sided == 3 else "two torques"
    barrier = momentum_barrier(layout.inertia, cone, tolerance)
    strict = momentum_barrier(layout.inertia, cone, ROUNDING)
    verdict: Verdict = "uncontrollable"
    if laws != "none":
        verdict = "controllable"
    elif decision.controllable and barrier is None:
        verdict = "by drift"
    one_signed = cone.span > cone.two_sided
    is_undecided = one_signed and laws == "none" and (barrier is None) != (strict is None)
    if decision.borderline or law_decision.borderline or cone.borderline or is_undecided:
        verdict = "borderline"
    return Judgement(
        inertia=layout.inertia,
        actuators=healthy,
        verdict=verdict,
        rank=decision.rank,
        dimension=6,
        laws=laws,
        margin=decision.margin,
        turn_time=_turn_time(decision, layout.inertia, healthy.torques, signs, cone, laws),
        cone=cone,
        decision=decision,
        barrier=barrier if one_signed else None,
    )


def _in_plane(
    columns: Float[np.ndarray, "3 m"], places: tuple[int, ...], cone: TorqueCone, tolerance: float
) -> tuple[int, ...]:
    """Return the places of actuators with torques in the plane of the torques of both signs."""
    assert cone.normal is not None
    beside = np.abs(cone.normal @ columns) <= tolerance * np.linalg.norm(columns, axis=0)
    return tuple(i for i, inside in zip(places, beside, strict=True) if inside)


def _turn_time(
    decision: RankDecision,
    inertia: Float[np.ndarray, "3 3"],
    columns: Float[np.ndarray, "3 m"],
    two_sided: Bool[np.ndarray, " m"],
    cone: TorqueCone,
    laws: Laws,
) -> float:
    """Return the turn time (s) at 1 N m a thruster, or about each axis of torques of both signs."""
    if np.all(two_sided):
        return decided_turn_time(decision, inertia, columns)
    return turn_time(inertia, cone.both_signs) if laws != "none" else np.inf
