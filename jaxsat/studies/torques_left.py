"""Torques that remain after failures in flight in each case of a study, by controllability."""

import dataclasses
from collections.abc import Mapping
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxsat.compiler.llvm.mapped import compiled_over_cases
from jaxsat.control.flyable_laws import Laws
from jaxsat.controllability.actuators import actuator_set
from jaxsat.controllability.layout import TOLERANCE
from jaxsat.controllability.programme import UnsolvedProgramme
from jaxsat.controllability.rods import judge_with_rods
from jaxsat.controllability.torque_ranges import judge_ranges, torque_reserve
from jaxsat.core.attitude import Quaternion
from jaxsat.simulation.loops import AbstractLoop
from jaxsat.simulation.trajectory import ExplainedCode
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.effector import AbstractEffector, Reach, Storage
from jaxsat.studies.failure_codes import NEVER, first_code
from jaxsat.studies.momentum_left import Held
from jaxsat.studies.rods_left import (
    LEAST_HOLD,
    RodsLeft,
    ThrustersLeft,
    law_uses_rods,
    rod_set,
    sampled_law,
    wheels_hold_turned,
)

SAME_TORQUE = 1e-9
"""Torque that is treated as zero, relative to the largest torque."""


class TorquesLeft(ExplainedCode):
    """Capability of the actuators after all failures, by `jaxsat.controllability`."""

    THREE_AXES = 0, "torques about three axes are left"
    TWO_TORQUES = 1, "two torques are left, controllable"
    BY_DRIFT = 2, "controllable in principle, which no law uses"
    SOME_ATTITUDES = 3, "two wheels with momentum are left, which hold some attitudes"
    TOO_FEW = 4, "too few torques are left: not controllable"
    UNOPPOSED_TORQUE = 5, "nothing opposes the torque of a failed actuator with a margin"
    NOT_DECIDED = 6, "controllability of the remaining actuators is not decided"
    UNHELD_MOMENTUM = 7, "wheels cannot hold the momentum of a runaway or of a stuck magnetorquer"
    MAGNETIC = 8, "magnetorquers control all axes over an orbit"
    UNHELD_ATTITUDE = 9, "two wheels cannot hold the target against torque and momentum"


_LEFT: Mapping[Laws, TorquesLeft] = {
    "three torques": TorquesLeft.THREE_AXES,
    "two torques": TorquesLeft.TWO_TORQUES,
    "two wheels": TorquesLeft.TWO_TORQUES,
    "magnetic": TorquesLeft.MAGNETIC,
}
"""Code by the laws of a judgement that reach every attitude."""

_UNFLOWN = {
    "controllable": TorquesLeft.BY_DRIFT,
    "by drift": TorquesLeft.BY_DRIFT,
    "some attitudes": TorquesLeft.SOME_ATTITUDES,
    "uncontrollable": TorquesLeft.TOO_FEW,
}
"""Code by the verdict of a judgement without such laws."""

UNRECOVERABLE = (
    *(TorquesLeft(code) for code in range(2, 6)),
    TorquesLeft.UNHELD_MOMENTUM,
    TorquesLeft.UNHELD_ATTITUDE,
)

LEAST_TORQUE = 0.1
"""Smallest share of the healthy torque with which a wheel or gyro is not treated as lost."""


class _Reaches(NamedTuple):
    """Reach of a part in every case: see `Reach`; `most` is `high` before any failure."""

    columns: Float[np.ndarray, "cases 3 n"]
    low: Float[np.ndarray, "cases n"]
    high: Float[np.ndarray, "cases n"]
    most: Float[np.ndarray, " n"]

    @staticmethod
    def of(reach: Reach, cases: int) -> "_Reaches":
        """Return a part's reach that is the same in this number of cases."""
        columns, low, high = map(np.asarray, (reach.columns, reach.low, reach.high))
        each = [np.broadcast_to(part, (cases, *part.shape)) for part in (columns, low, high)]
        return _Reaches(each[0], each[1], each[2], high)

    @property
    def healthy(self) -> Bool[np.ndarray, "cases n"]:
        """Mask of devices that follow commands of either sign, with nearly full torque."""
        return (self.low < 0) & (self.high > 0) & (self.high >= LEAST_TORQUE * self.most)


