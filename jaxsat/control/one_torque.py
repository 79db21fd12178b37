"""All three rates to zero with one torque about a fixed axis.

The momentum across the torque axis b turns in the body only by gyroscopic torque. Held at zero
momentum about b it turns by itself to one direction, d ∝ J⁻¹b × b, where a spin about b of either
sense reduces it; docs/one_torque.md has the derivation.
"""

import enum
from collections.abc import Mapping
from typing import Annotated, Any, ClassVar, NamedTuple, cast

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.control.controller import LawContext, UnsuitableModel
from jaxsat.control.inertia_fit import InertiaFit, InertiaMemory, TorqueAxisFrame
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.allocation import torque_axis
from jaxsat.core.array_types import BoolScalar, IntScalar, Matrix, RealScalar
from jaxsat.core.checks import as_float, positive
from jaxsat.core.declaration import LawDeclaration
from jaxsat.core.declaration.one_torque import ONE_TORQUE
from jaxsat.core.declaration.tuned_gains import Scaling
from jaxsat.core.inertia import LEAST_TORQUE_TILT, torque_axis_frame
from jaxsat.core.quotients import SMALLEST, cube_root
from jaxsat.spacecraft.dynamics import PlantState

RATE_GAIN = 12.0
"""Default of the inner loop's gain, times the `loop_time` of `Scaling`."""

RATE_NOISE, TORQUE_NOISE = 3e-6, 2e-3
"""Noise in the least squares: of a rate, rad per `fine_time`, and unknown torques besides the
periodic one, relative to the torque limit."""

HELD = 0.52
"""Share of the torque limit that holds the momentum about b against gyroscopic torque."""

OVERWHELMED, RECOVERED = 1.15, 0.6
"""Gyroscopic torque over the torque limit at which pure damping begins and ends."""

MOST_GROWTH, REGROWTH = 4.0, 0.8
"""Momentum at which pure damping begins, over the larger of √(ηT / γ) and the initial momentum, and
the share of it at which damping ends."""

BRAKE_SIDE = 1.7
"""A brake may be faster than a turn where |y| is below this times x."""

PASSED, FAST = 0.5, 0.3
"""A brake continues past y = 0 while |y| is below the first share of the remaining turn of y, and
the spin above the second share of the demanded one."""

SLOW, QUICK, SPIN = 0.25, 0.5, 2.3
"""Momentum across b, over √(ηT / γ), below which the law spins up to turn faster, and at which it
stops to; and the spin's momentum over that."""

STILL, BRAKED = 1.3, 0.3
"""Spinning up begins below this ratio of momentum about b to that across it, where no brake of this
share of the largest can begin."""

LEFT = 0.15
"""Share of the rest rate that remains after a brake."""

LEAVE_REST = 1.2
"""Rate over the rest rate at which the law resumes."""


class OneTorqueMode(enum.IntEnum):
    """Modes of the law."""

    DAMPING = 1
    TURNING = 2
    BRAKING = 3
    SPINNING_UP = 4
    RESTING = 5


class Momenta(NamedTuple):
    """Momenta along b, d and e, N m s."""

    w: RealScalar
    x: RealScalar
    y: RealScalar


class Wanted(NamedTuple):
    """The demanded momentum about b (N m s), its derivative (N m), and the mode."""

    momentum: RealScalar
    derivative: RealScalar
    mode: IntScalar


class OneTorqueMemory(NamedTuple):
    """The estimate, whether the law damps, spins up or rests, the mode, and the largest credible
    momentum (N m s), beyond which the model is wrong."""

    fit: InertiaMemory
    damps: BoolScalar
    spins: BoolScalar
    rests: BoolScalar
    mode: Annotated[IntScalar, OneTorqueMode]
    most: RealScalar


