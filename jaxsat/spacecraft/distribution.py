"""Distribution of a law's command among the effectors."""

import abc
import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float

from jaxsat.core.allocation import least_squares_map, unit_columns, unmade_map
from jaxsat.core.array_types import RealScalar, Vector
from jaxsat.core.checks import as_array, as_float, as_optional_float, require_positive
from jaxsat.core.errors import ArgumentError
from jaxsat.spacecraft.allocation import first_at_limit, share_within
from jaxsat.spacecraft.effector import AbstractEffector
from jaxsat.spacecraft.relief import Relief
from jaxsat.spacecraft.spacecraft import OfEach, PlantState
from jaxsat.spacecraft.wheel_friction import WheelFriction
from jaxsat.spacecraft.wheels import Wheels, wheel_momentum


class Shares(NamedTuple):
    """Command of each effector, and the torque (N m) assigned to none; None for no such torque."""

    uses: OfEach
    remainder: Vector | None = None

    def torque_unmade(self, effectors: tuple[AbstractEffector, ...]) -> Vector | None:
        """Return the commanded torque that effectors do not make, N m; None for direct commands.

        This is the torque assigned to no effector plus the torque beyond the limits of each.
        """
        beyond = [one.unmade(use) for one, use in zip(effectors, self.uses, strict=True)]
        parts = [one for one in (self.remainder, *beyond) if one is not None]
        return sum(parts[1:], parts[0]) if parts else None


class AbstractDistribution(eqx.Module):
    """Map from a law's command to the commands of the body's effectors.

    A distribution whose uses have corners as functions of the command gives their events.
    """

    @abc.abstractmethod
    def __call__(
        self,
        t: RealScalar,
        state: PlantState,
        command: Float[Array, " torques"],
        effectors: tuple[AbstractEffector, ...],
    ) -> Shares:
        """Return the command of each effector at time `t` (s), in the order of the body.

        `state` is the law's estimate of the plant's state.
        """

    def out_of_reach(
        self, command: Float[Array, " torques"], effectors: tuple[AbstractEffector, ...]
    ) -> Float[Array, " torques"]:
        """Return the part of a command beyond these effectors at any limits, N m; here zero."""
        del effectors
        return jnp.zeros_like(command)

    def tells_remainder(self, effectors: tuple[AbstractEffector, ...]) -> bool:
        """Whether `Shares.remainder` is computed for these effectors."""
        return False

    @property
    def event_count(self) -> int:
        """Number of corners of the uses as functions of the command."""
        return 0

    def event_functions(self, command: Float[Array, " torques"]) -> Float[Array, " m"]:
        """Functions of the command whose zeros are the corners."""
        return jnp.zeros(0, command.dtype)

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "AbstractDistribution":
        """Return the distribution held on the side of each corner that `signs` gives."""
        return self


class Direct(AbstractDistribution):
    """A command that lists the command of each effector, one after the other.

    Effectors after its end are idle. So a law may command three torques that thrusters share, a
    torque of each wheel, or duty cycles of thrusters and then torques of wheels.
    """

    def __call__(self, t, state, command, effectors) -> Shares:
        """Return parts of the command; raises `ValueError` if it ends within an effector's part."""
        uses, rest = [], command
        for one in effectors:
            size = one.command_size if rest.shape[0] else 0
            if size > rest.shape[0]:
                rule = f"must have {size} numbers for {one.kind}s"
                raise ArgumentError("command", rule, f"{rest.shape[0]} of {command.shape[0]}")
            uses.append(rest[:size] if size else one.idle())
            rest = rest[size:]
        if rest.shape[0]:
            rule = "must have no more numbers than effectors take"
            raise ArgumentError("command", rule, f"{rest.shape[0]} of {command.shape[0]} more")
        return Shares(tuple(uses))


