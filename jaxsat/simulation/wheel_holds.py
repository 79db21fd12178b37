"""Holds of a sampled loop divided where a wheel fails, comes to rest or to its momentum limit."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.dynamics import PlantState, RigidBody
from jaxsat.vehicle import Hold, Wheels

Integrate = Callable[[Float[Array, ""], Hold, PlantState, PyTree], tuple[PlantState, PyTree]]


def through_hold(
    body: RigidBody,
    command: Float[Array, " wheels"] | None,
    t: Float[Array, ""],
    hold: Hold,
    plant: PlantState,
    integrate: Integrate,
    carry: PyTree,
) -> tuple[PlantState, PyTree]:
    """The plant and the carry at the end of a hold that begins at time `t` (s).

    `integrate` goes through each part in which no wheel of the `body` changes how it moves under
    the `command` (N m) that is held.
    """
    wheels = body.wheels
    if wheels is None or command is None or plant.wheel_momentum is None:
        return integrate(t, hold, plant, carry)
    failures = wheels.failures
    if failures is None:
        return _between_failures(wheels, command, t, hold, plant, integrate, carry)
    at = failures.at - t  # from the begin of the hold on

    def part(now):
        begin, plant, carry = now
        end = jnp.minimum(jnp.min(jnp.where(at > begin, at, hold.length)), hold.length)
        condition = failures.condition(at <= begin, wheels.count)
        plant = body.with_wheels_stopped(plant, condition.stopped)
        assert plant.wheel_momentum is not None
        struck, torque = wheels.driven(condition, plant.wheel_momentum, command)
        one = hold.part(begin, end - begin)
        return end, *_between_failures(struck, torque, t + begin, one, plant, integrate, carry)

    def one(_, now):
        return jax.lax.cond(now[0] < hold.length, part, lambda now: now, now)

    first = (jnp.zeros_like(hold.length), plant, carry)
    return jax.lax.fori_loop(0, failures.count + 1, one, first)[1:]


def _between_failures(
    wheels: Wheels, command, t, hold: Hold, plant: PlantState, integrate: Integrate, carry: PyTree
) -> tuple[PlantState, PyTree]:
    """The plant and the carry at the end of a hold in which no wheel fails.

    The ends of its parts are closed forms of the momenta at the begin.
    """
    momentum = plant.wheel_momentum
    assert momentum is not None
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
        return end, plant, carry

    first = (jnp.zeros_like(hold.length), plant, carry)
    return jax.lax.fori_loop(0, wheels.edge_count + 1, part, first)[1:]
