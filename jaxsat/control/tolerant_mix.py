"""Joint allocation of actuators of several kinds under the fault-tolerant law.

Free actuators make what they can of a torque, the others the rest at the lowest price; actuators
without momentum unload those that store it.
"""

from typing import NamedTuple

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from jaxsat.control.reconfiguration import FLAT, LEAST_SPARE, SMALL
from jaxsat.control.tolerant_actuators import Demand
from jaxsat.core.array_types import BoolScalar, Matrix, RealScalar, Vector
from jaxsat.core.quotients import root
from jaxsat.spacecraft.allocation import MomentumPrice, allocate, allocate_unloading
from jaxsat.spacecraft.effector import Reach


class MixMemory(NamedTuple):
    """Memory of the mix: whether `three` axes were driven, whether it `unloads` momentum, and the
    torque (N m) about three axes that all kinds together failed to make."""

    three: BoolScalar
    unloads: BoolScalar
    unmade: Vector

    @staticmethod
    def begin() -> "MixMemory":
        """Return the memory at the start: three axes, no unloading."""
        return MixMemory(jnp.array(True), jnp.array(False), jnp.zeros(3))


class Unloading(NamedTuple):
    """Unloading of momentum by actuators that store none.

    Torques (N m): `first` opposes steady torques that would fill other actuators, then `relief`
    takes momentum out of them. Torques c (N m) may be wrong by the norm of `error` c, relative to
    the error that the body tolerates; None where they are exact.
    """

    first: Vector
    relief: Vector
    error: Matrix | None = None

    def part(self, torques: Float[Array, "3 n"]) -> RealScalar:
        """Return the fraction of the relief that is made, where all of it takes `torques` (N m)."""
        if self.error is None:
            return jnp.ones_like(torques[0, 0])
        return 1 / jnp.maximum(root(jnp.sum((self.error @ torques) ** 2)), 1.0)


class Mix(NamedTuple):
    """Capabilities of all kinds of actuators at one sample.

    `reaches` are their ranges, `steady` the torques (N m) against constant disturbances. `three`:
    which drive three axes; `alone`: which settle alone; `stores`: which store momentum. `momentum`
    has the price of momentum of each kind, used where the kinds that store none do not drive three
    axes: there is a direction in which they cannot take momentum out.
    """

    reaches: tuple[Reach, ...]
    steady: tuple[Vector, ...]
    three: tuple[BoolScalar, ...]
    alone: tuple[BoolScalar, ...]
    stores: tuple[bool, ...]
    momentum: tuple[MomentumPrice, ...]

    @property
    def reach(self) -> Reach:
        """The range of all kinds together."""
        columns, low, high, price = zip(*self.reaches, strict=True)
        return Reach(
            jnp.concatenate(columns, axis=1),
            jnp.concatenate(low),
            jnp.concatenate(high),
            jnp.concatenate(price),
        )

    def spans(self, before: MixMemory | None) -> BoolScalar:
        """Whether all kinds together drive three axes; `before` is None for one kind."""
        if before is None:
            return self.three[0] if self.three else jnp.array(False)
        three = jnp.any(jnp.stack(self.three))
        return jax.lax.cond(three, lambda: jnp.array(True), lambda: self._spans(before.three))

    def _spans(self, had_three: BoolScalar) -> BoolScalar:
        """Test by allocation: each axis both ways, with a share of the largest torque to spare.

        Half that margin suffices where three axes were driven before.
        """
        reach = self.reach._replace(price=None)
        each = jnp.maximum(jnp.abs(reach.low), jnp.abs(reach.high))
        largest = jnp.max(jnp.abs(reach.columns) * each[None], axis=1)
        most = jnp.max(largest)
        spare = LEAST_SPARE * jnp.where(had_three, 0.5, 1.0)
        ways = jnp.concatenate([jnp.eye(3), -jnp.eye(3)])
        steady = sum(self.steady, jnp.zeros(3))

        def also(way, spans):
            unmade = allocate(reach, steady + spare * ways[way] * largest).unmade
            return spans & (jnp.sum(unmade**2) < (SMALL * most) ** 2)

        first = jnp.all(largest > FLAT * most)
        return jax.lax.fori_loop(0, len(ways), also, first)

    def without(self, axis: Vector) -> "Mix":
        """Return the mix without steady torques about a unit `axis`, or unchanged for zero."""
        return self._replace(steady=tuple(one - axis * (axis @ one) for one in self.steady))

    def demands(
        self,
        torque: Vector,
        unloading: Unloading,
        three: BoolScalar,
    ) -> tuple[list[Demand], Vector]:
        """Return the demand on each kind for a `torque` (N m), about three axes if they are driven,
        and the part (N m) that all together fail to make.

        While one kind settles alone, the others at most oppose steady torques.
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
            self._momentum_price(),
        )
        uses = jnp.split(allocated.use, _ends(self.reaches))
        settled = jnp.stack(self.alone)
        demands = []
        for number, (use, one, steady) in enumerate(
            zip(uses, self.reaches, self.steady, strict=True)
        ):
            others = jnp.any(settled & (jnp.arange(len(settled)) != number)) & ~three
            kind_torque = jnp.where(others, 0.0, torque)
            demands.append(
                Demand(
                    jnp.where(three, one.columns @ use, kind_torque),
                    jnp.where(three, 0.0, steady),
                    three | others,
                    jnp.where(three, use, 0.0),
                )
            )
        return demands, jnp.where(three, allocated.unmade, 0.0)

    def _momentum_price(self) -> MomentumPrice:
        """Return the price of momentum of all kinds together."""
        kinds = zip(self.three, self.stores, strict=True)
        empties = jnp.any(jnp.stack([three for three, stores in kinds if not stores]))
        shares, price = (jnp.concatenate(one) for one in zip(*self.momentum, strict=True))
        return MomentumPrice(shares, jnp.where(empties, 0.0, price))


def _ends(reaches: tuple[Reach, ...]) -> list[int]:
    """Return the indices at which a vector of all commands splits into kinds."""
    ends, place = [], 0
    for one in reaches[:-1]:
        place += one.low.shape[0]
        ends.append(place)
    return ends
