"""Torque about the normal of a plane of torques, from mounting errors (leaks) of the thrusters.

Thrusters whose torques cancel in the plane still produce the sum of their leaks across it. That sum
is small, but a plane whose sums have either sign gives three axes.
"""

import dataclasses
from typing import NamedTuple, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsat.control.fine import Aid
from jaxsat.control.least_squares import Fit, RecursiveLeastSquares
from jaxsat.control.supervisor import ThreeSlewSettling
from jaxsat.core.array_types import BoolScalar, Pair, RealScalar
from jaxsat.core.checks import as_array, as_float
from jaxsat.spacecraft.least_propellant import LeastPropellant

PRIOR_LEAK = 0.03
"""Standard deviation of a leak, over the torque of a thruster."""

ACROSS = 0.05
"""Largest torque across the plane, relative to a thruster's torque, of a thruster of the plane."""

SURE_LEAK, SURE_SIGMAS = 1e-3, 4.0
"""Smallest usable sum of leaks, relative to the torques, and in standard deviations."""

LEAST_PUSH = 20.0
"""Smallest usable acceleration about n, relative to that of a hold's oscillation."""


class LeakMemory(NamedTuple):
    """`duty` (2, m) of the largest torque towards -n and n, `push` (rad/s²), that torque over n·Jn,
    `owed` (rad/s), the demand below one pulse, and `drift` of `Aid`."""

    duty: Float[Array, "2 m"]
    push: Pair
    owed: RealScalar
    drift: RealScalar

    @staticmethod
    def none(count: int) -> "LeakMemory":
        """The memory before any leak is known."""
        zero = jnp.zeros(count)
        return LeakMemory(jnp.zeros((2, count)), zero[:2], zero[0], zero[0])


