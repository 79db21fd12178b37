"""What is left of a set of thrusters after failures, as tables made when a law is built."""

import enum
import itertools
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxsat.allocation import (
    largest_torque,
    least_propellant,
    torque_directions,
    two_sided_torques,
    unit_columns,
)
from jaxsat.checks import as_array, as_float
from jaxsat.control.cheapest_duties import CheapestDuties

RealScalar = Float[Array, ""]

MOST_FAILED = 2
"""Thrusters of a tabled set."""

MOST_SETS = 150
"""Tabled sets; where these and all pairs are more, sets of one alone are tabled."""

FLAT = 1e-9
"""Of the largest torque: what is below counts as zero."""

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
    sizes = range(min(MOST_FAILED if pairs else 1, count) + 1)
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

    `left` (a `Left`), `missing` and `strength` of each set are as in `FailedSet`. `number` (m, m)
    is the number of the set of which two thrusters are the first and the last, -1 without a table.
    `torque` (3, m) is that at full thrust (N m).
    """

    torque: Float[Array, "3 m"] = eqx.field(converter=as_float)
    cheapest: CheapestDuties
    number: Int[Array, "m m"]
    left: Int[Array, " sets"]
    missing: Float[Array, "sets 3"] = eqx.field(converter=as_float)
    strength: Float[Array, " sets"] = eqx.field(converter=as_float)

    @staticmethod
    def of(
        torque: Float[np.ndarray, "3 m"],
        cost: Float[np.ndarray, " m"],
        sets: tuple[FailedSet, ...],
    ) -> "Reconfiguration":
        """The tables of thrusters whose torques span all three axes; `cost` is of full thrust."""
        number = np.full((torque.shape[1], torque.shape[1]), -1)
        for place, one in enumerate(sets):
            if one.failed:
                number[one.failed[0], one.failed[-1]] = place
        return Reconfiguration(
            torque,
            CheapestDuties.of(torque, cost),
            as_array(number),
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
        count = jnp.sum(failed)
        last = failed.shape[0] - 1 - jnp.argmax(failed[::-1])
        number = self.number[jnp.argmax(failed), last]
        known = (count == 0) | ((count <= MOST_FAILED) & (number >= 0))
        number = jnp.where(known & (count > 0), number, 0)
        left = jnp.where(known, self.left[number], int(Left.LESS))
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
        wanted = self.cheapest(failed, torque + steady)
        whole = self._within_reach(failed, wanted)
        missed = self.torque @ (wanted - whole)
        enough = jnp.sum(missed**2) < (SMALL * jnp.max(jnp.abs(self.torque))) ** 2

        def reduced() -> Float[Array, " m"]:
            first = self._within_reach(failed, self.cheapest(failed, steady))
            more = self.cheapest(failed | (first > MOST_DUTY), torque)
            room = jnp.where(more > 0, (1 - first) / jnp.where(more > 0, more, 1.0), 1.0)
            return first + jnp.minimum(jnp.min(room), 1.0) * more

        return jax.lax.cond(enough, lambda: whole, reduced)

    def _within_reach(self, failed, duty) -> Float[Array, " m"]:
        """Duties of at most 1: what is beyond that, others make as far as they can."""
        torque = self.torque @ duty

        def shared(duty):
            duty = jnp.minimum(duty, 1.0)
            for _ in range(ROUNDS):
                more = self.cheapest(failed | (duty >= 1), torque - self.torque @ duty)
                duty = jnp.minimum(duty + more, 1.0)
            return duty

        return jax.lax.cond(jnp.max(duty) > 1, shared, lambda duty: duty, duty)
