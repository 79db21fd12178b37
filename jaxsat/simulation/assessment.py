"""What a whole run was, judged on its integrator's own steps, whatever instants are saved."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float, PyTree

from jaxsat.core.tolerances import SettlingTracker, Tolerances, excess
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class Assessment(eqx.Module):
    """When a run settled, and what that took.

    `settled_from` (s) is the instant from which attitude and relative rate, `at_rest_from` that
    from which the inertial rate alone, stayed within the tolerances to the end; infinite where that
    began after 0.9 of the horizon or never. `effort` is ∫|T_i| dt of the thrusters by body axis
    and `constraint_effort` that of the ideal torque by which the third rate is held, None where it
    is free, both in N m s; NaN where the run did not reach its end. A case that an engine has
    replayed tells `settled_from` alone, the others are None.
    """

    settled_from: Float[Array, ""]
    at_rest_from: Float[Array, ""] | None = None
    effort: Float[Array, "3"] | None = None
    constraint_effort: Float[Array, ""] | None = None


class Observation(NamedTuple):
    """What of the signals settling is judged by; see `Signals`."""

    w: Float[Array, "2"]
    z: Float[Array, ""]
    relative_rate: Float[Array, "3"]
    omega: Float[Array, "3"]

    @staticmethod
    def of(plant: RigidBody, state: PlantState) -> "Observation":
        """That of a plant in a state."""
        wz = state.attitude.as_wz()
        return Observation(wz.w, wz.z, plant.relative_rate(state), state.omega)

    def excess(self, tolerances: Tolerances) -> Float[Array, "3"]:
        """How far outside the tolerances, see `jaxsat.core.tolerances.excess`."""
        return excess(self.w, self.z, self.relative_rate, tolerances)

    def rest_excess(self, tolerances: Tolerances) -> Float[Array, "1"]:
        """The same of the inertial rate alone."""
        return jnp.sqrt(jnp.sum(self.omega**2))[None] / tolerances.relative_rate - 1


class MonitorSample(NamedTuple):
    """What a monitor sees at one instant.

    `excess` is how far outside each group of conditions a run is, and `rate` is to be integrated.
    """

    excess: tuple[Float[Array, " _"], ...]
    rate: Float[Array, " m"]


Monitor = Callable[[Float[Array, ""], PyTree], MonitorSample]
"""Takes a time (s) and the state that is integrated."""


class EntryBracket(NamedTuple):
    """The step in which all of a group's conditions were met again, and between which fractions.

    `low` is infinite before the first one.
    """

    begin: Float[Array, ""]
    end: Float[Array, ""]
    dense: PyTree
    low: Float[Array, ""]
    high: Float[Array, ""]


class MonitorRecord(NamedTuple):
    """What a monitor has seen up to the end of the last step."""

    since: tuple[SettlingTracker, ...]
    entries: tuple[EntryBracket, ...]
    rate: Float[Array, " m"]
    integral: Float[Array, " m"]


class MonitoredState(NamedTuple):
    """The state of a solver and the record of its monitor."""

    solver: Any
    record: MonitorRecord


def effort_rate(
    plant: RigidBody, t: Float[Array, ""], state: PlantState, torque: Float[Array, "3"]
) -> Float[Array, " m"]:
    """|T_i| of the thrusters (N m) and, where the third rate is held, |T| of what holds it."""
    held = plant.constraint_torque(t, state, torque)
    return jnp.abs(torque if held is None else jnp.append(torque, held))


def assessment(
    plant: RigidBody,
    since: tuple[SettlingTracker, SettlingTracker],
    integral: Float[Array, " m"],
    times: Float[Array, " times"],
    success: Bool[Array, ""],
    dwell: Float[Array, ""] | None,
) -> Assessment:
    """What a run from `times[0]` to `times[-1]` (s) was, from what was seen of it."""
    settled, rest = (
        jnp.where(success, tracker.settling_time(times[-1], times[0], dwell), jnp.inf)
        for tracker in since
    )
    integral = jnp.where(success, integral, jnp.nan)
    return Assessment(settled, rest, integral[:3], integral[3] if plant.third_rate_held else None)


def stop_gradient(tree: PyTree) -> PyTree:
    """The tree with nothing to be differentiated."""
    return jax.tree.map(lambda x: jax.lax.stop_gradient(x) if eqx.is_array(x) else x, tree)
