"""What actuators of several kinds make together under the fault-tolerant law.

Those that cost nothing make what they can of a torque, the others the rest at the least price; and
what stores momentum is relieved of it by what stores none.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.reconfiguration import FLAT, LEAST_SPARE, SMALL
from jaxsat.control.tolerant_actuators import Demand
from jaxsat.core.array_types import BoolScalar, Matrix, RealScalar, Vector
from jaxsat.core.quotients import root
from jaxsat.spacecraft.allocation import allocate, allocate_unloading
from jaxsat.spacecraft.effector import Reach


class MixMemory(NamedTuple):
    """Whether torques about three axes were left, whether momentum was being taken out, and the
    torque (N m) about three axes that all together did not make."""

    three: BoolScalar
    unloads: BoolScalar
    unmade: Vector

    @staticmethod
    def begin() -> "MixMemory":
        """All work, and nothing is full."""
        return MixMemory(jnp.array(True), jnp.array(False), jnp.zeros(3))


class Unloading(NamedTuple):
    """What devices that store no momentum make for those that do.

    Torques (N m): `first` what makes up for all that acts steadily, where that would fill others,
    then `relief`, which takes momentum out of them. Devices that make torques c (N m) may be wrong
    by as much as the root of the sum of the squares of `error` c, over what the body bears; None
    where they are right.
    """

    first: Vector
    relief: Vector
    error: Matrix | None = None

    def part(self, torques: Float[Array, "3 n"]) -> RealScalar:
        """The part of the relief that is made, where all of it takes so many torques."""
        if self.error is None:
            return jnp.ones_like(torques[0, 0])
        return 1 / jnp.maximum(root(jnp.sum((self.error @ torques) ** 2)), 1.0)


class Mix(NamedTuple):
    """What all kinds can do now, each its own.

    Their `reaches`, the torque (N m) of each that makes up for what acts `steady`, which of them
    make torques about `three` axes or settle `alone`, and which store momentum.
    """

    reaches: tuple[Reach, ...]
    steady: tuple[Vector, ...]
    three: tuple[BoolScalar, ...]
    alone: tuple[BoolScalar, ...]
    stores: tuple[bool, ...]

    @property
    def reach(self) -> Reach:
        """That of all together."""
        columns, low, high, price = zip(*self.reaches, strict=True)
        return Reach(
            jnp.concatenate(columns, axis=1),
            jnp.concatenate(low),
            jnp.concatenate(high),
            jnp.concatenate(price),
        )

    def spans(self, before: MixMemory | None) -> BoolScalar:
        """Whether all together make torques about three axes; `before` is None for one kind."""
        if before is None:
            return self.three[0] if self.three else jnp.array(False)
        three = jnp.any(jnp.stack(self.three))
        return jax.lax.cond(three, lambda: jnp.array(True), lambda: self._spans(before.three))

    def _spans(self, held: BoolScalar) -> BoolScalar:
        """By allocation: both ways about each axis, with a part of the largest torque to spare.

        Half of that is enough for what was so before, so that nothing changes to and fro.
        """
        reach = self.reach
        each = jnp.maximum(jnp.abs(reach.low), jnp.abs(reach.high))
        largest = jnp.max(jnp.abs(reach.columns) * each[None], axis=1)
        most = jnp.max(largest)
        spare = LEAST_SPARE * jnp.where(held, 0.5, 1.0)
        ways = jnp.concatenate([jnp.eye(3), -jnp.eye(3)])
        steady = sum(self.steady, jnp.zeros(3))

        def also(way, spans):
            unmade = allocate(reach, steady + spare * ways[way] * largest).unmade
            return spans & (jnp.sum(unmade**2) < (SMALL * most) ** 2)

        first = jnp.all(largest > FLAT * most)
        return jax.lax.fori_loop(0, len(ways), also, first)

    def without(self, axis: Vector) -> "Mix":
        """With nothing that makes up for what acts steadily about a unit `axis`, or zero."""
        return self._replace(steady=tuple(one - axis * (axis @ one) for one in self.steady))

    def demands(
        self,
        torque: Vector,
        unloading: Unloading,
        three: BoolScalar,
    ) -> tuple[list[Demand], Vector]:
        """What each kind is asked for, of a `torque` about three axes if they make one, and what
        all together do not make of that (N m).

        While one kind settles alone, the others make up for what acts all the time at most.
        """
        if len(self.reaches) < 2:
            return [Demand(torque, one, three) for one in self.steady], jnp.zeros(3)
        kinds = zip(self.reaches, self.stores, strict=True)
        stores = jnp.concatenate([jnp.full(one.low.shape, stores) for one, stores in kinds])
        total = torque + sum(self.steady, jnp.zeros(3))
        reach = self.reach
        allocated = allocate_unloading(
            reach,
            total,
            unloading.relief,
            stores,
            unloading.first,
            lambda use: unloading.part(reach.columns * use[None]),
        )
        uses = jnp.split(allocated.use, _ends(self.reaches))
        settled = jnp.stack(self.alone)
        demands = []
        for number, (use, one, steady) in enumerate(
            zip(uses, self.reaches, self.steady, strict=True)
        ):
            others = jnp.any(settled & (jnp.arange(len(settled)) != number)) & ~three
            asked = jnp.where(others, 0.0, torque)
            demands.append(
                Demand(
                    jnp.where(three, one.columns @ use, asked),
                    jnp.where(three, 0.0, steady),
                    three | others,
                    jnp.where(three, use, 0.0),
                )
            )
        return demands, jnp.where(three, allocated.unmade, 0.0)


def _ends(reaches: tuple[Reach, ...]) -> list[int]:
    """Where in a vector of all the uses of one kind end and those of the next begin."""
    ends, place = [], 0
    for one in reaches[:-1]:
        place += one.low.shape[0]
        ends.append(place)
    return ends
