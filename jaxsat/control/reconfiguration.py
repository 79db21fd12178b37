"""What is left of a set of thrusters after failures, as tables made when a law is built."""

import enum
import itertools
from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxsat.allocation import (
    all_bases,
    largest_torque,
    least_propellant,
    torque_directions,
    two_sided_torques,
    unit_columns,
)
from jaxsat.checks import as_array, as_float

RealScalar = Float[Array, ""]

MOST_SETS = 80
"""Sets of failed thrusters that are tabled; sets of two are where there are no more."""

FLAT = 1e-9
"""Of the largest torque: what is below counts as zero."""

VIOLATION = 1e3
"""What a torque that is missed costs, over the dearest thruster's that makes as much."""

ROUNDS = 2
"""In which others make what thrusters at full thrust cannot."""

MOST_DUTY = 0.95
"""A thruster that is busy for longer with what comes first has no part in the rest."""

SMALL = 1e-6
"""Of the largest torque: as good as none is missed."""

SUPPLIED = 0.1
"""Of the strength of the thrusters that oppose it: the least that a flow must supply, and leave."""


class Left(enum.IntEnum):
    """The torques of either sign that are left: about all axes, in a plane, or fewer."""

    THREE_AXES = 0
    PLANE = 1
    LESS = 2


class FailedSet(NamedTuple):
    """A set of failed thrusters (numbers from 0) and what is left without them.

    Where torques of either sign are left in a plane, `directions` (3, 2) are about two axes in it.
    No thruster left makes torque along `missing` (zero where it is not one direction); against it
    they make at most `strength` (N m).
    """

    failed: tuple[int, ...]
    left: Left
    directions: Float[np.ndarray, "3 2"] | None = None
    missing: Float[np.ndarray, "3"] = np.zeros(3)
    strength: float = 0.0


def failed_sets(torque: Float[np.ndarray, "3 m"]) -> tuple[FailedSet, ...]:
    """No failure, each single one and, unless these are more than `MOST_SETS`, each pair."""
    count = torque.shape[1]
    pairs = 1 + count + count * (count - 1) // 2 <= MOST_SETS
    sizes = range(min(2 if pairs else 1, count) + 1)
    sets = (failed for size in sizes for failed in itertools.combinations(range(count), size))
    return tuple(what_is_left(torque, failed) for failed in sets)


def what_is_left(torque: Float[np.ndarray, "3 m"], failed: tuple[int, ...]) -> FailedSet:
    """What thrusters with these torques (N m) can make without those that have failed."""
    columns = np.delete(torque, failed, axis=1)
    both_ways = two_sided_torques(columns)
    size = np.abs(torque).max()
    rank = int(np.linalg.matrix_rank(both_ways / size, tol=FLAT)) if both_ways.size else 0
    if rank != 2:
        return FailedSet(failed, Left.THREE_AXES if rank == 3 else Left.LESS)
    directions = torque_directions(unit_columns(both_ways))
    normal = np.cross(directions[:, 0], directions[:, 1])
    along = normal @ columns
    most = along[np.argmax(np.abs(along))]
    if abs(most) < FLAT * size:
        return FailedSet(failed, Left.PLANE, directions)
    return FailedSet(failed, Left.PLANE, directions, -np.sign(most) * normal, abs(float(most)))


def limit_about(torque: Float[np.ndarray, "3 m"], axes: Float[np.ndarray, "3 2"]) -> float:
    """The torque (N m) that thrusters make about two axes at once, of any signs, and no other."""
    both_ways = two_sided_torques(torque)
    cost = np.sqrt(np.sum(both_ways**2, axis=0))
    return largest_torque(least_propellant(both_ways, cost, axes))


