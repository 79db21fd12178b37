"""How a commanded torque is shared among wheels, and among wheels and thrusters."""

import dataclasses

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, ArrayLike, Bool, Float, PyTree

from jaxsat.core.allocation import (
    least_squares_map,
    unit_columns,
    what_is_left,
)
from jaxsat.core.checks import as_array, as_float, as_optional_float, require_positive
from jaxsat.spacecraft.actuators import AbstractActuators, AbstractSmoothActuators
from jaxsat.spacecraft.allocation import first_at_limit, share_within
from jaxsat.spacecraft.effector import Reach
from jaxsat.spacecraft.holds import AbstractPulsedActuators
from jaxsat.spacecraft.wheels import Wheels


class ActuatorsWithWheels(AbstractActuators):
    """Wheels that make as much of a commanded torque as they can, and thrusters for the rest.

    `wheel_map` (wheels, torques) shares the command, two torques or three, among the wheels, of
    which those that have failed have rows of zeros. Where that exceeds the `wheel_limit` (N m, None
    for no limit) of one, `allocate` shares it: others make up for it and, of a torque that they
    cannot make, the greatest part is made, in its direction. `axes` (3, wheels) has zeros for those
    that have failed. `rest` (torques, torques) gives the part of the command that is left to the
    `thrusters`; both are None where nothing is. `limiting` holds which wheel is at its limit, see
    `smooth_piece`.
    """

    axes: Float[Array, "3 wheels"] = eqx.field(converter=as_float)
    wheel_map: Float[Array, "wheels torques"] = eqx.field(converter=as_float)
    wheel_limit: Float[Array, " wheels"] | None = eqx.field(
        converter=as_optional_float, default=None
    )
    thrusters: AbstractActuators | None = None
    rest: Float[Array, "rest torques"] | None = eqx.field(converter=as_optional_float, default=None)
    limiting: Bool[Array, " wheels"] | None = None

    def __check_init__(self):
        if self.wheel_limit is not None:
            require_positive("wheel_limit", self.wheel_limit)
        if (self.thrusters is None) != (self.rest is None):
            raise ValueError("Arguments `thrusters` and `rest` must be given together.")

    @staticmethod
    def of(
        axes: ArrayLike | list,
        torques: int,
        wheel_limit: ArrayLike | list | None = None,
        thrusters: AbstractActuators | None = None,
        failed: tuple[int, ...] = (),
    ) -> "ActuatorsWithWheels":
        """Wheels along `axes` (3, wheels), of which those numbered `failed` (from 1) do nothing.

        Least squares share what all of them can make. Raises `ValueError` where that leaves
        something to `thrusters` and there are none.
        """
        known = unit_columns(np.asarray(axes, float))
        working = [number not in failed for number in range(1, known.shape[1] + 1)]
        shares = np.zeros((known.shape[1], torques))
        limit = None if wheel_limit is None else as_float(wheel_limit) * jnp.ones(known.shape[1])
        limits = None if limit is None else np.asarray(limit)[working]
        shares[working] = least_squares_map(known[:, working], torques, limits)
        rest = what_is_left(known, shares)
        left = known * np.array(working)
        if not rest.any():
            return ActuatorsWithWheels(left, as_array(shares), limit)
        if thrusters is None:
            which = "x and y" if torques == 2 else "x, y and z"
            raise ValueError(
                f"The wheels left must make independent torques about body axes {which}, "
                f"but their axes are the columns of {known[:, working].round(6).tolist()}."
            )
        return ActuatorsWithWheels(left, as_array(shares), limit, thrusters, as_array(rest))

    def commands(self, command: Float[Array, " torques"]) -> dict[str, Array]:
        """The torque that each wheel is to put on the body, N m."""
        return {Wheels.kind: self._shared(command)[0]}

    def unmade(self, command: Float[Array, " torques"]) -> Float[Array, "3"]:
        """What neither wheels nor thrusters make, N m."""
        missing = self._shared(command)[1]
        if self.thrusters is None or self.rest is None:
            return missing
        more = self.thrusters.unmade(self.rest @ command)
        return missing if more is None else missing + more

    def _shared(
        self, command: Float[Array, " torques"]
    ) -> tuple[Float[Array, " wheels"], Float[Array, "3"]]:
        shares = self.wheel_map @ command
        if self.wheel_limit is None:
            return shares, jnp.zeros(3, shares.dtype)
        return share_within(self.axes, self.wheel_limit, shares, self.limiting)

    def __call__(self, command: Float[Array, " torques"]) -> Float[Array, "3"]:
        """The torque of the thrusters on the body, N m."""
        if self.thrusters is None or self.rest is None:
            return jnp.zeros(3, self.wheel_map.dtype)
        return self.thrusters(self.rest @ command)

    @property
    def failure_times(self) -> Float[Array, " f"]:
        """When thrusters fail, s."""
        return jnp.zeros(0) if self.thrusters is None else self.thrusters.failure_times

    def after_failures(self, struck: Bool[Array, " f"]) -> "ActuatorsWithWheels":
        """These actuators once those failures of thrusters have struck."""
        if self.thrusters is None:
            return self
        return dataclasses.replace(self, thrusters=self.thrusters.after_failures(struck))

    def reach(self, struck: Bool[Array, " f"]) -> Reach:
        """That of the thrusters."""
        return Reach.none() if self.thrusters is None else self.thrusters.reach(struck)

    @property
    def event_count(self) -> int:
        """One for each wheel with a limit, and those of the thrusters."""
        wheels = 0 if self.wheel_limit is None else self.wheel_map.shape[0]
        return wheels + (0 if self.thrusters is None else self.thrusters.event_count)

    def event_functions(self, command: Float[Array, " torques"]) -> Float[Array, " m"]:
        """Positive for the wheel that is first at its limit; then those of the thrusters."""
        found = []
        if self.wheel_limit is not None:
            found = [first_at_limit(self.wheel_map @ command, self.wheel_limit)]
        if self.thrusters is not None and self.rest is not None:
            found = [*found, self.thrusters.event_functions(self.rest @ command)]
        return jnp.concatenate([*found, jnp.zeros(0, self.wheel_map.dtype)])

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "ActuatorsWithWheels":
        """These actuators, bounded by one wheel or by none, and the thrusters' own piece."""
        made, count = self, self.event_count
        if self.thrusters is not None:
            count -= self.thrusters.event_count
            made = dataclasses.replace(made, thrusters=self.thrusters.smooth_piece(signs[count:]))
        return (
            made if self.wheel_limit is None else dataclasses.replace(made, limiting=signs[:count])
        )