class _Exchanger(NamedTuple):
    """An effector that stores momentum, in one case or, with a leading axis, in all.

    The fields are unit `columns` of reach, a mask of `healthy` devices, which follow their
    commands, and a mask of runaways.
    """

    storage: Storage
    columns: Float[np.ndarray, "*cases 3 k"]
    healthy: Bool[np.ndarray, "*cases k"]
    runaway: Bool[np.ndarray, "*cases k"]

    @staticmethod
    def of(loop: AbstractLoop, effector: AbstractEffector, reach: _Reaches) -> "_Exchanger | None":
        """Return an effector by its reach in every case, None for one that stores no momentum.

        A wheel that the law knows as failed is lost.
        """
        storage = effector.storage()
        if storage is None:
            return None
        size = np.linalg.norm(reach.columns, axis=1, keepdims=True)
        healthy = reach.healthy & (size[:, 0] > 0)
        law = sampled_law(loop)
        if law is not None and law.known is not None:
            healthy[:, np.asarray(law.known)] = False
        runaway = (reach.low == reach.high) & (reach.high != 0)
        columns = reach.columns / np.where(size > 0, size, 1.0)
        return _Exchanger(Storage(*map(np.asarray, storage)), columns, healthy, runaway)

    def case(self, number: int) -> "_Exchanger":
        """Return the effector in one case."""
        return _Exchanger(self.storage, *(part[number] for part in self[1:]))


def torques_left(
    loop: AbstractLoop,
    momentum: Float[np.ndarray, "3"],
    failures: Mapping[str, np.ndarray],
    gain: Float[np.ndarray, "cases m"] | None = None,
    hold: Held | None = None,
) -> Int[np.ndarray, " cases"]:
    """Return the `TorquesLeft` of every case with its `failures`, by column; equal cases share one.

    If failed thrusters make a constant torque, the strength of each thruster of a case counts:
    relative to the nominal one by 1 + `gain`. Otherwise the torques of the nominal loop decide:
    dispersed axes that are not quite parallel add no independent torque. `momentum` (N m s) is that
    of body and effectors at the start. If two wheels alone remain where no thrusters were, the
    tolerances in `hold` and the momentum of each case decide whether they hold the target.
    """
    parts = list(zip(loop.plant.effectors, _reaches_left(loop, failures), strict=True))
    none = _Reaches.of(Reach.none(), len(failures["failure_kind"]))
    levels = [_levels(none), *(_levels(each) for one, each in parts if _pushes(one))]
    torques, low, high = (np.concatenate(each, axis=-1) for each in zip(*levels, strict=True))
    exchangers = [each for one in parts if (each := _Exchanger.of(loop, *one)) is not None]
    rods = _rods_left(loop, parts, failures)
    tolerance = np.inf if hold is None else hold.angle
    strengths = np.ones(low.shape)  # the thrusters come first
    if gain is not None:
        strengths[:, : gain.shape[1]] += gain
    codes_by_key: dict[bytes, tuple[int, np.ndarray | None]] = {}
    codes = np.zeros(len(low), int)
    for case in range(len(low)):
        steady = bool(np.any((low[case] > 0) | (high[case] < 0)))
        strength = strengths[case] if steady else 1.0
        one = ThrustersLeft(strength * torques[case], low[case], high[case])
        least = SAME_TORQUE * np.abs(one.torques).max(initial=0.0)
        if torque_reserve(*one) > least > 0:
            continue
        here = [each.case(case) for each in exchangers]
        parts, magnetic = [part for each in here for part in each[1:]], rods.case(case)
        key = b"".join(part.tobytes() for part in (*one, *parts, magnetic.healthy, magnetic.stuck))
        if key not in codes_by_key:
            codes_by_key[key] = int(TorquesLeft.UNHELD_MOMENTUM), None
            if all(_holds_momentum(loop, each) for each in here):
                codes_by_key[key] = _judge(loop, momentum, one, here, magnetic, tolerance)
        code, normal = codes_by_key[key]
        if normal is not None and hold is not None:
            struck = failures["failure_kind"][case] != NEVER
            last = failures["failure_time"][case][struck].max(initial=0.0)
            code = _by_two_wheels(hold, case, normal, last)
        if code == TorquesLeft.THREE_AXES and hold is not None:
            code = _by_load(magnetic, here, one, hold, case)
        codes[case] = code
    return codes


