"""Additional outputs of a single run."""

import jax.numpy as jnp
from jaxtyping import Array, Float, PyTree

from jaxsat.core.array_types import IntScalar, RealScalar
from jaxsat.core.tolerances import SettlingTracker
from jaxsat.simulation.engine.progress import Progress
from jaxsat.simulation.loops import AbstractLoop
from jaxsat.simulation.trajectory import Details, Outcome
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


def with_details(progress: Progress, loop: AbstractLoop, torques: int) -> Progress:
    """Progress at time zero with the records for `Details`, of this number of torques."""
    zero = progress.integrals.cost
    count = torques + loop.plant.third_rate_held
    return progress._replace(
        rest=SettlingTracker.initial(zero, 1),
        integrals=progress.integrals._replace(effort=jnp.zeros(count, zero.dtype)),
    )


def details_of(
    progress: Progress,
    loop: AbstractLoop,
    final: PyTree,
    end: RealScalar,
    steps: IntScalar,
    dwell: RealScalar | None,
    begin: float | RealScalar = 0.0,
) -> Details | None:
    """The details of a trajectory from its `begin` to its `end` (s), in the loop's state `final`.

    Rest requires `dwell` seconds, see `SettlingTracker.settling_time`.
    """
    if progress.rest is None:
        return None
    success = progress.code == int(Outcome.SUCCESS)
    effort = jnp.where(success, progress.integrals.effort, jnp.nan)
    is_held = loop.plant.third_rate_held
    of_axes = effort[:-1] if is_held else effort
    idle = jnp.zeros(3 - of_axes.size, effort.dtype)
    rest = jnp.where(success, progress.rest.settling_time(end, begin, dwell), jnp.inf)
    by_axis = jnp.concatenate([of_axes, jnp.where(success, idle, jnp.nan)])
    return Details(final, steps, rest, by_axis, effort[-1] if is_held else None, progress.forced)


def effort_rates(
    detailed: bool,
    plant: RigidBody,
    t: RealScalar,
    state: PlantState,
    torque: Float[Array, " m"],
    size: Float[Array, " m"],
) -> Float[Array, "*effort"]:
    """Rate of the effort (N m): Σ `size` over the torques.

    In a `detailed` program one rate per torque, plus that of the constraint on a held third rate.
    """
    if not detailed:
        return jnp.sum(size)
    constraint = plant.constraint_torque(t, state, torque)
    return size if constraint is None else jnp.append(size, jnp.abs(constraint))
