"""Holds of a sampled loop divided where a wheel comes to rest or to its momentum limit."""

from collections.abc import Callable

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.dynamics import PlantState
from jaxsat.vehicle import Hold, Wheels


def through_hold(
    wheels: Wheels | None,
    command: Float[Array, " wheels"] | None,
    t: Float[Array, ""],
    hold: Hold,
    plant: PlantState,
    integrate: Callable[[Float[Array, ""], Hold, PlantState, PyTree], tuple[PlantState, PyTree]],
    carry: PyTree,
) -> tuple[PlantState, PyTree]:
    """The plant and the carry at the end of a hold that begins at time `t` (s).

    `integrate` goes through each part in which no wheel changes how it moves under the `command`
    (N m) that is held. The parts' ends are closed forms of the momenta at the begin.
    """
    momentum = plant.wheel_momentum
    if wheels is None or command is None or momentum is None:
        return integrate(t, hold, plant, carry)
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
