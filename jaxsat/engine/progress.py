"""What is kept of a trajectory while it runs and what is told of it at the end."""

from typing import NamedTuple

import equinox as eqx
import jax.numpy as jnp
from jaxtyping import Array, Float, Int, PyTree

from jaxsat.checks import as_float, require_positive
from jaxsat.dynamics import PlantState
from jaxsat.metrics import Tolerances, within
from jaxsat.simulation import Outcome, Signals

SETTLED_BEFORE = 0.9
"""The part of the horizon in which a case must have begun to be settled."""


class RunningCost(eqx.Module):
    """w |w|² + z z² + relative_rate |ω_r|² + torque Σ T_i², to be integrated over time.

    z counts as it is integrated, unwrapped in (w, z) parameters.
    """

    w: Float[Array, ""] = eqx.field(converter=as_float, default=1.0)
    z: Float[Array, ""] = eqx.field(converter=as_float, default=1.0)
    relative_rate: Float[Array, ""] = eqx.field(converter=as_float, default=100.0)
    torque: Float[Array, ""] = eqx.field(converter=as_float, default=1e-3)

    def __check_init__(self):
        for name in ("w", "z", "relative_rate", "torque"):
            require_positive(name, getattr(self, name), zero_allowed=True)

    def __call__(
        self,
        w: Float[Array, "2"],
        z: Float[Array, ""],
        relative_rate: Float[Array, "3"],
        torque: Float[Array, "3"],
    ) -> Float[Array, ""]:
        """The cost a second."""
        return (
            self.w * jnp.sum(w**2)
            + self.z * z**2
            + self.relative_rate * jnp.sum(relative_rate**2)
            + self.torque * jnp.sum(torque**2)
        )


class Integrals(NamedTuple):
    """The running cost and Σ|T_i| (N m s), integrated."""

    cost: Float[Array, ""]
    effort: Float[Array, ""]


class Progress(NamedTuple):
    """A trajectory that is under way.

    `settled_from` is the time (s) since which the tolerances have been met, infinite while they
    are not; `ended_at` the time up to which the state is good. `step` (s) is the next to be tried
    and `steps` the number of those tried, where steps are adaptive.
    """

    state: PyTree
    integrals: Integrals
    peak_rate: Float[Array, ""]
    settled_from: Float[Array, ""]
    ended_at: Float[Array, ""]
    code: Int[Array, ""]
    step: Float[Array, ""]
    steps: Int[Array, ""]


class Outputs(NamedTuple):
    """What is told of a case; NaN (never settled: infinite) where it did not reach its end.

    Code (see `Outcome`), settling time (s), effort (N m s), cost, peak |ω| at the instants looked
    at (rad/s), end of the good part (s); attitude and ω (rad/s) at the end of the horizon; and
    what was drawn, by name. With a leading axis these are the outputs of many cases.
    """

    code: Int[Array, "*n"]
    settling_time: Float[Array, "*n"]
    effort: Float[Array, "*n"]
    cost: Float[Array, "*n"]
    peak_rate: Float[Array, "*n"]
    ended_at: Float[Array, "*n"]
    w: Float[Array, "*n 2"]
    z: Float[Array, "*n"]
    quaternion: Float[Array, "*n 4"]
    omega: Float[Array, "*n 3"]
    drawn: dict[str, Array]


def begun(state: PyTree, omega: Float[Array, "3"], possible, step: float | Array = 0.0) -> Progress:
    """Progress at time zero; a case that cannot exist has ended there."""
    zero = jnp.zeros((), omega.dtype)
    code = jnp.where(possible, int(Outcome.SUCCESS), int(Outcome.IMPOSSIBLE_CASE))
    integrals = Integrals(zero, zero)
    nothing = jnp.array(0)
    return Progress(state, integrals, zero, zero + jnp.inf, zero, code, zero + step, nothing)


def looked_at(
    progress: Progress, t: Float[Array, ""], signals: Signals, tolerances: Tolerances
) -> Progress:
    """Settling and peak rate with one more instant taken into account."""
    good = within(signals.w[None], signals.z[None], signals.relative_rate[None], tolerances)[0]
    since = jnp.where(jnp.isinf(progress.settled_from), t, progress.settled_from)
    rate = jnp.sqrt(jnp.sum(signals.omega**2))
    return progress._replace(
        settled_from=jnp.where(good, since, jnp.inf),
        peak_rate=jnp.maximum(progress.peak_rate, rate),
    )


def outputs_of(
    progress: Progress, plant: PlantState, duration: Float[Array, ""], drawn: dict[str, Array]
) -> Outputs:
    """Outputs of a trajectory whose last instant has been looked at."""
    success = progress.code == int(Outcome.SUCCESS)
    settled = success & (progress.settled_from <= SETTLED_BEFORE * duration)

    def kept(value):
        return jnp.where(success, value, jnp.nan)

    wz, quaternion = plant.attitude.as_wz(), plant.attitude.as_quaternion()
    return Outputs(
        code=progress.code,
        settling_time=jnp.where(settled, progress.settled_from, jnp.inf),
        effort=kept(progress.integrals.effort),
        cost=kept(progress.integrals.cost),
        peak_rate=kept(progress.peak_rate),
        ended_at=progress.ended_at,
        w=kept(wz.w),
        z=kept(wz.z),
        quaternion=kept(quaternion.q),
        omega=kept(plant.omega),
        drawn=drawn,
    )