class WheelsFirst(AbstractDistribution):
    """Wheels make as much of a commanded torque as they can, and thrusters the rest.

    `wheel_map` (wheels, torques) shares the command, two torques or three, among the wheels; rows
    of failed wheels are zero. Where a share exceeds its wheel's `wheel_limit` (N m, None for no
    limit), `allocate` reallocates the shares: other wheels make up for it and, of a torque out of
    reach, the greatest part is made in its direction. `axes` (3, wheels) has zeros for failed
    wheels. `rest` (torques, torques) gives the part of the command left to other effectors, shared
    as by `Direct`; None leaves nothing. With `relief`, for a command of three torques under a
    sampled law, thrusters also make the torque that wheels cannot make for their limits of torque
    or momentum, and unload momentum; `together` if the wheels' rest needs their help. Motors also
    make the torque of a known `friction`. `limiting` holds which wheel is at its limit, see
    `smooth_piece`.
    """

    axes: Float[Array, "3 wheels"] = eqx.field(converter=as_float)
    wheel_map: Float[Array, "wheels torques"] = eqx.field(converter=as_float)
    wheel_limit: Float[Array, " wheels"] | None = eqx.field(
        converter=as_optional_float, default=None
    )
    rest: Float[Array, "torques torques"] | None = eqx.field(
        converter=as_optional_float, default=None
    )
    limiting: Bool[Array, " wheels"] | None = None
    relief: Relief | None = None
    friction: WheelFriction | None = None
    together: bool = eqx.field(static=True, default=False)

    def __check_init__(self):
        if self.wheel_limit is not None:
            require_positive("wheel_limit", self.wheel_limit)

    @staticmethod
    def of(
        axes: ArrayLike | list,
        torques: int,
        wheel_limit: ArrayLike | list | None = None,
        failed: tuple[int, ...] = (),
        others: bool = False,
        directions: ArrayLike | None = None,
    ) -> "WheelsFirst":
        """Return the distribution for wheels along `axes` (3, wheels) but the `failed` (from 1).

        Least squares share the torques that all working wheels can make, about the first body axes
        or `directions` (3, torques). Raises `ValueError` where a rest is left and there are no
        `others`.
        """
        along = None if directions is None else np.asarray(directions, float)
        units = unit_columns(np.asarray(axes, float))
        working = [number not in failed for number in range(1, units.shape[1] + 1)]
        shares = np.zeros((units.shape[1], torques))
        limit = limits = None
        if wheel_limit is not None:
            limits = np.broadcast_to(np.asarray(wheel_limit, float), units.shape[1])
            limit, limits = as_float(limits), limits[working]
        shares[working] = least_squares_map(units[:, working], torques, limits, along)
        rest = unmade_map(units, shares, along)
        working_axes = units * np.array(working)
        if not rest.any():
            return WheelsFirst(working_axes, as_array(shares), limit)
        if not others:
            which = "x and y" if torques == 2 else "x, y and z"
            raise ValueError(
                f"The wheels left must make independent torques about body axes {which}, "
                f"but their axes are the columns of {units[:, working].round(6).tolist()}."
            )
        return WheelsFirst(working_axes, as_array(shares), limit, as_array(rest))

    def __call__(self, t, state, command, effectors) -> Shares:
        """Return the torque of each motor (N m), and the commands of the others."""
        others = tuple(one for one in effectors if not isinstance(one, Wheels))
        momentum = wheel_momentum(state)
        if self.relief is None or momentum is None:
            wheels, remainder = self._shared(command)
            rest = command[:0] if self.rest is None else self.rest @ command
        else:
            wheels, rest, remainder = self._relieved(self.relief, state.omega, momentum, command)
        if not any(one.command_size for one in others):
            remainder, rest = remainder + torque_of(rest), rest[:0]
        if self.friction is not None and momentum is not None:
            wheels = self.friction.motor_torque(wheels, momentum)
        uses = iter(Direct()(t, state, rest, others).uses)
        each = tuple(wheels if isinstance(one, Wheels) else next(uses) for one in effectors)
        return Shares(each, remainder)

    def _relieved(
        self, relief: Relief, omega: Vector, momentum: Float[Array, " wheels"], command: Vector
    ) -> tuple[Float[Array, " wheels"], Vector, Vector]:
        """Return the torque of each wheel, of all thrusters, and the torque not made (N m)."""
        shares, unloading = self.wheel_map @ command, relief.unloading(omega, momentum)
        low, high = relief.bounds(momentum)
        alone = jnp.all((low <= shares) & (shares <= high)) & jnp.all(unloading == 0)
        rest = jnp.zeros_like(command) if self.rest is None else self.rest @ command
        if self.together:
            return relief.allocate(command, unloading, momentum)
        return jax.lax.cond(
            alone,
            lambda: (shares, rest, jnp.zeros_like(command)),
            lambda: relief.allocate(command, unloading, momentum),
        )

    def out_of_reach(self, command, effectors) -> Float[Array, " torques"]:
        """Return the part that wheels leave to others, if there are no others."""
        alone = all(isinstance(one, Wheels) or not one.command_size for one in effectors)
        return self.rest @ command if alone and self.rest is not None else jnp.zeros_like(command)

    def tells_remainder(self, effectors) -> bool:
        """Whether `Shares.remainder` is computed: always."""
        return True

    def wheels(self, command: Float[Array, " torques"]) -> Float[Array, " wheels"]:
        """Return the torque that each wheel puts on the body for a command, N m."""
        return self._shared(command)[0]

    def _shared(self, command: Float[Array, " torques"]) -> tuple[Float[Array, " wheels"], Vector]:
        """Return the wheels' torques, and the part beyond their limits, N m."""
        shares = self.wheel_map @ command
        if self.wheel_limit is None:
            return shares, jnp.zeros(3, shares.dtype)
        return share_within(self.axes, self.wheel_limit, shares, self.limiting)

    @property
    def event_count(self) -> int:
        """Number of corners of the uses: one for each wheel with a torque limit."""
        return 0 if self.wheel_limit is None else self.wheel_map.shape[0]

    def event_functions(self, command: Float[Array, " torques"]) -> Float[Array, " m"]:
        """Return event functions: positive for the wheel that is first at its limit."""
        if self.wheel_limit is None:
            return jnp.zeros(0, command.dtype)
        return first_at_limit(self.wheel_map @ command, self.wheel_limit)

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "WheelsFirst":
        """Return the same distribution, bounded by one wheel or by none."""
        return self if self.wheel_limit is None else dataclasses.replace(self, limiting=signs)


def torque_of(command: Float[Array, " torques"]) -> Vector:
    """Return the torque (N m) of a command of none, two or three torques about the body axes."""
    return jnp.pad(command, (0, 3 - command.shape[0]))
