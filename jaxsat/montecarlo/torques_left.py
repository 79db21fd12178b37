"""What torques failures in flight leave in each case of a study, by controllability."""

import enum
from collections.abc import Mapping

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

from jaxsat.controllability import actuator_set, judge_ranges, torque_reserve
from jaxsat.montecarlo.failure_codes import FAILURES
from jaxsat.simulation import AbstractLoop
from jaxsat.simulation.parts import failures_of, parts_of
from jaxsat.vehicle import Actuators, FailureEvents, FailureKind, ThrusterSet

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


_LEFT = {
    "controllable": TorquesLeft.TWO_TORQUES,
    "by drift": TorquesLeft.BY_DRIFT,
    "some attitudes": TorquesLeft.SOME_ATTITUDES,
    "uncontrollable": TorquesLeft.TOO_FEW,
}
"""By the verdict of a judgement, where no law of three torques can be flown."""

UNRECOVERABLE = tuple(TorquesLeft(code) for code in range(2, 6))


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
    wheels = _wheels_left(loop, struck)
    known: dict[bytes, int] = {}
    found = np.zeros(len(low), int)
    for case in range(len(low)):
        steady = bool(np.any((low[case] > 0) | (high[case] < 0)))
        strength = 1.0 if gain is None or not steady else 1 + gain[case]
        one = (strength * torques[case], low[case], high[case])
        least = SAME_TORQUE * np.abs(one[0]).max(initial=0.0)
        if torque_reserve(*one) > least > 0:
            continue
        key = b"".join(part.tobytes() for part in (*one, wheels[case]))
        if key not in known:
            known[key] = _judged(loop, momentum, *one, wheels[case])
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

    def levels(thruster, kind, amount):
        strikes = kind >= 0
        at = jnp.where(strikes, 0.0, jnp.inf)
        events = FailureEvents(thruster, at, kind, amount, nominal.turned)
        if both:
            gain, level, axes = events.two_signed(strikes, jnp.asarray(torque))
            return axes, level - jnp.abs(gain), level + jnp.abs(gain)
        zero = jnp.zeros(())
        found = events.condition(zero, zero, jnp.asarray(torque))
        return found.torque, found.floor, jnp.maximum(found.gain, found.floor)

    places = struck["failed_part"][:, : nominal.count]
    found = jax.vmap(levels)(*map(jnp.asarray, (1.0 * places, kinds, amounts)))
    torques, low, high = map(np.asarray, found)
    return torques, low, high


def _wheels_left(loop: AbstractLoop, struck: Mapping[str, np.ndarray]) -> np.ndarray:
    """Which wheels (cases, wheels) still make torque as they are asked."""
    wheels = loop.plant.wheels
    left = np.ones((len(struck["failure_kind"]), 0 if wheels is None else wheels.count), bool)
    gone = [FAILURES.index(f"wheel {name}") for name in ("dead", "stopped", "runaway")]
    lost = np.isin(struck["failure_kind"], gone)
    thrusters = thruster_torques_of(loop)[0].shape[1]
    for case, event in np.argwhere(lost):
        left[case, struck["failed_part"][case, event] - thrusters] = False
    return left


def _judged(
    loop: AbstractLoop,
    momentum: np.ndarray,
    torques: np.ndarray,
    low: np.ndarray,
    high: np.ndarray,
    kept: np.ndarray,
) -> int:
    inertia = np.asarray(loop.plant.spacecraft.inertia)
    wheels = loop.plant.wheels
    axes = np.zeros((3, 0)) if wheels is None else np.asarray(wheels.axes)[:, kept]
    actuators = actuator_set(torques, wheel_axes=axes, momentum=momentum)
    judgement = judge_ranges(inertia, actuators, low, high)
    if judgement is not None and judgement.laws == "three torques":
        return TorquesLeft.THREE_AXES
    if loop.plant.magnetorquers is not None:  # what they add changes along the orbit
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