def _pushes(one: AbstractEffector) -> bool:
    """Whether an effector makes torques as thrusters do, not by stored momentum or a dipole."""
    return bool(one.command_size) and one.storage() is None and one.dipoles() is None


def _rods_left(
    loop: AbstractLoop,
    parts: list[tuple[AbstractEffector, _Reaches]],
    failures: Mapping[str, np.ndarray],
) -> RodsLeft:
    """Magnetorquers in every case, by the reach of all effectors and the failures."""
    before, none = 0, np.zeros((len(failures["failure_kind"]), 0))
    for one, reach in parts:
        if (dipoles := one.dipoles()) is not None:
            hit = failures["failed_part"][:, None] == before + np.arange(one.count)[:, None]
            hit &= (failures["failure_kind"] != NEVER)[:, None]
            since = np.where(hit, failures["failure_time"][:, None], np.inf).min(
                axis=2, initial=np.inf
            )
            stuck = np.where(reach.low == reach.high, reach.high, 0.0)
            return RodsLeft(rod_set(loop, dipoles), reach.healthy, stuck, reach.high, since)
        before += one.count
    return RodsLeft(None, none.astype(bool), none, none, none)


def _wheels(here: list[_Exchanger]) -> tuple[Float[np.ndarray, "3 m"], Float[np.ndarray, " m"]]:
    """Axes and capacities (N m s) of the healthy wheels of one case."""
    axes = [np.zeros((3, 0)), *(one.columns[:, one.healthy] for one in here)]
    limits = [np.zeros(0), *(one.storage.capacity[one.healthy] for one in here)]
    return np.concatenate(axes, axis=1), np.concatenate(limits)


def _by_load(
    magnetic: RodsLeft, here: list[_Exchanger], beside: ThrustersLeft, hold: Held, case: int
) -> int:
    """Code for three torques beside stuck magnetorquers, whose momentum wheels must hold."""
    try:
        load = magnetic.load(*_wheels(here), beside, hold, case)
    except UnsolvedProgramme:
        return TorquesLeft.NOT_DECIDED
    return TorquesLeft.UNHELD_MOMENTUM if load > 1 - LEAST_HOLD else TorquesLeft.THREE_AXES


def _by_two_wheels(hold: Held, case: int, normal: np.ndarray, last: float) -> int:
    """Code for two wheels with this `normal` after the `last` failure (s)."""
    if hold.holds(case, normal, last):
        return TorquesLeft.TWO_TORQUES
    return TorquesLeft.SOME_ATTITUDES if hold.free else TorquesLeft.UNHELD_ATTITUDE


def _reaches_left(loop: AbstractLoop, failures: Mapping[str, np.ndarray]) -> list[_Reaches]:
    """Reach of each effector at rest in every case, after all failures.

    Failures are ordered by effector; the last effector may have more than its own number.
    """
    reaches, before, cases = [], 0, len(failures["failure_kind"])
    last = [one for one in loop.plant.effectors if one.failures is not None][-1:]
    for one in loop.plant.effectors:
        if one.failures is None:
            reaches.append(_Reaches.of(reach_at_rest(one, jnp.zeros(0, bool)), cases))
        else:
            count = None if one is last[0] else one.failures.count
            own = {name: x[:, :count] for name, x in failures.items()}
            reaches.append(_in_cases(one, before, own))
            failures = {name: x[:, count:] for name, x in failures.items()}
        before += one.count
    return reaches