class WheelDrives(AbstractSmoothActuators):
    """The motors of wheels under a law that commands each of them, and nothing else."""

    def __call__(self, command: Float[Array, " wheels"]) -> Float[Array, "3"]:
        """No torque but that of the wheels, N m."""
        return jnp.zeros(3, command.dtype)

    def commands(self, command: Float[Array, " wheels"]) -> dict[str, Array]:
        """The torque that each wheel is to put on the body, N m: as it is commanded."""
        return {Wheels.kind: command}


class PulsedActuatorsWithWheels(AbstractPulsedActuators):
    """`wheels` that make as much of a commanded torque as they can, and pulses for the `rest`.

    The wheels have no thrusters of their own; `rest` (torques, torques) is the part of the command
    that is left to the `thrusters`.
    """

    wheels: ActuatorsWithWheels
    thrusters: AbstractPulsedActuators
    rest: Float[Array, "rest torques"] = eqx.field(converter=as_float)

    @property
    def holds(self) -> int:
        """Those of the thrusters."""
        return self.thrusters.holds

    def commands(self, command: Float[Array, " torques"]) -> dict[str, Array]:
        """The torque that each wheel is to put on the body, N m."""
        return self.wheels.commands(command)

    def unmade(self, command: Float[Array, " torques"]) -> Float[Array, "3"] | None:
        """What neither wheels nor thrusters make, N m."""
        more = self.thrusters.unmade(self.rest @ command)
        return None if more is None else self.wheels.unmade(command) + more

    def reach(self, struck: Bool[Array, " f"]) -> Reach:
        """That of the thrusters."""
        return self.thrusters.reach(struck)

    def init(self) -> PyTree:
        """The thrusters' memory."""
        return self.thrusters.init()

    def plan(self, t, command, memory, period, delay):
        """The thrusters' plan of what the wheels leave."""
        return self.thrusters.plan(t, self.rest @ command, memory, period, delay)

    def under_way(self, plan, running):
        """As the thrusters say."""
        return self.thrusters.under_way(plan, running)

    def advance(self, plan, running):
        """As the thrusters do."""
        return self.thrusters.advance(plan, running)

    def finish(self, plan, running):
        """As the thrusters do."""
        return self.thrusters.finish(plan, running)

    def consumption(self, memory):
        """That of the thrusters."""
        return self.thrusters.consumption(memory)
