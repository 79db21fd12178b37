"""Remaining capability of thrusters after failures, tabled at the law's construction."""

import enum
import itertools
from typing import Annotated, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxsat.control.diagnosis.diagnosis import WEAK
from jaxsat.control.diagnosis.residual import ActuatorCondition
from jaxsat.core.allocation import (
    largest_torque,
    torque_directions,
    two_sided_torques,
    unit_columns,
)
from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.core.checks import as_array, as_float
from jaxsat.spacecraft.least_propellant import LeastPropellant

MOST_FAILED = 2
"""Largest number of failed thrusters in a tabled set."""

MOST_SETS = 150
"""Largest number of tabled sets; if all pairs exceed it, only single failures are tabled."""

FLAT = 1e-9
"""Relative tolerance on the rank of torques, with respect to the largest torque."""

SMALL = 1e-6
"""Largest missing torque that is treated as zero, relative to the largest torque."""

SPARE, LEAST_SPARE = 0.1, 0.02
"""Torque that must remain both ways about each axis, relative to the largest, where three axes
depend on failed thrusters' torque: if otherwise a plane remains, and if even less."""


class Rank(enum.IntEnum):
    """Torques of either sign that actuators make together: about all axes, in a plane, or fewer."""

    THREE_AXES = 0
    PLANE = 1
    LESS = 2


class FailedSet(NamedTuple):
    """A set of failed thrusters (numbers from 0) and the remaining capability.

    If torques of either sign remain in a plane, `directions` (3, 2) are two axes in it.
    """

    failed: tuple[int, ...]
    rank: Rank
    directions: Float[np.ndarray, "3 2"] | None = None


def failed_sets(torque: Float[np.ndarray, "3 m"]) -> tuple[FailedSet, ...]:
    """The tabled sets of failures: none, each single one and, up to `MOST_SETS` sets, each pair."""
    count = torque.shape[1]
    pairs = 1 + count + count * (count - 1) // 2 <= MOST_SETS
    sizes = range(min(MOST_FAILED if pairs else 1, count) + 1)
    sets = (failed for size in sizes for failed in itertools.combinations(range(count), size))
    return tuple(failed_set(torque, failed) for failed in sets)


def failed_set(torque: Float[np.ndarray, "3 m"], failed: tuple[int, ...]) -> FailedSet:
    """Remaining capability of thrusters with these torques (N m) without the failed ones."""
    columns = np.delete(torque, failed, axis=1)
    both_ways = two_sided_torques(columns)
    size = np.abs(torque).max()
    rank = int(np.linalg.matrix_rank(both_ways / size, tol=FLAT)) if both_ways.size else 0
    if rank != 2:
        return FailedSet(failed, Rank.THREE_AXES if rank == 3 else Rank.LESS)
    directions = torque_directions(unit_columns(both_ways))
    return FailedSet(failed, Rank.PLANE, directions)


def limit_about(torque: Float[np.ndarray, "3 m"], axes: Float[np.ndarray, "3 2"]) -> float:
    """Largest torque (N m) about two axes at once, of any signs and without other torque."""
    return largest_torque(two_sided_torques(torque), 0.0, 1.0, axes)


class Ability(NamedTuple):
    """Remaining capability: the number of the failed set, the `Rank`, and each thruster's share.

    `limit` is 1 for thrusters that work, 0 for excluded ones, and the share of full thrust of a
    weak one where it is needed.
    """

    number: IntScalar
    rank: Annotated[IntScalar, Rank]
    limit: Float[Array, " m"]