class Reconfiguration(eqx.Module):
    """The `failed_sets` as tables, and the allocation of a torque to the thrusters left.

    `failed` (sets, m), `left` (a `Left`), `missing` and `strength` as in `FailedSet`. `torque`
    (3, m) is that at full thrust (N m), `cost` that of full thrust. `members` (bases, 3) and
    `inverse` (bases, 3, 3) are `jaxsat.allocation.all_bases`.
    """

    torque: Float[Array, "3 m"] = eqx.field(converter=as_float)
    cost: Float[Array, " m"] = eqx.field(converter=as_float)
    members: Int[Array, "bases 3"]
    inverse: Float[Array, "bases 3 3"] = eqx.field(converter=as_float)
    failed: Bool[Array, "sets m"]
    left: Int[Array, " sets"]
    missing: Float[Array, "sets 3"] = eqx.field(converter=as_float)
    strength: Float[Array, " sets"] = eqx.field(converter=as_float)

    @staticmethod
    def of(
        torque: Float[np.ndarray, "3 m"],
        cost: Float[np.ndarray, " m"],
        sets: tuple[FailedSet, ...],
    ) -> "Reconfiguration":
        """The tables of thrusters whose torques span all three axes."""
        failed = np.zeros((len(sets), torque.shape[1]), bool)
        for number, one in enumerate(sets):
            failed[number, list(one.failed)] = True
        members, inverse = all_bases(torque)
        return Reconfiguration(
            torque,
            cost / np.max(cost),
            as_array(members),
            inverse,
            as_array(failed),
            as_array(np.array([int(one.left) for one in sets])),
            np.stack([one.missing for one in sets]),
            np.array([one.strength for one in sets]),
        )

    def find(
        self, failed: Bool[Array, " m"], flow: Float[Array, " m"]
    ) -> tuple[Int[Array, ""], Int[Array, ""]]:
        """The number of a set of failed thrusters, and the `Left` that it leaves.

        Where failed thrusters have a `flow` (parts of full thrust) along the missing direction that
        those left can both oppose and leave, torques about all three axes are left. Sets without a
        table leave less.
        """
        same = jnp.all(self.failed == failed[None], axis=1)
        number = jnp.argmax(same)
        left = jnp.where(jnp.any(same), self.left[number], int(Left.LESS))
        supply = jnp.sum(self.missing[number] * (self.torque @ flow))
        strength = self.strength[number]
        supplied = (supply > SUPPLIED * strength) & (supply < (1 - SUPPLIED) * strength)
        return number, jnp.where((left == Left.PLANE) & supplied, int(Left.THREE_AXES), left)

    def allocate(
        self,
        failed: Bool[Array, " m"],
        torque: Float[Array, "3"],
        steady: Float[Array, "3"],
    ) -> Float[Array, " m"]:
        """Duties of the thrusters left that make `torque` + `steady` (N m).

        Where that is more than they can, `steady` comes first, and `torque` is reduced in size to
        what is left of them.
        """
        wanted = self._cheapest(failed, torque + steady)
        whole = self._within_reach(failed, wanted)
        missed = self.torque @ (wanted - whole)
        enough = jnp.sum(missed**2) < (SMALL * jnp.max(jnp.abs(self.torque))) ** 2
        first = self._within_reach(failed, self._cheapest(failed, steady))
        more = self._cheapest(failed | (first > MOST_DUTY), torque)
        room = jnp.where(more > 0, (1 - first) / jnp.where(more > 0, more, 1.0), 1.0)
        reduced = first + jnp.minimum(jnp.min(room), 1.0) * more
        return jnp.where(enough, whole, reduced)

    def _within_reach(self, failed, duty) -> Float[Array, " m"]:
        """Duties of at most 1: what is beyond that, others make as far as they can."""
        torque = self.torque @ duty
        duty = jnp.minimum(duty, 1.0)
        for _ in range(ROUNDS):
            full = failed | (duty >= 1)
            more = self._cheapest(full, torque - self.torque @ duty)
            duty = jnp.minimum(duty + more, 1.0)
        return duty

    def _cheapest(self, failed: Bool[Array, " m"], torque: Float[Array, "3"]) -> Float[Array, " m"]:
        """Duties, however large, that make a torque (N m) with least propellant.

        They are those of the basis that costs least: a solution of the linear programme is one of
        a basis. What a basis asks of failed thrusters, or of others the other way, is missed. Of a
        torque that cannot be made the least is missed.
        """
        duties = jnp.sum(self.inverse * torque[None, None, :], axis=-1)
        cost, gone = self.cost[self.members], failed[self.members]
        wrong = jnp.where(gone, jnp.abs(duties), jnp.maximum(-duties, 0.0))
        best = jnp.argmin(jnp.sum(cost * jnp.maximum(duties, 0.0) + VIOLATION * wrong, axis=1))
        used = jnp.arange(failed.shape[0])[:, None] == self.members[best][None]
        duty = jnp.sum(jnp.where(used, duties[best][None], 0.0), axis=1)
        return jnp.where(failed, 0.0, jnp.maximum(duty, 0.0))
