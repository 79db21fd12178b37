"""What torques failures in flight leave in each case of a study, by controllability."""

import enum
from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jaxsat.controllability import actuator_set, judge_ranges, torque_reserve
from jaxsat.simulation import AbstractLoop
from jaxsat.simulation.parts import failures_of, parts_of
from jaxsat.spacecraft import (
    Actuators,
    FailureEvents,
    FailureKind,
    Magnetorquers,
    ThrusterSet,
    Wheels,
)
from jaxsat.studies.failure_codes import FAILURES

SAME_TORQUE = 1e-9
"""Of the largest torque: less than this in every direction is none."""


class TorquesLeft(enum.IntEnum):
    """What the actuators can do once all failures have struck, by `jaxsat.controllability`."""

    THREE_AXES = 0
    TWO_TORQUES = 1
    BY_DRIFT = 2
    SOME_ATTITUDES = 3
    TOO_FEW = 4
    UNOPPOSED_TORQUE = 5
    NOT_DECIDED = 6
    UNHELD_MOMENTUM = 7


_LEFT = {
    "controllable": TorquesLeft.TWO_TORQUES,
    "by drift": TorquesLeft.BY_DRIFT,
    "some attitudes": TorquesLeft.SOME_ATTITUDES,
    "uncontrollable": TorquesLeft.TOO_FEW,
}
"""By the verdict of a judgement, where no law of three torques can be flown."""

UNRECOVERABLE = (*(TorquesLeft(code) for code in range(2, 6)), TorquesLeft.UNHELD_MOMENTUM)

LEAST_TORQUE = 0.1
"""Of the torque of a wheel's motor: one that friction leaves less counts as lost."""

LEAST_HOLD = 0.02
"""Of the largest momentum of a wheel: what others must hold in any direction beside a runaway."""


def torques_left(
    loop: AbstractLoop,
    momentum: Float[np.ndarray, "3"],
    struck: Mapping[str, np.ndarray],
    gain: Float[np.ndarray, "cases m"] | None = None,
) -> Int[np.ndarray, " cases"]:
    """The `TorquesLeft` of every case with the failures `struck`; cases alike are judged once.

    Where failed thrusters make a constant torque, it counts how strong each thruster of a case is:
    relative to the nominal one by 1 + `gain`. Otherwise the torques of the nominal loop decide:
    dispersed ones that are not quite parallel are no more of them. `momentum` (N m s) is that of
    body and wheels at the start.
    """
    torques, low, high = _levels(loop, struck)
    wheels, runaway = _wheels_left(loop, struck)
    known: dict[bytes, int] = {}
    found = np.zeros(len(low), int)
    for case in range(len(low)):
        steady = bool(np.any((low[case] > 0) | (high[case] < 0)))
        strength = 1.0 if gain is None or not steady else 1 + gain[case]
        one = (strength * torques[case], low[case], high[case])
        least = SAME_TORQUE * np.abs(one[0]).max(initial=0.0)
        if torque_reserve(*one) > least > 0:
            continue
        key = b"".join(part.tobytes() for part in (*one, wheels[case], runaway[case]))
        if key not in known:
            held = holds_momentum(loop, wheels[case], runaway[case])
            left = _judged(loop, momentum, *one, wheels[case])
            known[key] = left if held else int(TorquesLeft.UNHELD_MOMENTUM)
        found[case] = known[key]
    return found


def _levels(
    loop: AbstractLoop, struck: Mapping[str, np.ndarray]
) -> tuple[
    Float[np.ndarray, "cases 3 m"], Float[np.ndarray, "cases m"], Float[np.ndarray, "cases m"]
]:
    """Torques (N m) of all thrusters at level 1, and between which levels they can be."""
    torque, both = thruster_torques_of(loop)
    cases = len(struck["failure_kind"])
    events = [one for one in failures_of(loop) if isinstance(one, FailureEvents)]
    if not events:
        high = np.ones((cases, torque.shape[1]))
        return np.tile(torque, (cases, 1, 1)), (-high if both else 0 * high), high
    (nominal,) = events
    kinds = struck["failure_kind"][:, : nominal.count] - 1.0
    # One that works now and then can be used all the same.
    now_and_then = kinds == FailureKind.INTERMITTENT
    kinds = np.where(now_and_then, float(FailureKind.DELAYED), kinds)
    amounts = np.nan_to_num(struck["failure_amount"][:, : nominal.count])
    at = np.where(kinds >= 0, struck["failure_time"][:, : nominal.count], np.inf)

    def levels(thruster, at, kind, amount):
        events = FailureEvents(thruster, at, kind, amount, nominal.turned, nominal.partner)
        if both:
            gain, level, axes = events.two_signed(kind >= 0, jnp.asarray(torque))
            return axes, level - jnp.abs(gain), level + jnp.abs(gain)
        end = jnp.max(jnp.where(kind >= 0, at, 0.0))
        found = events.condition(end, 0 * end, jnp.asarray(torque))
        return found.torque, found.floor, jnp.maximum(found.gain, found.floor)

    places = struck["failed_part"][:, : nominal.count]
    found = jax.vmap(levels)(*map(jnp.asarray, (1.0 * places, at, kinds, amounts)))
    torques, low, high = map(np.asarray, found)
    return torques, low, high