def reach_at_rest(one: AbstractEffector, hit: Bool[Array, " f"]) -> Reach:
    """Return the reach of an effector at rest in the target attitude, after the failures `hit`."""
    zero, level = jnp.zeros(()), Quaternion(jnp.array([1.0, 0.0, 0.0, 0.0]))
    return one.reach(zero, PlantState(level, jnp.zeros(3)), one.init(), hit, zero)


def _in_cases(one: AbstractEffector, before: int, failures: Mapping[str, np.ndarray]) -> _Reaches:
    """Reach of an effector in every case; `before` devices precede its own.

    The `failures` number devices over all effectors. An additional case has none.
    """
    place = failures["failed_part"] - before
    mine = (failures["failure_kind"] != NEVER) & (place >= 0) & (place < one.count)
    kinds = np.where(mine, failures["failure_kind"] - first_code(one.failures.kinds), -1)

    def reach(case, _):
        number, at, kind, amount = case
        events = dataclasses.replace(one.failures, number=number, at=at, kind=kind, amount=amount)
        return reach_at_rest(eqx.tree_at(lambda x: x.failures, one, events), kind >= 0)

    at = np.where(mine, failures["failure_time"], np.inf)
    columns = (1.0 * place, at, 1.0 * kinds, np.nan_to_num(failures["failure_amount"]))
    none = (-1.0, np.inf, -1.0, 0.0)
    numbers = tuple(
        np.concatenate([column, np.full((1, place.shape[1]), fill)])
        for column, fill in zip(columns, none, strict=True)
    )
    reaches = compiled_over_cases(reach, tuple(column[0] for column in numbers))(numbers)
    torques, low, high = map(np.asarray, (reaches.columns, reaches.low, reaches.high))
    return _Reaches(torques[:-1], low[:-1], high[:-1], high[-1])


def _levels(
    reach: _Reaches,
) -> tuple[
    Float[np.ndarray, "cases 3 m"], Float[np.ndarray, "cases m"], Float[np.ndarray, "cases m"]
]:
    """Torques (N m) of all thrusters at level 1, and the limits of their levels.

    Level 1 is the full torque before any failure, 1 N m for a thruster without a limit.
    """
    full = np.where(np.isfinite(reach.most) & (reach.most > 0), reach.most, 1.0)
    low, high = (np.clip(one / full, -1.0, 1.0) for one in (reach.low, reach.high))
    return reach.columns * full, low, high


def _holds_momentum(loop: AbstractLoop, here: _Exchanger) -> bool:
    """Whether healthy wheels can hold the momentum of runaway ones, with a reserve in all
    directions.

    A runaway ends at its largest momentum, of either sign. External torque can unload momentum.
    """
    healthy, runaway = here.healthy, here.runaway
    outside = any(one.storage() is None and one.command_size for one in loop.plant.effectors)
    if not runaway.any() or outside:
        return True
    most = here.storage.capacity
    if not np.all(np.isfinite(most[runaway])):
        return False
    most = np.minimum(most, 1e6 * most[runaway].max())
    high = np.where(healthy | runaway, most, 0.0)
    low = np.where(runaway, most, -high)
    reserve = torque_reserve(here.columns, low, high)
    return bool(reserve > LEAST_HOLD * most[healthy].max(initial=0.0))


def _turns_runaways(loop: AbstractLoop, here: list[_Exchanger]) -> bool:
    """Whether healthy wheels beside magnetorquers tolerate the momentum of runaway ones."""
    most = [one.storage.capacity for one in here]
    runaway = [one.columns * limit for one, limit in zip(here, most, strict=True)]
    lost = [columns[:, one.runaway] for one, columns in zip(here, runaway, strict=True)]
    least = float(_wheels(here)[1].min(initial=np.inf))
    return wheels_hold_turned(loop, np.concatenate([np.zeros((3, 0)), *lost], axis=1), least)


