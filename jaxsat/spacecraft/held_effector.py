"""Effector behaviour under a held command: plan, holds and edges of a sampled law's period.

Under a sampled law an effector's *plan* of a period follows from its command and its *memory*. The
plan of most effectors is the held command; that of pulsed thrusters has commands from instant to
instant, each of which is constant in a *hold*.
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
    """A part of a period during which the commands of effectors are constant.

    `begin` and `length` are in s, `begin` from the sample on. `pieces` are the effectors' pieces in
    the order of the body.
    """

    begin: RealScalar
    length: RealScalar
    pieces: tuple[PyTree, ...] = ()

    def part(self, elapsed: RealScalar, length: RealScalar) -> "Hold":
        """Return the part that begins `elapsed` seconds after the begin, of this length (s)."""
        return self._replace(begin=self.begin + elapsed, length=length)


class GuardDecision(NamedTuple):
    """Whether a law makes a step at a sample, and, if not, whether the last commands are held."""

    steps: BoolScalar
    held: BoolScalar


def hold_by_hold(count: int, period: RealScalar, step: Callable[..., tuple], *carry: PyTree):
    """Return the carry after `step` for each of at most `count` holds of a period (s).

    A step takes the instant (s from the sample) at which a hold begins and the carry, and returns
    both at its end. A period seldom has `count` holds; the rest are skipped where an engine can,
    and the loop is differentiable either way.
    """
    first = (jnp.zeros_like(period), *carry)
    if count == 1:
        return step(*first)[1:]

    def one(_, now):
        return jax.lax.cond(now[0] < period, lambda now: step(*now), lambda now: now, now)

    return jax.lax.fori_loop(0, count, one, first)[1:]


def mean_size(first: Vector, last: Vector) -> Vector:
    """Return the mean size about each axis of a torque (N m) that changes linearly in time."""
    both = jnp.abs(first) + jnp.abs(last)
    crossing = (first**2 + last**2) / jnp.where(both > 0, 2 * both, 1.0)
    return jnp.where(first * last < 0, crossing, both / 2)


class Ahead(NamedTuple):
    """The plan from an instant of its period on.

    A command constant at least until the instant `until` (s from the sample), and the effector's
    own data for the end of the hold.
    """

    until: RealScalar
    command: PyTree
    own: PyTree = None


class AbstractHeldEffector(eqx.Module):
    """Behaviour of every effector in the period of a sampled law, and under a held command.

    The defaults are for an effector whose command is constant for the whole period and whose mode
    never changes by itself.
    """

    plans_delay: ClassVar[bool] = False
    """Whether `plan` shifts the commands by the delay of a law; if not, the loop does."""

    def mode(self, state: PyTree) -> PyTree:
        """Return the mode of the devices from their state alone."""
        return ()

    @abc.abstractmethod
    def piece(self, mode: PyTree, command: PyTree) -> PyTree:
        """Return the quantity that determines the torque while the devices stay in their mode."""

    # The period of a sampled law: a plan, and commands that are constant in a hold.

    @property
    def holds(self) -> int:
        """Largest number of holds in the plan of a period."""
        return 1

    def init_memory(self) -> PyTree:
        """Return the memory between samples at the start; None for an effector without memory."""
        return None

    def plan(
        self,
        t: RealScalar,
        use: Float[Array, " size"],
        memory: PyTree,
        period: RealScalar,
        delay: RealScalar | None,
        decision: GuardDecision | None = None,
    ) -> PyTree:
        """Return the plan of the period (s) that begins at time `t` (s), for a law's command `use`.

        The command is ready `delay` s after the begin; None is zero. By its `decision` a law may
        skip a step; `use` is the command then, too.
        """
        return use

    def begin(self, plan: PyTree) -> PyTree:
        """Return the running totals of a plan at the begin of its period."""
        return None

    def ahead(self, plan: PyTree, running: PyTree, now: RealScalar, period: RealScalar) -> Ahead:
        """Return the command from `now` (s from the sample) on."""
        return Ahead(period, plan)

    def passed(
        self, plan: PyTree, running: PyTree, ahead: Ahead, now: RealScalar, end: RealScalar
    ) -> PyTree:
        """Return the running totals after a hold from `now` to `end` (s from the sample)."""
        return running

    def finish(self, plan: PyTree, running: PyTree) -> tuple[PyTree, PyTree]:
        """Return the memory for the next period, and the command with the mean of this one."""
        return None, plan

    def run(self, plan: PyTree, period: RealScalar) -> PyTree:
        """Return the running totals of a plan at the end of its period (s)."""

        def step(now, running):
            ahead = self.ahead(plan, running, now, period)
            return ahead.until, self.passed(plan, running, ahead, now, ahead.until)

        return hold_by_hold(self.holds, period, step, self.begin(plan))[0]

    def consumption(self, memory: PyTree) -> dict[str, Array]:
        """Return consumption up to a sample, by the names of signals declared as totals."""
        return {}

    def flight_commands(
        self, use: PyTree, memory: PyTree, period: RealScalar
    ) -> tuple[dict[str, Array], PyTree]:
        """Return the outputs of flight code for the command `use`, by the names of
        `jaxsat.flight.flight.SampleCommands`, and the modulator's next memory; here none."""
        return {}, memory

    def modulator(self, memory: PyTree) -> PyTree:
        """Return the modulator's part of the memory; None without a modulator."""
        return None

    def later(self, command: PyTree, elapsed: RealScalar) -> PyTree:
        """Return the command, or the piece, `elapsed` seconds after the begin of its hold."""
        return command

    # A held command: modes that depend on time alone.

    @property
    def edge_count(self) -> int:
        """Number of `edges` in a hold."""
        return 0

    @property
    def follows_body(self) -> bool:
        """Whether the edges of a hold depend on the body's motion, and must be searched."""
        return False

    def edges(self, state: PyTree, command: PyTree, period: RealScalar) -> Float[Array, " edges"]:
        """Return instants (s) in [0, `period`] at which the piece changes under a held command."""
        return jnp.zeros(0, period.dtype)

    def held_piece(self, state: PyTree, command: PyTree, elapsed: RealScalar) -> PyTree:
        """Return the piece `elapsed` seconds after the begin of a hold in a state."""
        return self.piece(self.mode(state), command)

    def snapped(
        self, state: PyTree, command: PyTree, elapsed: RealScalar, reached: PyTree
    ) -> PyTree:
        """Return the state `reached` at an edge, with exact values where known."""
        return reached

    # A held command: modes that depend on the body's motion.

    def margins(
        self, mode: PyTree, state: PyTree, command: PyTree, acceleration: Vector
    ) -> Float[Array, "..."]:
        """Return the margins of the devices' mode: below zero for a device that has left it."""
        return jnp.zeros(0)

    def approach(
        self, mode: PyTree, state: PyTree, command: PyTree, acceleration: Vector
    ) -> Float[Array, "..."]:
        """Return d/dt of each margin whose zero precedes a jump, zero for other margins."""
        return jnp.zeros_like(self.margins(mode, state, command, acceleration))

    def come(self, mode: PyTree, state: PyTree, margins: Float[Array, "..."]) -> PyTree:
        """Return the state, exact for devices that leave their mode (margin below zero)."""
        return state
