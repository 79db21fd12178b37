"""What happens between two samples: holds, and actuators that divide a period into them."""

import abc
from collections.abc import Callable
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.spacecraft.effector import Reach

RealScalar = Float[Array, ""]


class Hold(NamedTuple):
    """A time in a period during which the torque on the body changes evenly, or not at all.

    `begin` and `length` are in s, `begin` from the sample on. The torque (N m) is `torque` at the
    begin and changes by `torque_rate` (N m/s); None is a torque that stays. `pieces` are those that
    the effectors of the body are in.
    """

    begin: RealScalar
    length: RealScalar
    torque: Float[Array, "3"]
    torque_rate: Float[Array, "3"] | None = None
    pieces: tuple[PyTree, ...] = ()

    def part(self, elapsed: RealScalar, length: RealScalar) -> "Hold":
        """The part that begins `elapsed` seconds after the begin, of this length (s)."""
        return self._replace(
            begin=self.begin + elapsed, length=length, torque=self.torque_after(elapsed)
        )

    def divided(self, instant: RealScalar) -> "tuple[Hold, Hold]":
        """The parts before and after an instant (s from the sample on)."""
        first = jnp.clip(instant - self.begin, 0.0, self.length)
        return self.part(0 * first, first), self.part(first, self.length - first)

    def torque_after(self, elapsed: RealScalar) -> Float[Array, "3"]:
        """The torque (N m) `elapsed` seconds after the begin."""
        if self.torque_rate is None:
            return self.torque
        return self.torque + elapsed * self.torque_rate

    def mean_size(self) -> Float[Array, "3"]:
        """The mean of the torque's size about each axis (N m), whichever way it points."""
        first = jnp.abs(self.torque)
        if self.torque_rate is None:
            return first
        end = self.torque + self.length * self.torque_rate
        last = jnp.abs(end)
        both = first + last
        crossing = (first**2 + last**2) / jnp.where(both > 0, 2 * both, 1.0)
        return jnp.where(self.torque * end < 0, crossing, both / 2)


class Usage(NamedTuple):
    """What actuators did in a period.

    `torque` is the mean torque (N m), `level` the mean thrust of each thruster in parts of its full
    one. Since the start of the run `propellant` (kg) was used, and each valve opened `openings`
    times.
    """

    torque: Float[Array, "3"]
    level: Float[Array, " m"]
    propellant: RealScalar
    openings: Float[Array, " m"]


class Consumption(NamedTuple):
    """Since the start of the run: propellant (kg), and how often each valve opened."""

    propellant: RealScalar
    openings: Float[Array, " m"]


class AbstractPulsedActuators(eqx.Module):
    """Actuators that run once a period and whose torque then changes at instants of their own.

    `plan` makes a plan of the command; `advance` goes through it hold by hold, `holds` times;
    `finish` gives the memory for the next period.
    """

    @property
    @abc.abstractmethod
    def holds(self) -> int:
        """In how many holds a period is divided at most."""

    @abc.abstractmethod
    def init(self) -> PyTree:
        """The memory at the start."""

    @abc.abstractmethod
    def plan(
        self,
        t: RealScalar,
        command: Float[Array, " torques"],
        memory: PyTree,
        period: RealScalar,
        delay: RealScalar | None,
    ) -> tuple[PyTree, PyTree]:
        """The plan of the period that begins at time `t` (s), and what runs through it.

        The law's command (N m) is ready `delay` s after the begin; None is at once.
        """

    @abc.abstractmethod
    def under_way(self, plan: PyTree, running: PyTree) -> Bool[Array, ""]:
        """Whether the period has not ended yet, so that there is a next hold."""

    @abc.abstractmethod
    def advance(self, plan: PyTree, running: PyTree) -> tuple[Hold, PyTree]:
        """The next hold, which has no length where the period has ended."""

    def commands(self, command: Float[Array, " torques"]) -> dict[str, Array]:
        """What each kind of effector of the body is asked for, by its kind; here none is."""
        del command
        return {}

    def unmade(self, command: Float[Array, " torques"]) -> Float[Array, "3"] | None:
        """The torque of a command beyond what actuators make within their limits, N m; None where
        they make none of a torque."""
        del command
        return None

    def reach(self, struck: Bool[Array, " f"]) -> Reach:
        """What thrusters can do once these failures have struck; here there are none."""
        del struck
        return Reach.none()

    @abc.abstractmethod
    def finish(self, plan: PyTree, running: PyTree) -> tuple[PyTree, Usage]:
        """The memory at the end of the period, and what was used in it."""

    @abc.abstractmethod
    def consumption(self, memory: PyTree) -> Consumption:
        """What has been used up to the period that begins with this memory."""

    def usage(self, plan: PyTree, running: PyTree) -> Usage:
        """What the whole period will use."""
        (last,) = self.hold_by_hold(plan, running, lambda now: (self.advance(plan, now)[1],))
        return self.finish(plan, last)[1]

    def hold_by_hold(
        self, plan: PyTree, running: PyTree, step: Callable[..., tuple], *carry: PyTree
    ) -> tuple:
        """`step` for each hold of a period, of what runs through the plan and the carry.

        A period seldom has as many holds as it may have. Those left are skipped where an engine
        can, and the loop can be differentiated either way.
        """

        def one(_, now):
            ahead = self.under_way(plan, now[0])
            return jax.lax.cond(ahead, lambda now: step(*now), lambda now: now, now)

        return jax.lax.fori_loop(0, self.holds, one, (running, *carry))