class Reconfiguration(eqx.Module):
    """The `failed_sets` as tables, and the allocation of a torque to the remaining thrusters.

    `rank` has the `Rank` of each set. `number` (m, m) is the number of the set with two given
    thrusters as first and last, -1 without a table. `torque` (3, m) is that at full thrust (N m).
    `flat`: no thruster has torque about some body axis, so that no failure leaves three axes.
    """

    torque: Float[Array, "3 m"] = eqx.field(converter=as_float)
    duties: LeastPropellant
    number: Int[Array, "m m"]
    rank: Int[Array, " sets"]
    flat: bool = eqx.field(static=True)

    @staticmethod
    def of(
        torque: Float[np.ndarray, "3 m"], cost: Float[np.ndarray, " m"], sets: tuple[FailedSet, ...]
    ) -> "Reconfiguration":
        """The tables of thrusters with these torques (N m); `cost` is of full thrust."""
        number = np.full((torque.shape[1], torque.shape[1]), -1)
        for place, one in enumerate(sets):
            if one.failed:
                number[one.failed[0], one.failed[-1]] = place
        largest = np.abs(torque).max(axis=1)
        return Reconfiguration(
            torque,
            LeastPropellant.of(torque, cost),
            as_array(number),
            as_array(np.array([int(one.rank) for one in sets])),
            flat=bool(largest.min() <= FLAT * largest.max()),
        )

    @property
    def whole(self) -> Ability:
        """The capability without failures in flight."""
        return Ability(jnp.array(0), self.rank[0], jnp.ones(self.torque.shape[1]))

    def find(self, condition: ActuatorCondition, before: "Ability") -> "Ability":
        """The remaining capability in a `condition`; `before` is that at the last sample.

        If working thrusters produce less than torques about all axes, three axes still remain if
        weak thrusters with a share of their thrust, and the flow of failed thrusters, supply the
        rest, with some torque to spare. Half of that is enough if it was so before, as hysteresis.
        Weak thrusters also contribute where the working ones cannot oppose the flow.
        """
        failed, part = condition.failed, condition.part
        number, rank = self._tabled(failed)
        working = jnp.where(failed, 0.0, 1.0)
        weak = failed & (part >= WEAK) & (condition.flow <= 0)
        limit = jnp.where(weak, part, working)
        had_three = (before.rank == Rank.THREE_AXES) & (before.number == number)
        spare = jnp.where(rank == Rank.PLANE, SPARE, LEAST_SPARE) * jnp.where(had_three, 0.5, 1.0)
        steady = -(self.torque @ condition.flow)
        all_axes = jax.lax.cond(
            rank == Rank.THREE_AXES,
            lambda: jnp.array(False),
            lambda: self._spans(limit, steady, spare),
        )
        helps = jax.lax.cond(
            jnp.any(weak) & jnp.any(condition.flow > 0),
            lambda: ~self._opposes(working, steady, jnp.any(weak & (before.limit > 0))),
            lambda: jnp.array(False),
        )
        return Ability(
            number,
            jnp.where(all_axes, int(Rank.THREE_AXES), jnp.where(rank < 0, int(Rank.LESS), rank)),
            jnp.where(all_axes | helps, limit, working),
        )

    def _opposes(self, limit: Float[Array, " m"], steady: Vector, helped: BoolScalar) -> BoolScalar:
        """Whether a torque (N m) is possible with `SPARE` of it to spare, or half of that without
        help so far (`helped`)."""
        demand = (1 + SPARE * jnp.where(helped, 1.0, 0.5)) * steady
        _, shortfall = self.duties(demand, limit)
        return jnp.sum(shortfall**2) < (SMALL * jnp.max(jnp.abs(self.torque))) ** 2

    def _tabled(self, failed: Bool[Array, " m"]) -> tuple[IntScalar, IntScalar]:
        """The number of a set, and its `Rank`; 0 and -1 without a table."""
        count = jnp.sum(failed)
        last = failed.shape[0] - 1 - jnp.argmax(failed[::-1])
        number = jnp.where(count > 0, self.number[jnp.argmax(failed), last], 0)
        in_table = (count <= MOST_FAILED) & (number >= 0)
        number = jnp.where(count <= MOST_FAILED, jnp.maximum(number, 0), 0)
        return number, jnp.where(in_table, self.rank[number], -1)

    def needed(self, failed: Bool[Array, " m"]) -> Bool[Array, " m"]:
        """Mask of working thrusters whose loss leaves fewer than three axes or no table."""
        place = jnp.arange(failed.shape[0])
        first = jnp.min(jnp.where(failed, place, failed.shape[0]))
        last = jnp.max(jnp.where(failed, place, -1))
        number = self.number[jnp.minimum(first, place), jnp.maximum(last, place)]
        in_table = (jnp.sum(failed) < MOST_FAILED) & (number >= 0)
        return ~failed & ~(in_table & (self.rank[jnp.maximum(number, 0)] == Rank.THREE_AXES))

    def _spans(self, limit: Float[Array, " m"], steady: Vector, spare: RealScalar) -> BoolScalar:
        """Whether a torque (N m) plus the part `spare` of the largest on each axis is possible."""
        if self.flat:
            return jnp.array(False)
        largest = jnp.max(jnp.abs(self.torque), axis=1)
        smallest = (SMALL * jnp.max(largest)) ** 2
        ways = jnp.concatenate([jnp.eye(3), -jnp.eye(3)])

        def also(way, spans):
            demand = steady + spare * ways[way] * largest
            _, shortfall = self.duties(demand, limit)
            return spans & (jnp.sum(shortfall**2) < smallest)

        return jax.lax.fori_loop(0, len(ways), also, jnp.array(True))

    def beside_plane(
        self, limit: Float[Array, " m"], torque: Vector, directions: Float[Array, "3 2"]
    ) -> Vector:
        """A torque (N m) where torques of either sign remain about two `directions` alone.

        Its part across them is removed unless a remaining thruster has torque in that sense: others
        compensate for that thruster's torque in the plane.
        """
        in_plane = directions @ (directions.T @ torque)
        across = torque - in_plane
        least = SMALL * jnp.max(jnp.abs(self.torque)) * jnp.sqrt(jnp.sum(across**2))
        reachable = jnp.any((limit > 0) & (across @ self.torque > least))
        return in_plane + jnp.where(reachable, across, 0.0)