class Leaks(eqx.Module):
    """Data for the fit of leaks and for their use.

    The rows of `basis` (k, m) are combinations of thrusters without torque in the plane, as
    acceleration (rad/s²) that their full torque would cause about n. `plane` (2, m) are the torques
    about x and y (N m), and `flat` (m,) marks the thrusters of the plane. `inertia` is n·Jn,
    `least` (rad/s²) the smallest usable acceleration, `averaged` (s) the time constant of the mean
    of `Aid.drift`, `pulse` (s) that of each thruster.
    """

    basis: Float[Array, "k m"] = eqx.field(converter=as_float)
    plane: Float[Array, "2 m"] = eqx.field(converter=as_float)
    flat: Bool[Array, " m"]
    inertia: RealScalar = eqx.field(converter=as_float)
    least: RealScalar = eqx.field(converter=as_float)
    averaged: RealScalar = eqx.field(converter=as_float)
    pulse: Float[Array, " m"] = eqx.field(converter=as_float)

    @staticmethod
    def of(
        law: ThreeSlewSettling,
        torque: Float[np.ndarray, "3 m"],
        failed: tuple[int, ...],
        pulse: Float[np.ndarray, " m"],
    ) -> "tuple[Leaks, ThreeSlewSettling]":
        """The leaks of thrusters with these torques (N m), and the law with a fit of them."""
        form = law.form
        axes = np.asarray(form.axes)
        plane, about = axes[:2] @ torque, axes[2] @ torque
        inertia = float(np.asarray(form.moments)[2])
        flat = np.abs(about) < ACROSS * np.sqrt(np.sum(torque**2, axis=0))
        flat[list(failed)] = False
        place = np.flatnonzero(flat)
        _, _, rows = np.linalg.svd(plane[:, place])
        basis = np.zeros((torque.shape[1] - 2, torque.shape[1]))
        basis[: len(place) - 2, place] = rows[2:]
        others = np.flatnonzero(~flat)
        basis[len(place) - 2 + np.arange(len(others)), others] = 1
        size = np.sqrt(np.mean(np.sum(torque**2, axis=0))) / inertia
        basis = basis * size
        mean = np.zeros(8 + len(basis))
        mean[8 + len(place) - 2 :] = about[others] / inertia / size
        fit = cast(RecursiveLeastSquares, law.estimator.least_squares)
        prior = np.concatenate([np.asarray(fit.prior), np.full(len(basis), PRIOR_LEAK)])
        fit = dataclasses.replace(fit, prior=prior, mean=as_float(mean))
        law = dataclasses.replace(
            law, estimator=dataclasses.replace(law.estimator, least_squares=fit), aided=True
        )
        most = float(form.coupling) * float(law.fine.holding_amplitude) ** 2 / 2
        averaged = 2 * np.pi / float(law.fine.oscillator.frequency)
        least = LEAST_PUSH * most
        return Leaks(basis, plane, as_array(flat), inertia, least, averaged, pulse), law

    def aid(self, memory: LeakMemory, on_time: Float[Array, " m"], holds: BoolScalar) -> Aid:
        """The aid after a period with these on-times (s) of the thrusters.

        Where the law `holds` and cannot push, the law needs the mean of all that acts about n, and
        a constant torque must not be fitted as leaks: the thrust is then zero.
        """
        untold = holds & (jnp.max(memory.push) <= 0)
        thrust = jnp.where(untold, 0.0, self.basis @ on_time)
        return Aid(thrust, jnp.where(untold, 0.0, memory.drift), memory.push)

    def believed(self, fit: Fit) -> Float[Array, " k"]:
        """Significant leaks of the combinations, relative to their torque."""
        leaks, variance = fit.estimate[8:], jnp.diagonal(fit.covariance.matrix)[8:]
        sure = (leaks**2 > SURE_SIGMAS**2 * variance) & (jnp.abs(leaks) > SURE_LEAK)
        return jnp.where(sure, leaks, 0.0)

    def found(self, fit: Fit, limit: Float[Array, " m"], memory: LeakMemory) -> LeakMemory:
        """The memory with the duties that the fitted leaks permit, of thrusters up to a `limit`.

        Thrusters out of the plane, whose pulses are large, serve a sign that those of the plane
        cannot produce.
        """
        leaks, covariance = self.believed(fit), fit.covariance.matrix[8:, 8:]
        about = self.inertia * (leaks @ self.basis)
        columns = jnp.concatenate([self.plane, about[None]])
        square = jnp.sum(columns**2, axis=0)
        limit = jnp.where(square > 0, limit, 0.0)
        size = jnp.sqrt(jnp.where(square > 0, square, 1.0))
        duties = LeastPropellant(columns / size[None], size, jnp.ones_like(size), jnp.eye(3))
        most = jnp.sum(jnp.abs(about) * limit)

        def one(way, best):
            aim = most * jnp.where(way % 2 == 0, -1.0, 1.0)
            aim = jnp.stack([0 * most, 0 * most, aim])
            duty, _ = duties(aim, jnp.where(self.flat | (way >= 2), limit, 0.0))
            push = jnp.abs(jnp.sum(about * duty)) / self.inertia
            torque = self.basis @ duty
            variance = jnp.sum(torque * (covariance @ torque))
            floor = SURE_LEAK * jnp.sum(size * duty) / self.inertia
            sure = (push**2 > SURE_SIGMAS**2 * variance) & (push > floor)
            push = jnp.where(sure, push, 0.0)
            better = (way < 2) | (best[1][way % 2] < self.least)
            return (
                best[0].at[way % 2].set(jnp.where(better, duty, best[0][way % 2])),
                best[1].at[way % 2].set(jnp.where(better, push, best[1][way % 2])),
            )

        duty, push = jax.lax.fori_loop(0, 4, one, (memory.duty, memory.push))
        push = jnp.where(push > self.least, push, 0.0)
        alone = (jnp.min(push) <= 0) & jnp.any((duty > 0) & ~self.flat[None], axis=1)
        return memory._replace(duty=duty, push=jnp.where(alone, 0.0, push))

    def push(
        self,
        fit: Fit,
        demand: RealScalar,
        duty: Float[Array, " m"],
        limit: Float[Array, " m"],
        period: RealScalar,
        memory: LeakMemory,
    ) -> tuple[Float[Array, " m"], LeakMemory]:
        """Duties with the acceleration `demand` (rad/s²) about n added, in whole pulses of all
        thrusters of a combination at once.

        It has what the `duty` in the plane leaves: a combination that one of its thrusters cannot
        follow makes a torque in the plane, which takes what steers there or even turns it round.
        """
        leaking = jnp.sum(self.believed(fit) * (self.basis @ (limit * duty)))
        share = period / (self.averaged + period)
        owed = memory.owed + demand * period
        way = jnp.where(owed < 0, 0, 1)
        most, extra = memory.push[way] * period, memory.duty[way]
        owed = jnp.clip(owed, -memory.push[0] * period, memory.push[1] * period)
        demanded = jnp.abs(owed) / jnp.where(most > 0, most, 1.0)
        uses = extra > 0
        room = jnp.min(jnp.where(uses, (1 - duty) / jnp.where(uses, extra, 1.0), jnp.inf))
        part = jnp.minimum(demanded, room)
        pulse = jnp.max(jnp.where(uses, self.pulse, 0.0))
        fires = (part * period * jnp.max(extra) >= pulse) & (most > 0)
        part = jnp.where(fires, part, 0.0)
        owed = jnp.where(fires, jnp.sign(owed) * (demanded - part) * most, owed)
        return jnp.minimum(duty + part * extra, 1.0), memory._replace(
            owed=owed, drift=memory.drift + share * (leaking - memory.drift)
        )
