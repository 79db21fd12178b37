"""Two more laws written after docs/your-own-law.md: valves with hysteresis, and an observer."""

import enum
from typing import NamedTuple

import jax
import jax.numpy as jnp

from jaxsat import LawDeclaration
from jaxsat.core.declaration import number
from tests.flight.law_frame import PERIOD, AbstractVisitor, attitude_error


class Valve(enum.IntEnum):
    """What the valves of an axis do."""

    CLOSED = 0
    PLUS = 1
    MINUS = 2


class ValveMemory(NamedTuple):
    """What the valves do, samples since they changed, pulses so far, and whether locked."""

    valves: jax.Array
    since: jax.Array
    pulses: jax.Array
    locked: jax.Array


class BangBang(AbstractVisitor):
    """Full torque on a phase plane with dead band and hysteresis, and a shortest pulse."""

    declaration = LawDeclaration(
        summary="bang-bang with dead band and hysteresis",
        keys=(
            PERIOD,
            number("level", "Torque", "N m", above=0, tunable=True),
            number("dead_band_rad", "Dead band", "rad", above=0, default=0.01),
            number("hysteresis", "Share of the dead band", "1", above=0, at_most=1, default=0.4),
            number("lead_s", "Weight of the rate", "s", above=0, default=6.0),
        ),
        torques=3,
    )

    level: jax.Array
    dead_band: jax.Array
    hysteresis: jax.Array
    lead: jax.Array

    def init(self, state):
        zero = jnp.zeros(3, int)
        return ValveMemory(zero, zero, zero, jnp.zeros(3, bool))

    def step(self, t, state, memory):
        rate = self.model.relative_rate(state)
        line = 2 * attitude_error(state) + self.lead * rate
        inner = self.hysteresis * self.dead_band

        def axis(line, rate, valve, since, pulses, locked):
            opens = jnp.where(line > self.dead_band, Valve.MINUS, Valve.PLUS)
            asked = jnp.where(jnp.abs(line) > self.dead_band, opens, Valve.CLOSED)
            ends = jnp.where(valve == Valve.PLUS, line > -inner, line < inner)
            following = jnp.where(
                valve == Valve.CLOSED, asked, jnp.where(ends, Valve.CLOSED, valve)
            )
            following = jnp.where(since < 1, valve, following)
            changed = following != valve
            pulses = pulses + (changed & (following != Valve.CLOSED))
            spinning = jnp.abs(rate) > 0.5
            locked = jnp.where(spinning, False, locked | (pulses > 5000))
            following = jnp.where(locked, Valve.CLOSED, following)
            since = jnp.where(changed, 0, jnp.minimum(since + 1, 1000))
            return following, since, pulses, locked

        valves, since, pulses, locked = jax.vmap(axis)(line, rate, *memory)
        torque = self.level * jnp.array([0.0, 1.0, -1.0])[valves]
        return torque, ValveMemory(valves, since, pulses, locked)


class ObserverMemory(NamedTuple):
    """Estimated rate and disturbance torque, covariance, last torque, and rejected samples."""

    rate: jax.Array
    disturbance: jax.Array
    covariance: jax.Array
    torque: jax.Array
    rejected: jax.Array
    started: jax.Array


class Observing(AbstractVisitor):
    """A Kalman filter of rates with gated innovations, and feedback of what it estimates."""

    declaration = LawDeclaration(
        summary="feedback of an observer",
        keys=(
            PERIOD,
            number("kp", "Gain on the attitude", "N m", above=0, tunable=True),
            number("kd", "Gain on the rate", "N m s", above=0, tunable=True),
            number("noise_rad_s", "Noise of the rate", "rad/s", above=0, default=1e-3),
            number("gate", "Largest innovation in sigmas", "1", above=0, default=6.0),
        ),
        torques=3,
    )

    kp: jax.Array
    kd: jax.Array
    noise: jax.Array
    gate: jax.Array

    def init(self, state):
        zero = jnp.zeros(3)
        return ObserverMemory(
            state.omega, zero, 1e-4 * jnp.eye(3), zero, jnp.array(0), jnp.array(False)
        )

    def step(self, t, state, memory):
        inertia = self.model.spacecraft.inertia
        h = self.period / 4

        def substep(_, rate):
            gyric = jnp.cross(rate, inertia @ rate)
            return rate + h * _solved(inertia, memory.torque + memory.disturbance - gyric)

        predicted = jax.lax.fori_loop(0, 4, substep, memory.rate)
        predicted = jnp.where(memory.started, predicted, state.omega)
        covariance = memory.covariance + 1e-8 * jnp.eye(3)
        total = covariance + self.noise**2 * jnp.eye(3)
        innovation = state.omega - predicted
        weighted = _solved(total, innovation)
        distance = innovation @ weighted
        fits = distance <= self.gate**2
        accepted = fits | (memory.rejected >= 5)
        rejected = jnp.where(accepted, 0, memory.rejected + 1)
        rate = predicted + jnp.where(accepted, covariance @ weighted, 0.0)
        learnt = 0.02 * inertia @ innovation / self.period
        disturbance = memory.disturbance + jnp.where(fits, jnp.clip(learnt, -0.01, 0.01), 0.0)
        columns = jax.vmap(lambda column: _solved(total, column), 1, 1)(covariance)
        updated = covariance - covariance @ columns
        covariance = jnp.where(accepted, 0.5 * (updated + updated.T), covariance)
        lost = jnp.trace(covariance) > 1.0
        covariance = jnp.where(lost, 1e-4 * jnp.eye(3), covariance)
        relative = rate - (state.omega - self.model.relative_rate(state))
        torque = -self.kp * attitude_error(state) - self.kd * relative - disturbance
        torque = jnp.clip(torque, -2.0, 2.0)
        made = ObserverMemory(rate, disturbance, covariance, torque, rejected, jnp.array(True))
        return torque, made


def _solved(matrix, vector):
    """Gaussian elimination with partial pivoting of a 3 x 3 system."""
    rows = jnp.concatenate([matrix, vector[:, None]], axis=1)
    for k in range(2):
        pivot = k + jnp.argmax(jnp.abs(rows[k:, k]))
        rows = rows.at[jnp.array([k, pivot])].set(rows[jnp.array([pivot, k])])
        for i in range(k + 1, 3):
            rows = rows.at[i].add(-rows[i, k] / rows[k, k] * rows[k])
    x = jnp.zeros(3)
    for i in (2, 1, 0):
        x = x.at[i].set((rows[i, 3] - rows[i, :3] @ x) / rows[i, i])
    return x