class OneTorque(AbstractSampledController):
    """Turns the momentum (x, y) across b to y = 0, x > 0, and brakes it there by spinning about b.

    With w the momentum about b, dx/dt = -γw² + w((α-ζ)y - ηx) + γy² and dy/dt = w((δ-α)x + ηy) -
    γxy. The law demands w = -C / (pγy), with which |y| decreases as xᵖ, within ± r √(x² + y²) while
    it turns and ± (3ηT x / γ)^⅓ while it brakes, which a torque of ηT follows to x = 0 in finite
    time. Below `rest_rate` (rad/s) it rests. Rates with gyroscopic torques beyond `torque_limit` T
    (N m), and growing momentum, are damped by a torque against b·ω; a small momentum, which turns
    slowly, is increased first. `share` is η, `turn_ratio` r, `exponent` p; `rate_gain` (1/s) is the
    gain on w, `period` in s. The rows of `principal` are the principal axes of the model, in which
    `fit` works.
    """

    declaration: ClassVar[LawDeclaration] = ONE_TORQUE
    modes: ClassVar[type[enum.IntEnum]] = OneTorqueMode

    fit: InertiaFit
    principal: Matrix = eqx.field(converter=as_float)
    torque_limit: RealScalar = eqx.field(converter=positive("torque_limit"))
    share: RealScalar = eqx.field(converter=positive("share"))
    turn_ratio: RealScalar = eqx.field(converter=positive("turn_ratio"))
    exponent: RealScalar = eqx.field(converter=positive("exponent"))
    rate_gain: RealScalar = eqx.field(converter=positive("rate_gain"))
    rest_rate: RealScalar = eqx.field(converter=positive("rest_rate"))
    period: RealScalar = eqx.field(converter=positive("period"))
    estimates: bool = eqx.field(static=True, default=True)

    @classmethod
    def from_table(cls, values: Mapping[str, Any], context: LawContext) -> "OneTorque":
        """The law from a scenario's table.

        Raises `UnsuitableModel` where the torque axis is a principal axis.
        """
        inertia = np.asarray(context.model.spacecraft.inertia, float)
        axis = torque_axis(context.torque_axes)
        _, mobility = torque_axis_frame(inertia, axis)
        if not mobility[0, 2] > LEAST_TORQUE_TILT * mobility[0, 0]:
            raise UnsuitableModel(
                "inertia",
                "can stop the rotation, which takes a torque axis that is no principal axis: a "
                "torque about principal axis 1 never changes (J1-J2) J2 ω2² + (J1-J3) J3 ω3², got "
                f"principal moments {np.linalg.eigvalsh(inertia).round(6).tolist()} kg m² and the "
                f"torque axis {axis.round(6).tolist()}",
            )
        shares = np.linalg.pinv(context.torque_axes) @ axis
        limit = cast(float, context.torque_limit) / float(np.abs(shares).max())
        period = values["period_s"]
        scaling = Scaling.of(1 / float(mobility[0, 0]), limit, period)
        moments, columns = np.linalg.eigh(inertia)
        columns = columns * np.linalg.det(columns)  # right-handed, as cross products are
        gain = values["rate_gain"]
        fit = InertiaFit(
            moments,
            columns.T @ axis,
            RATE_NOISE / scaling.fine_time,
            TORQUE_NOISE * limit + float(np.max(np.abs(context.disturbance_amplitude))),
        )
        return cls(
            fit=fit,
            principal=columns.T,
            torque_limit=limit,
            share=values["share"],
            turn_ratio=values["turn_ratio"],
            exponent=values["exponent"],
            rate_gain=RATE_GAIN / scaling.loop_time if gain is None else gain,
            rest_rate=values["rest_rate_rad_s"],
            period=period,
            estimates=values["estimate_inertia"],
        )

    def init(self, state: PlantState) -> OneTorqueMemory:
        """The initial memory, without estimates."""
        no = jnp.array(False)
        omega = self.principal @ state.omega
        fit = self.fit.init(omega)
        inertia, axis = self.fit.believed(fit)
        frame = TorqueAxisFrame.of(inertia, axis)
        unit = jnp.sqrt(self.share * self.torque_limit / frame.gamma)
        most = MOST_GROWTH * jnp.maximum(jnp.sqrt(jnp.sum((inertia @ omega) ** 2)), unit)
        return OneTorqueMemory(fit, ~no, no, no, jnp.array(OneTorqueMode.DAMPING), most)

    def step(
        self, t: RealScalar, state: PlantState, memory: OneTorqueMemory
    ) -> tuple[Float[Array, "1"], OneTorqueMemory]:
        """Update the estimate, choose the mode, and compute the torque."""
        omega = self.principal @ state.omega
        fit = memory.fit
        if self.estimates:
            fit = self.fit.sampled(fit, omega, self.period)
        inertia, axis = self.fit.believed(fit)
        frame = TorqueAxisFrame.of(inertia, axis)
        momentum = inertia @ omega
        momenta = Momenta(*(frame.axes @ momentum))
        rate = jnp.sqrt(jnp.sum(omega**2) + SMALLEST)
        rests = rate < jnp.where(memory.rests, LEAVE_REST, 1.0) * self.rest_rate
        holding = jnp.abs(frame.holding_torque(momenta.x, momenta.y)) / self.torque_limit
        size = jnp.sqrt(jnp.sum(momentum**2))
        damps = holding > jnp.where(memory.damps, RECOVERED, OVERWHELMED)
        damps |= size > jnp.where(memory.damps, REGROWTH, 1.0) * memory.most
        target, spins = self._wanted(frame, momenta, memory.spins, rests)
        gyroscopic = momenta.x * (frame.gamma * momenta.w + frame.eta * momenta.x)
        gyroscopic += (frame.zeta - frame.delta) * momenta.x * momenta.y
        gyroscopic -= frame.eta * momenta.y**2
        tracking = target.derivative - gyroscopic + self.rate_gain * (target.momentum - momenta.w)
        about_axis = momenta.w + frame.gamma / frame.alpha * momenta.y  # b·ω / α
        unlimited = jnp.where(damps, -self.rate_gain * about_axis, tracking)
        torque = jnp.clip(unlimited, -self.torque_limit, self.torque_limit)
        mode = jnp.where(damps, OneTorqueMode.DAMPING, target.mode)
        fit = fit._replace(torque=torque)
        return torque[None], OneTorqueMemory(fit, damps, spins, rests, mode, memory.most)

    def mode(self, memory: OneTorqueMemory) -> IntScalar:
        """The active `OneTorqueMode`."""
        return memory.mode

    def _wanted(
        self, frame: TorqueAxisFrame, at: Momenta, spun: BoolScalar, rests: BoolScalar
    ) -> tuple[Wanted, BoolScalar]:
        """The demand, and whether it is to spin up."""
        w, x, y = at
        force = self.share * self.torque_limit
        unit = jnp.sqrt(force / frame.gamma)
        across = jnp.sqrt(x**2 + y**2 + SMALLEST * unit**2)
        tolerance = LEFT * self.rest_rate / frame.alpha
        braking_room = jnp.maximum(x - tolerance, 0.0)
        most_held = HELD * self.torque_limit / (frame.gamma * across)
        turn = jnp.minimum(self.turn_ratio * across, most_held)
        brake = jnp.minimum(cube_root(3 * force * braking_room / frame.gamma), most_held)
        brake = jnp.where(jnp.abs(y) < BRAKE_SIDE * x, brake, 0.0)
        most = jnp.maximum(turn, brake)
        demand, sense = self._turning(frame, at, turn, brake, most, tolerance, SMALLEST * unit)
        size = jnp.minimum(demand, most)

        ready = (x > 0) & (demand >= BRAKED * brake)
        slow = (jnp.abs(w) < STILL * across) & (across < SLOW * unit) & ~ready
        spins = ~rests & (across <= QUICK * unit) & (spun | slow)
        brakes = ~rests & ~spins & (brake > turn) & (demand > turn)

        spin = jnp.where(w < 0, -1.0, 1.0) * SPIN * QUICK * unit
        momentum = jnp.where(rests, 0.0, jnp.where(spins, spin, sense * size))
        room = jnp.where(brakes & (braking_room > 0), braking_room, 1.0)
        slope = jnp.minimum(frame.braked(w, x, y), 0.0) / (3 * room)
        most_slope = self.torque_limit
        derivative = jnp.where(
            brakes & (braking_room > 0), jnp.clip(momentum * slope, -most_slope, most_slope), 0.0
        )
        mode = jnp.where(brakes, OneTorqueMode.BRAKING, OneTorqueMode.TURNING)
        mode = jnp.where(spins, OneTorqueMode.SPINNING_UP, mode)
        mode = jnp.where(rests, OneTorqueMode.RESTING, mode)
        return Wanted(momentum, derivative, mode), spins

    def _turning(
        self, frame: TorqueAxisFrame, at: Momenta, turn, brake, most, tolerance, small
    ) -> tuple[RealScalar, RealScalar]:
        """|w| that decreases |y| as xᵖ, without a limit, and its sign.

        The sign is kept where a brake has taken y past zero and reversing would take longer than
        the rest of the brake, and where y is nearly zero. `small` (N m s) keeps quotients finite.
        """
        w, x, y = at
        coupling = frame.coupling(x, y)
        sense = jnp.where((coupling >= 0) == (y >= 0), -1.0, 1.0)
        size = jnp.abs(coupling) / (self.exponent * frame.gamma * (jnp.abs(y) + small))
        turned = 0.6 * jnp.abs(frame.delta - frame.alpha) * x**2 / (frame.gamma * (brake + small))
        past_zero = (brake > turn) & (jnp.abs(y) < PASSED * turned) & (jnp.abs(w) > FAST * most)
        keeps = (past_zero | (jnp.abs(y) < tolerance)) & (w * sense < 0)
        return jnp.where(keeps, jnp.inf, size), jnp.where(keeps, -sense, sense)
