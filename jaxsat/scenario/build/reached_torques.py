"""Torques at the start by the reach of every effector, for actuators that no verdict counts."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from types import SimpleNamespace
from typing import NamedTuple

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float

from jaxsat.controllability.torque_ranges import torque_reserve
from jaxsat.core.declaration.actuator import ActuatorDeclaration
from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.declaration.failures import AbstractFailureKind
from jaxsat.core.text import capitalised, number_text
from jaxsat.scenario.build.actuator_set import UNCOUNTED
from jaxsat.scenario.build.plant import effector_context
from jaxsat.scenario.build.run import build_uncontrolled
from jaxsat.scenario.parts.torque_makers import working_torques
from jaxsat.scenario.schema import Scenario
from jaxsat.spacecraft.effector import Reach

NOTHING = 1e-9
"""Torque that counts as zero, relative to the largest one."""

UNBOUNDED = 1e6
"""Limit of a device without one, in the unit of its use."""

Failure = tuple[int, AbstractFailureKind]
"""Number of a device, from 0, and the kind of its failure."""


@dataclass(frozen=True)
class ReachedTorques:
    """Torques that all working actuators make at the start, and after one more failure.

    `kinds` are those that no other verdict counts, `reserve` is the torque (N m) that can be made
    about every axis, zero without, and `axes` the number of independent torques. `after` has the
    reserves after the failure of each device, by the kind of device and the text of the failure.
    """

    kinds: tuple[str, ...]
    reserve: float
    axes: int
    after: dict[tuple[str, str], list[float]]

    def verdict(self) -> str:
        """Return the verdict as one sentence."""
        if self.reserve:
            return (
                f"Controllable: {' and '.join(self.kinds)} included, actuators make at least "
                f"{number_text(self.reserve, 3)} N m about any axis at the start."
            )
        number = ("no torque", "one torque", "two torques", "three torques, but not all signs,")
        return (
            f"Not decided: {' and '.join(self.kinds)} included, actuators make "
            f"{number[self.axes]} at the start."
        )

    def lines(self) -> list[str]:
        """Return a line for every kind of failure without an amount: what it leaves."""
        lines = []
        for (kind, word), reserves in self.after.items():
            three = [one for one in reserves if one]
            text = f"{len(three)} of {len(reserves)} cases leave three torques"
            if three:
                text += f", the worst {number_text(min(three), 3)} N m about some axis at the start"
            lines.append(f"{capitalised(kind)} (not in the table), one more {word}: {text}")
        return lines


def reached_torques(
    scenario: Scenario, kinds: Sequence[ActuatorDeclaration] = UNCOUNTED
) -> ReachedTorques | None:
    """Return the torques at the start with those of `kinds`; None without devices of them.

    Other kinds count as far as they work at the start.
    """
    kinds = [one for one in kinds if getattr(scenario, one.name)]
    if not kinds:
        return None
    loop, start = build_uncontrolled(scenario)
    zero = jnp.zeros(())

    def reach(kind: ActuatorDeclaration, *more: Failure) -> _Bounds:
        devices = getattr(scenario, kind.name)
        failed = [(n, _lost(kind)) for n, one in enumerate(devices) if one.failed]
        tables = tuple(
            (number, SimpleNamespace(at_s=0.0, kind=one.text, **dict.fromkeys(one.keys)))
            for number, one in (*failed, *more)
        )
        effector, state = kind.from_tables(devices, effector_context(scenario, tables))
        return _bounds(effector.reach(zero, start, state, jnp.ones(len(tables), bool), zero))

    pushes = working_torques(scenario.thruster)
    sides = np.ones(pushes.shape[1])
    thrusters = _Bounds(pushes, 0 * sides, sides)
    if not scenario.thruster:
        ideal = loop.plant.effectors[0]
        thrusters = _bounds(ideal.reach(zero, start, None, jnp.zeros(0, bool), zero))
    present = [one for one in ACTUATORS if one.maker and getattr(scenario, one.name)]
    parts = {"": thrusters} | {one.name: reach(one) for one in present}
    after = {
        (f"{kind.called}s", one.word): [
            _reserve(parts | {kind.name: reach(kind, (number, one))})
            for number, table in enumerate(getattr(scenario, kind.name))
            if not table.failed
        ]
        for kind in kinds
        for one in kind.kinds
        if not one.amounts
    }
    ranges = np.concatenate([x.columns * (x.high - x.low) for x in parts.values()], axis=1)
    names = tuple(f"{one.called}s" for one in kinds)
    return ReachedTorques(names, _reserve(parts), int(np.linalg.matrix_rank(ranges)), after)


class _Bounds(NamedTuple):
    """A `Reach` in NumPy."""

    columns: Float[np.ndarray, "3 n"]
    low: Float[np.ndarray, " n"]
    high: Float[np.ndarray, " n"]


def _bounds(reach: Reach) -> _Bounds:
    """Return a reach with finite limits: `UNBOUNDED` for a device without one."""
    low, high = (np.clip(x, -UNBOUNDED, UNBOUNDED) for x in (reach.low, reach.high))
    return _Bounds(np.asarray(reach.columns), low, high)


def _reserve(parts: Mapping[str, _Bounds]) -> float:
    """Return the torque (N m) that all parts make about every axis, zero if there is none."""
    fields = zip(*parts.values(), strict=True)
    torques, low, high = (np.concatenate(each, axis=-1) for each in fields)
    full = np.abs(torques * np.maximum(np.abs(low), np.abs(high))).max(initial=0.0)
    value = torque_reserve(torques, low, high) if full else 0.0
    return value if value > NOTHING * full else 0.0


def _lost(kind: ActuatorDeclaration) -> AbstractFailureKind:
    """Kind of failure that a device has which failed before the start: the first without effect."""
    return next((one for one in kind.idle if not one.amounts), kind.kinds[0])
