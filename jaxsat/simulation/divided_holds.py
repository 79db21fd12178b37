"""Holds of a sampled loop divided where something fails, or a wheel comes to rest or its limit."""

from typing import NamedTuple, cast

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.simulation.located_edges import Integrate, external_torque, through_located_parts
from jaxsat.spacecraft import AbstractActuators, Hold, Wheels
from jaxsat.spacecraft.dynamics import PlantState, RigidBody

__all__ = ["Asked", "external_torque", "through_hold"]


class Asked(NamedTuple):
    """What is asked of actuators until the next sample.

    `torque` (N m) is the command of `actuators` that fail in flight under an ideal torque, None for
    others, whose torque the hold has. `wheels` (N m) is what each wheel is to put on the body and
    `dipoles` (A m²) that of each magnetorquer; None without them.
    """

    torque: Float[Array, " torques"] | None = None
    wheels: Float[Array, " wheels"] | None = None
    dipoles: Float[Array, " k"] | None = None


class _Struck(NamedTuple):
    """Which failures of ideal actuators, of wheels and of magnetorquers have struck."""

    actuators: Bool[Array, " a"]
    wheels: Bool[Array, " w"]
    magnetorquers: Bool[Array, " k"]


def through_hold(
    body: RigidBody,
    actuators: AbstractActuators | None,
    asked: Asked,
    t: Float[Array, ""],
    hold: Hold,
    plant: PlantState,
    integrate: Integrate,
    carry: PyTree,
) -> tuple[PlantState, PyTree]:
    """The plant and the carry at the end of a hold that begins at time `t` (s).

    `integrate` goes through each part in which nothing fails and no wheel of the `body` changes how
    it moves under what is `asked`.
    """
    times = _failure_times(body, actuators, asked)
    ends = (times.actuators.size, times.actuators.size + times.wheels.size)
    at = jnp.concatenate(times) - t  # from the begin of the hold on

    def through(struck, t, hold, plant, carry):
        plant, hold, wheels, command = _after(body, actuators, asked, struck, hold, plant)
        return _between_failures(body, wheels, command, t, hold, plant, integrate, carry)

    if not at.size:
        return through(_Struck(*jnp.split(at <= 0, ends)), t, hold, plant, carry)

    def part(now):
        begin, plant, carry = now
        end = jnp.minimum(jnp.min(jnp.where(at > begin, at, hold.length)), hold.length)
        struck = _Struck(*jnp.split(at <= begin, ends))
        one = hold.part(begin, end - begin)
        return end, *through(struck, t + begin, one, plant, carry)

    def one(_, now):
        return jax.lax.cond(now[0] < hold.length, part, lambda now: now, now)

    first = (jnp.zeros_like(hold.length), plant, carry)
    return jax.lax.fori_loop(0, at.size + 1, one, first)[1:]


def _failure_times(body: RigidBody, actuators, asked: Asked) -> _Struck:
    """When something fails, s."""
    never = jnp.zeros(0)

    wheels, torquers = body.wheels, body.magnetorquers
    return _Struck(
        never if asked.torque is None else actuators.failure_times,
        never if wheels is None or asked.wheels is None else wheels.failure_times,
        never if torquers is None or asked.dipoles is None else torquers.failure_times,
    )


def _after(
    body: RigidBody, actuators, asked: Asked, struck: _Struck, hold: Hold, plant: PlantState
) -> tuple[PlantState, Hold, Wheels | None, Float[Array, " wheels"] | None]:
    """Plant, hold, and wheels with their command once failures have struck."""
    wheels, command = body.wheels, asked.wheels
    if asked.torque is not None:
        hold = hold._replace(torque=actuators.after_failures(struck.actuators)(asked.torque))
    if asked.dipoles is not None and body.magnetorquers is not None:
        one = body.magnetorquers
        hold = hold._replace(dipole=one.axes @ one.dipoles(asked.dipoles, struck.magnetorquers))
    if wheels is not None and wheels.failures is not None and command is not None:
        plant = body.after_wheel_failures(plant, struck.wheels)
        assert plant.wheel_momentum is not None
        condition = wheels.failures.condition(struck.wheels, wheels.count)
        wheels, command = wheels.driven(condition, plant.wheel_momentum, command)
    return plant, hold, wheels, command


def _between_failures(
    body: RigidBody,
    wheels: Wheels | None,
    command: Float[Array, " wheels"] | None,
    t: Float[Array, ""],
    hold: Hold,
    plant: PlantState,
    integrate: Integrate,
    carry: PyTree,
) -> tuple[PlantState, PyTree]:
    """The plant and the carry at the end of a hold in which nothing fails.

    Without a rotor inertia the ends of its parts are closed forms of the momenta at the begin.
    """
    momentum = plant.wheel_momentum
    if wheels is None or command is None or momentum is None:
        return integrate(t, hold, plant, carry)
    if wheels.rotor_inertia is not None and (wheels.edge_count or wheels.seized is not None):
        return through_located_parts(body, wheels, command, t, hold, plant, integrate, carry)
    if not wheels.edge_count:
        piece = wheels.piece(momentum, command, hold.length)
        return integrate(t, hold._replace(wheels=piece), plant, carry)
    edges = wheels.edges(momentum, command, hold.length)

    def part(_, now):
        begin, plant, carry = now
        end = jnp.min(jnp.where(edges > begin, edges, hold.length))
        one = hold.part(begin, end - begin)
        piece = wheels.piece(momentum, command, (begin + end) / 2)
        plant, carry = integrate(t + begin, one._replace(wheels=piece), plant, carry)
        reached = wheels.snapped(momentum, command, end, cast(Array, plant.wheel_momentum))
        return end, PlantState(plant.attitude, plant.omega, reached), carry

    first = (jnp.zeros_like(hold.length), plant, carry)
    return jax.lax.fori_loop(0, wheels.edge_count + 1, part, first)[1:]