def _judge(
    loop: AbstractLoop,
    momentum: np.ndarray,
    thrusters: ThrustersLeft,
    here: list[_Exchanger],
    magnetic: RodsLeft,
    tolerance: float,
) -> tuple[int, np.ndarray | None]:
    """Return the result of `_judge_case`, not decided where a linear programme is not solved."""
    try:
        return _judge_case(loop, momentum, thrusters, here, magnetic, tolerance)
    except UnsolvedProgramme:
        return TorquesLeft.NOT_DECIDED, None


def _judge_case(
    loop: AbstractLoop,
    momentum: np.ndarray,
    thrusters: ThrustersLeft,
    here: list[_Exchanger],
    magnetic: RodsLeft,
    tolerance: float,
) -> tuple[int, np.ndarray | None]:
    """Code, and the normal of two wheels if they alone remain, and no thruster was beside them.

    `tolerance` (rad) is that of the attitude.
    """
    inertia = np.asarray(loop.plant.spacecraft.inertia)
    axes, capacity = _wheels(here)
    rotors = np.concatenate([np.zeros(0), *(one.storage.rotors[one.healthy] for one in here)])
    turns = float(np.asarray(loop.plant.orbit.rate)) != 0
    actuators = actuator_set(
        thrusters.torques, wheel_axes=axes, momentum=momentum, rotors=rotors, target_turns=turns
    )
    judgement = judge_ranges(inertia, actuators, thrusters.low, thrusters.high)
    if judgement is not None and judgement.laws == "three torques":
        return _LEFT[judgement.laws], None
    if any(one.columns_change and one.dipoles() is None for one in loop.plant.effectors):
        return TorquesLeft.NOT_DECIDED, None
    if judgement is None:
        return TorquesLeft.UNOPPOSED_TORQUE, None
    rods, healthy = magnetic.rods, magnetic.healthy
    if rods is not None:
        judgement = judge_with_rods(judgement, rods, np.flatnonzero(healthy).tolist(), TOLERANCE)
    if judgement.without_rods is not None and not law_uses_rods(loop, axes, healthy):
        judgement = judgement.without_rods
    if judgement.laws == "magnetic" and magnetic.opposed(judgement, capacity, tolerance) < 1:
        return TorquesLeft.UNOPPOSED_TORQUE, None
    if judgement.laws == "magnetic" and judgement.verdict == "controllable":
        steady = _turns_runaways(loop, here)
        return _LEFT[judgement.laws] if steady else TorquesLeft.UNHELD_MOMENTUM, None
    if judgement.verdict == "borderline":
        return TorquesLeft.NOT_DECIDED, None
    # Thrusters have changed the momentum before, by what only the flight tells.
    pushed = any(map(_pushes, loop.plant.effectors))
    if judgement.laws == "nearest attitude" or (judgement.laws == "two wheels" and pushed):
        code = TorquesLeft.SOME_ATTITUDES
    elif judgement.laws == "two torques" and not _flies_planes(loop):
        code = TorquesLeft.BY_DRIFT
    else:
        unflown = _UNFLOWN.get(judgement.verdict, TorquesLeft.NOT_DECIDED)
        code = _LEFT.get(judgement.laws, unflown)
    wheels, normal = judgement.level_set, None
    if wheels is not None and wheels.axes == 2 and wheels.rests and not pushed:
        normal = wheels.missing[:, 0]
    return code, normal


def _flies_planes(loop: AbstractLoop) -> bool:
    """Whether the law flies by thrusters in a plane. One that diagnoses wheels does not beside
    those that worked at the start: they keep momentum, which no law of two torques models."""
    law = sampled_law(loop)
    return law is None or law.known is None or bool(np.all(law.known))