def _wheels_left(
    loop: AbstractLoop, struck: Mapping[str, np.ndarray]
) -> tuple[np.ndarray, np.ndarray]:
    """Which wheels (cases, wheels) still make torque as they are asked, and which run away.

    A motor that friction leaves no torque to spare is lost. So is a wheel that had failed before,
    as a law that commands each wheel knows.
    """
    wheels = loop.plant.find(Wheels)
    left = np.ones((len(struck["failure_kind"]), 0 if wheels is None else wheels.count), bool)
    runaway = np.zeros_like(left)
    if wheels is None:
        return left, runaway
    known = getattr(getattr(loop, "controller", None), "known", None)
    if known is not None:
        left[:, np.asarray(known)] = False
    dead, stopped, runs, rubs = (
        FAILURES.index(f"wheel {name}") for name in ("dead", "stopped", "runaway", "friction to")
    )
    full = np.inf if wheels.torque_limit is None else np.asarray(wheels.torque_limit)
    full = np.broadcast_to(full, (wheels.count,))
    thrusters = thruster_torques_of(loop)[0].shape[1]
    kinds, amounts = struck["failure_kind"], struck["failure_amount"]
    sound = left.copy()
    order = np.argsort(struck["failure_time"], axis=1, kind="stable")
    for case, event in ((case, event) for case, row in enumerate(order) for event in row):
        place, kind = struck["failed_part"][case, event] - thrusters, kinds[case, event]
        if kind < dead or place >= wheels.count:
            continue
        stuck = kind == rubs and amounts[case, event] > (1 - LEAST_TORQUE) * full[place]
        lost = stuck or kind in (dead, stopped, runs)
        left[case, place] = sound[case, place] and not lost
        runaway[case, place] = kind == runs
    return left, runaway


def holds_momentum(loop: AbstractLoop, kept: np.ndarray, runaway: np.ndarray) -> bool:
    """Whether the wheels kept can hold what those that run away take up, and some in any direction.

    A runaway ends at its largest momentum, of either sign. Thrusters and magnetorquers can take
    momentum out.
    """
    wheels = loop.plant.find(Wheels)
    others = thruster_torques_of(loop)[0].shape[1] or loop.plant.find(Magnetorquers) is not None
    if wheels is None or others or not runaway.any():
        return True
    limit = wheels.momentum_limit
    if limit is None or not np.all(np.isfinite(np.asarray(limit)[runaway])):
        return False
    most = np.asarray(limit)
    most = np.minimum(most, 1e6 * most[runaway].max())
    high = np.where(kept | runaway, most, 0.0)
    low = np.where(runaway, most, -high)
    reserve = torque_reserve(np.asarray(wheels.axes), low, high)
    return bool(reserve > LEAST_HOLD * most[kept].max(initial=0.0))


def _judged(
    loop: AbstractLoop,
    momentum: np.ndarray,
    torques: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    kept: np.ndarray,
) -> int:
    inertia = np.asarray(loop.plant.spacecraft.inertia)
    wheels = loop.plant.find(Wheels)
    axes, rotors = np.zeros((3, 0)), None
    if wheels is not None:
        axes = np.asarray(wheels.axes)[:, kept]
        known = wheels.rotor_inertia
        rotors = None if known is None else np.asarray(known)[kept]
    actuators = actuator_set(torques, wheel_axes=axes, momentum=momentum, rotors=rotors)
    judgement = judge_ranges(inertia, actuators, low, high)
    if judgement is not None and judgement.laws == "three torques":
        return TorquesLeft.THREE_AXES
    if loop.plant.find(Magnetorquers) is not None:  # what they add changes along the orbit
        return TorquesLeft.NOT_DECIDED
    if judgement is None:
        return TorquesLeft.UNOPPOSED_TORQUE
    return _LEFT.get(judgement.verdict, TorquesLeft.NOT_DECIDED)


def thruster_torques_of(loop: AbstractLoop) -> tuple[Float[np.ndarray, "3 m"], bool]:
    """Torques (N m) of all thrusters of a loop, and whether they have both signs."""
    actuators = getattr(loop, "actuators", None)
    for thrusters in parts_of(ThrusterSet, actuators):
        return np.asarray(thrusters.torque), False
    for thrusters in parts_of(Actuators, actuators):
        return np.asarray(thrusters.torque_axes), True
    return np.zeros((3, 0)), False
