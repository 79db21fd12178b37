"""State of a trajectory in progress, and its outputs at the end."""

from collections.abc import Mapping
from typing import Literal, NamedTuple, get_args

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Int, PyTree

from jaxsat.core.array_types import BoolScalar, IntScalar, RealScalar, Vector
from jaxsat.core.checks import as_optional_float, concrete, not_negative, require_positive
from jaxsat.core.declaration.actuators import SIGNALS
from jaxsat.core.quotients import reciprocal
from jaxsat.core.tolerances import SettlingTracker, Tolerances
from jaxsat.core.trigonometry import cos
from jaxsat.simulation.assessment import IntegrationError, JudgedSignals, stop_gradient
from jaxsat.simulation.engine.failure_record import FailureRecord
from jaxsat.simulation.held_torque import HeldTorque, Unmade
from jaxsat.simulation.requirements import Margin, Monitor
from jaxsat.simulation.trajectory import Details, Outcome, Signals
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class Unsettled(eqx.Module):
    """Smooth indicator of "not settled": near 1 outside the tolerances, near 0 inside.

    With s = |w|²/w_tol² + 4 sin²(z/2)/z_tol² + |ω_r|²/ω_tol² the indicator is s²/(1 + s²); its
    integral is a smooth settling time, s, which also counts later exits.
    """

    tolerances: Tolerances = eqx.field(default_factory=Tolerances)

    def __call__(self, w: Float[Array, "2"], z: RealScalar, relative_rate: Vector) -> RealScalar:
        """The indicator's value at one instant."""
        limits = self.tolerances
        size = (
            jnp.sum(w**2) / limits.w**2
            + 4 * jnp.sin(z / 2) ** 2 / limits.z**2
            + jnp.sum(relative_rate**2) / limits.relative_rate**2
        )
        return 1 - 1 / (1 + size**2)


AttitudeCost = Literal["rotation", "wz"]


class RunningCost(eqx.Module):
    """w A + z B + relative_rate |ω_r|² + torque Σ T_i² + settling U, integrated over time.

    With `attitude` "rotation" A = sin²(tilt/2) = q1² + q2² and B = 4 q3² of the unit quaternion:
    smooth over all rotations, zero at the target alone and at most 1 and 4. With "wz" they are |w|²
    and z², equal to the former to second order near the target; |w|² is unbounded upside down, and
    z is used as integrated, unwrapped in (w, z) parameters. U is `unsettled`, which a positive
    `settling` requires.

    With a `limit` c_max the cost rate c saturates as c / (1 + c/c_max), and a run that ends early
    is charged c_max for every missing second, so that the cost of any run is at most c_max times
    its horizon. Without a limit (None) the cost of such a run is NaN.
    """

    w: RealScalar = eqx.field(converter=not_negative("w"), default=1.0)
    z: RealScalar = eqx.field(converter=not_negative("z"), default=1.0)
    relative_rate: RealScalar = eqx.field(converter=not_negative("relative_rate"), default=100.0)
    torque: RealScalar = eqx.field(converter=not_negative("torque"), default=1e-3)
    settling: RealScalar = eqx.field(converter=not_negative("settling"), default=0.0)
    unsettled: Unsettled | None = None
    limit: RealScalar | None = eqx.field(converter=as_optional_float, default=None)
    attitude: AttitudeCost = eqx.field(static=True, default="rotation")

    def __check_init__(self):
        if self.limit is not None:
            require_positive("limit", self.limit)
        settling = concrete(self.settling)
        if self.unsettled is None and settling is not None and settling.any():
            raise ValueError(
                "Argument `settling` must be zero unless `unsettled` says when a case counts as "
                f"settled, but got {settling.tolist()}."
            )
        if self.attitude not in get_args(AttitudeCost):
            raise ValueError(
                f'Argument `attitude` must be "rotation" or "wz", but got {self.attitude!r}.'
            )

    def __call__(
        self, w: Float[Array, "2"], z: RealScalar, relative_rate: Vector, torque: Vector
    ) -> RealScalar:
        """The cost rate, per second."""
        cost = (
            self._of_attitude(w, z)
            + self.relative_rate * jnp.sum(relative_rate**2)
            + self.torque * jnp.sum(torque**2)
        )
        if self.unsettled is not None:
            cost = cost + self.settling * self.unsettled(w, z, relative_rate)
        return cost if self.limit is None else cost / (1 + cost / self.limit)

    def _of_attitude(self, w: Float[Array, "2"], z: RealScalar) -> RealScalar:
        """The cost rate w A + z B, per second."""
        square = jnp.sum(w**2)
        if self.attitude == "wz":
            return self.w * square + self.z * z**2
        upright = reciprocal(1 + square)  # cos²(tilt/2); 2 - 2 cos z = 4 sin²(z/2)
        return self.w * (1 - upright) + self.z * (2 - 2 * cos(z)) * upright

    def whole(self, integral: RealScalar, success: BoolScalar, missing: RealScalar) -> RealScalar:
        """The cost of a run from its integral; a failed run has `missing` seconds."""
        charged = jnp.nan if self.limit is None else integral + self.limit * missing
        return jnp.where(success, integral, charged)


