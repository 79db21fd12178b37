"""Holds of a sampled loop divided where something fails, or an effector comes to an edge."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.simulation.located_edges import Integrate, through_located_parts
from jaxsat.spacecraft.dynamics import OfEach, PlantState, RigidBody
from jaxsat.spacecraft.held_effector import Hold


def through_hold(
    body: RigidBody,
    commands: OfEach,
    t: Float[Array, ""],
    hold: Hold,
    plant: PlantState,
    integrate: Integrate,
    carry: PyTree,
) -> tuple[PlantState, PyTree]:
    """The plant and the carry at the end of a hold that begins at time `t` (s).

    `integrate` goes through each part in which nothing fails and no effector of the `body` changes
    its mode under its command.
    """
    times = [one - t for one in body.failure_times]  # from the begin of the hold on
    at = jnp.concatenate([*times, jnp.zeros(0)])

    def through(elapsed, t, hold, plant, carry):
        struck = tuple(one <= elapsed for one in times)
        plant = body.after_failures(plant, struck)
        working_body, now = body.driven(plant, body.later(commands, elapsed), struck)
        return _between_failures(working_body, now, t, hold, plant, integrate, carry)

    if not at.size:
        return through(jnp.zeros_like(t), t, hold, plant, carry)

    def part(now):
        begin, plant, carry = now
        end = jnp.minimum(jnp.min(jnp.where(at > begin, at, hold.length)), hold.length)
        one = hold.part(begin, end - begin)
        return end, *through(begin, t + begin, one, plant, carry)

    def one(_, now):
        return jax.lax.cond(now[0] < hold.length, part, lambda now: now, now)

    first = (jnp.zeros_like(hold.length), plant, carry)
    return jax.lax.fori_loop(0, at.size + 1, one, first)[1:]


def _between_failures(
    body: RigidBody,
    commands: OfEach,
    t: Float[Array, ""],
    hold: Hold,
    plant: PlantState,
    integrate: Integrate,
    carry: PyTree,
) -> tuple[PlantState, PyTree]:
    """The plant and the carry at the end of a hold in which nothing fails.

    Where edges do not depend on how the body turns they are closed forms of the state at the begin.
    """
    if any(one.follows_body for one in body.effectors):
        return through_located_parts(body, commands, t, hold, plant, integrate, carry)
    parts = list(zip(body.effectors, plant.of_each, commands, strict=True))

    def pieces(begin, elapsed):
        held = [one.held_piece(own, command, elapsed) for one, own, command in parts]
        return body.later(tuple(held), begin)

    count = sum(one.edge_count for one in body.effectors)
    if not count:
        held = pieces(jnp.zeros_like(hold.length), hold.length)
        return integrate(t, hold._replace(pieces=held), plant, carry)
    edges = jnp.concatenate([one.edges(own, command, hold.length) for one, own, command in parts])

    def part(_, now):
        begin, plant, carry = now
        end = jnp.min(jnp.where(edges > begin, edges, hold.length))
        one = hold.part(begin, end - begin)._replace(pieces=pieces(begin, (begin + end) / 2))
        plant, carry = integrate(t + begin, one, plant, carry)
        states = tuple(
            one.snapped(own, command, end, now)
            for (one, own, command), now in zip(parts, plant.of_each, strict=True)
        )
        return end, PlantState(plant.attitude, plant.omega, states), carry

    first = (jnp.zeros_like(hold.length), plant, carry)
    return jax.lax.fori_loop(0, count + 1, part, first)[1:]
