"""An effector under a command that stays: plan, holds and edges of a sampled law's period.

Under a sampled law its *plan* of a period is made of what it is asked for and of its *memory*. That
of most is the command, which stays; that of thrusters that pulse has commands from instant to
instant, each of which stays in a *hold*.
"""

import abc
from collections.abc import Callable
from typing import ClassVar, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.core.array_types import BoolScalar, RealScalar, Vector


class Hold(NamedTuple):
    """A time in a period during which commands of effectors stay.

    `begin` and `length` are in s, `begin` from the sample on. `pieces` are those that the effectors
    of the body are in.
    """

    begin: RealScalar
    length: RealScalar
    pieces: tuple[PyTree, ...] = ()

    def part(self, elapsed: RealScalar, length: RealScalar) -> "Hold":
        """The part that begins `elapsed` seconds after the begin, of this length (s)."""
        return self._replace(begin=self.begin + elapsed, length=length)


class Decision(NamedTuple):
    """Whether a law makes a step at a sample, and, if not, whether the last commands are held."""

    steps: BoolScalar
    held: BoolScalar


def hold_by_hold(count: int, period: RealScalar, step: Callable[..., tuple], *carry: PyTree):
    """The carry after `step` for each of at most `count` holds of a period (s).

    A step takes the instant (s from the sample) at which a hold begins and the carry, and gives
    those at its end. A period seldom has as many holds as it may have. Those left are skipped where
    an engine can, and the loop can be differentiated either way.
    """
    first = (jnp.zeros_like(period), *carry)
    if count == 1:
        return step(*first)[1:]

    def one(_, now):
        return jax.lax.cond(now[0] < period, lambda now: step(*now), lambda now: now, now)

    return jax.lax.fori_loop(0, count, one, first)[1:]


def mean_size(first: Vector, last: Vector) -> Vector:
    """The mean size about each axis of a torque (N m) that changes evenly from one to another."""
    both = jnp.abs(first) + jnp.abs(last)
    crossing = (first**2 + last**2) / jnp.where(both > 0, 2 * both, 1.0)
    return jnp.where(first * last < 0, crossing, both / 2)


class Ahead(NamedTuple):
    """What a plan has from an instant in its period on.

    A command that stays until the instant `until` (s from the sample) at the earliest, and what the
    effector needs to know once it is over.
    """

    until: RealScalar
    command: PyTree
    own: PyTree = None


class AbstractHeldEffector(eqx.Module):
    """What every effector does in the period of a sampled law, and while a command stays.

    What is here is that of an effector whose command stays for the whole period and whose mode
    never changes by itself.
    """

    plans_delay: ClassVar[bool] = False
    """Whether `plan` shifts the commands by the delay of a law, else the loop does."""

    def mode(self, state: PyTree) -> PyTree:
        """How the devices move by their state alone."""
        return ()

    @abc.abstractmethod
    def piece(self, mode: PyTree, command: PyTree) -> PyTree:
        """What the torque depends on while the devices stay in their mode."""

    # The period of a sampled law: a plan, and commands that stay in a hold.

    @property
    def holds(self) -> int:
        """In how many holds its plan divides a period at most."""
        return 1

    def init_memory(self) -> PyTree:
        """What is remembered from sample to sample, at the start; None for nothing."""
        return None

    def plan(
        self,
        t: RealScalar,
        use: Float[Array, " size"],
        memory: PyTree,
        period: RealScalar,
        delay: RealScalar | None,
    ) -> PyTree:
        """The plan of the period (s) that begins at time `t` (s), for what a law asks for.

        What it asks for is ready `delay` s after the begin; None is at once.
        """
        return use

    def plan_guarded(
        self,
        t: RealScalar,
        use: Float[Array, " size"],
        memory: PyTree,
        period: RealScalar,
        delay: RealScalar | None,
        decision: Decision,
    ) -> PyTree:
        """The plan where the law may make no step; `use` is what is asked for then, too."""
        return self.plan(t, use, memory, period, delay)

    def begin(self, plan: PyTree) -> PyTree:
        """What runs through the holds of a plan, as its period begins."""
        return None

    def ahead(self, plan: PyTree, running: PyTree, now: RealScalar, period: RealScalar) -> Ahead:
        """The command from `now` (s from the sample) on."""
        return Ahead(period, plan)

    def passed(
        self, plan: PyTree, running: PyTree, ahead: Ahead, now: RealScalar, end: RealScalar
    ) -> PyTree:
        """What runs through the plan after a hold from `now` to `end` (s from the sample)."""
        return running

    def finish(self, plan: PyTree, running: PyTree) -> tuple[PyTree, PyTree]:
        """The memory for the next period, and the command that does the mean of the period."""
        return None, plan

    def run(self, plan: PyTree, period: RealScalar) -> PyTree:
        """What has run through a plan at the end of its period (s)."""

        def step(now, running):
            ahead = self.ahead(plan, running, now, period)
            return ahead.until, self.passed(plan, running, ahead, now, ahead.until)

        return hold_by_hold(self.holds, period, step, self.begin(plan))[0]

    def consumption(self, memory: PyTree) -> dict[str, Array]:
        """What has been used up to a sample, by the names of signals that are declared as total."""
        return {}

    def flight_commands(
        self, use: PyTree, memory: PyTree, period: RealScalar
    ) -> tuple[dict[str, Array], PyTree]:
        """What flight code puts out for what is asked for, by the names of
        `jaxsat.flight.flight.SampleCommands`, and the next memory of a modulator; here nothing."""
        return {}, memory

    def modulator(self, memory: PyTree) -> PyTree:
        """What of the memory a modulator has; None without one."""
        return None

    def later(self, command: PyTree, elapsed: RealScalar) -> PyTree:
        """The command, or the piece, `elapsed` seconds after it began to stay."""
        return command

    # A command that is held: modes that depend on time alone.

    @property
    def edge_count(self) -> int:
        """How many `edges` there are in a hold."""
        return 0

    @property
    def follows_body(self) -> bool:
        """Whether the edges of a hold depend on how the body turns, and must be searched."""
        return False

    def edges(self, state: PyTree, command: PyTree, period: RealScalar) -> Float[Array, " edges"]:
        """Instants (s) in [0, `period`] at which the piece changes under a command that stays."""
        return jnp.zeros(0, period.dtype)

    def held_piece(self, state: PyTree, command: PyTree, elapsed: RealScalar) -> PyTree:
        """The piece `elapsed` seconds after a command began to stay in a state."""
        return self.piece(self.mode(state), command)

    def snapped(
        self, state: PyTree, command: PyTree, elapsed: RealScalar, reached: PyTree
    ) -> PyTree:
        """The state `reached` at an edge, where known, exactly."""
        return reached

    # A command that is held: modes that depend on how the body turns.

    def margins(
        self, mode: PyTree, state: PyTree, command: PyTree, acceleration: Vector
    ) -> Float[Array, "..."]:
        """How far devices are from leaving their mode: below zero for one that has left it."""
        return jnp.zeros(0)

    def approach(
        self, mode: PyTree, state: PyTree, command: PyTree, acceleration: Vector
    ) -> Float[Array, "..."]:
        """d/dt of each margin that goes to zero before something jumps, zero for others."""
        return jnp.zeros_like(self.margins(mode, state, command, acceleration))

    def come(self, mode: PyTree, state: PyTree, margins: Float[Array, "..."]) -> PyTree:
        """The state of devices that leave their mode where a margin is below zero, exactly."""
        return state