Since = tuple[SettlingTracker, SettlingTracker | None]
"""Trackers of settling, and of rest; None where rest is not tracked."""


class Integrals(NamedTuple):
    """Integrals of the running cost and of Σ|T_i| (N m s), in a detailed program of each |T_i|."""

    cost: RealScalar
    effort: Float[Array, "*effort"]


class Progress(NamedTuple):
    """A trajectory in progress.

    `peak_square` is the largest |ω|² (rad²/s²) at the observed instants. `settled` tracks since
    when the tolerances have been met, judged at every step; `ended_at` is the time (s) up to which
    the state is good. With adaptive steps, `step` (s) is the next to be tried and `steps` the
    number of tried ones. `peaks` are the largest sizes, at the observed instants, of the effectors'
    stored quantities, by the column of a study. `failures` is for sampled loops with failures.
    `error` is the estimate of equal steps, where the program has one. `held_torque` is that of a
    sampled loop since its last observation, None for other loops. `rest` tracks since when the
    inertial rate has been small, and `forced` counts the smallest steps taken in spite of their
    error, where steps are adaptive; both in a detailed program alone. `unmade` is for sampled loops
    that give it. `sums` are the signals of a sampled loop at the begin of its last advance (means
    over it, of those so declared), in a detailed program alone. `monitors` belong to the program's
    requirements.
    """

    state: PyTree
    integrals: Integrals
    peak_square: RealScalar
    settled: SettlingTracker
    ended_at: RealScalar
    code: IntScalar
    step: RealScalar
    steps: IntScalar
    peaks: dict[str, Array]
    failures: FailureRecord | None = None
    held_torque: HeldTorque | None = None
    error: IntegrationError | None = None
    rest: SettlingTracker | None = None
    forced: IntScalar | None = None
    unmade: Unmade | None = None
    sums: Signals | None = None
    monitors: tuple[Monitor, ...] = ()


class Outputs(NamedTuple):
    """The outputs of a case; NaN (settling time: infinite) where it did not reach its end.

    Code (see `Outcome`), settling time (s), effort (N m s), cost (also of a failed run, where the
    running cost has a limit), peak |ω| at the observed instants (rad/s), end of the good part (s);
    attitude and ω (rad/s) at the end of the horizon; and the draws by name. `parts` has by column
    the effectors' consumption, the peaks, at the observed instants, of stored quantities, see
    `jaxsat.core.declaration.actuator.Signal`, and the outputs of `Unmade`. `failures` has those of
    `FailureRecord`, of sampled loops with failures in flight, and `details` those of a detailed
    program. `integration_error`, up to the end of the good part, is None unless the program
    estimates it, and `requirements` has each margin if the program has requirements. With a leading
    axis these are the outputs of many cases.
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
    parts: dict[str, Array]
    failures: dict[str, Array] | None = None
    details: Details | None = None
    integration_error: IntegrationError | None = None
    requirements: Margin | None = None


def initial_progress(
    state: PyTree, body: RigidBody, plant: PlantState, possible, step: float | Array = 0.0
) -> Progress:
    """Progress at time zero, with the plant of this body in its state, effectors included.

    An impossible case ends there.
    """
    zero = jnp.zeros((), plant.omega.dtype)
    peaks = jax.tree.map(jnp.zeros_like, peaks_of(body.stored(plant)))
    code = jnp.where(possible, int(Outcome.SUCCESS), int(Outcome.IMPOSSIBLE_CASE))
    integrals = Integrals(zero, zero)
    nothing = jnp.array(0)
    tracker = SettlingTracker.initial(zero, 3)
    return Progress(state, integrals, zero, tracker, zero, code, zero + step, nothing, peaks)


def peaks_of(stored: Mapping[str, Array | np.ndarray]) -> dict[str, Array]:
    """The absolute values of signals that have peaks in a study, by its columns."""
    columns = {name: SIGNALS[name].column for name in stored if name in SIGNALS}
    return {column: jnp.abs(stored[name]) for name, column in columns.items() if column}


def with_peaks(
    progress: Progress, omega: Vector, stored: Mapping[str, Array | np.ndarray]
) -> Progress:
    """The progress with one more instant in the peaks of ω (rad/s) and of stored signals."""
    sizes = peaks_of(stored)
    peaks = {name: jnp.maximum(peak, sizes[name]) for name, peak in progress.peaks.items()}
    square = jnp.maximum(progress.peak_square, jnp.sum(omega**2))
    return progress._replace(peak_square=square, peaks=peaks)


def judged_at(
    since: Since, t: RealScalar, observation: JudgedSignals, tolerances: Tolerances
) -> Since:
    """The trackers of settling and rest after the end of one more of equal steps.

    Nothing is differentiated.
    """
    tracker, rest = since
    tracker = tracker.observe(*stop_gradient((t, observation.excess(tolerances))))
    if rest is not None:
        rest = rest.observe(*stop_gradient((t, observation.rest_excess(tolerances))))
    return tracker, rest


def outputs_of(
    progress: Progress,
    plant: PlantState,
    end: RealScalar,
    drawn: dict[str, Array],
    cost: RunningCost | None,
    consumption: dict[str, Array] | None = None,
    interval: float | Array = 1.0,
    details: Details | None = None,
    dwell: RealScalar | None = None,
    begin: float | RealScalar = 0.0,
) -> Outputs:
    """Outputs of a trajectory from `begin` to `end` (s), observed every `interval` (s) and at its
    end.

    Settling requires `dwell` seconds, see `SettlingTracker.settling_time`. `consumption` covers the
    whole run, by signal.
    """
    effort = progress.integrals.effort if details is None else jnp.sum(details.effort)
    success = progress.code == int(Outcome.SUCCESS)

    def or_nan(value):
        return jnp.where(success, value, jnp.nan)

    possible = progress.code != int(Outcome.IMPOSSIBLE_CASE)
    whole, missing = jnp.full_like(progress.integrals.cost, jnp.nan), end - progress.ended_at
    if cost is not None:
        whole = cost.whole(progress.integrals.cost, success, missing)
    wz, quaternion = plant.attitude.as_wz(), plant.attitude.as_quaternion()
    failures, error = progress.failures, progress.error
    unmade = {} if progress.unmade is None else progress.unmade.outputs()
    return Outputs(
        code=progress.code,
        settling_time=jnp.where(
            success, progress.settled.settling_time(end, begin, dwell), jnp.inf
        ),
        effort=or_nan(effort),
        cost=jnp.where(possible, whole, jnp.nan),
        peak_rate=or_nan(jnp.sqrt(progress.peak_square)),
        ended_at=progress.ended_at,
        w=or_nan(wz.w),
        z=or_nan(wz.z),
        quaternion=or_nan(quaternion.q),
        omega=or_nan(plant.omega),
        drawn=drawn,
        parts=jax.tree.map(or_nan, (consumption or {}) | progress.peaks | unmade),
        failures=None if failures is None else failures.outputs(jnp.asarray(interval)),
        details=details,
        integration_error=error,
    )
