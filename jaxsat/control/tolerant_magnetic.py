"""Magnetorquers alone, or with the wheels of one axis, under the fault-tolerant law."""

import dataclasses
from collections.abc import Mapping, Sequence
from typing import Any, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Int

from jaxsat.control.controller import LawContext, MagneticContext, UnsuitableModel
from jaxsat.control.diagnosis.residual import believed
from jaxsat.control.magnetic import MagneticLaw, MagneticMemory, MagneticMode
from jaxsat.control.periodic_gain import PeriodicGain
from jaxsat.control.reconfiguration import Rank
from jaxsat.control.tolerant_actuators import Sample, tolerant_mode
from jaxsat.control.tolerant_rods import TolerantRods
from jaxsat.control.wheel_allocation import WheelsInUse
from jaxsat.core.array_types import BoolScalar, IntScalar, Vector
from jaxsat.core.checks import as_array
from jaxsat.core.declaration.magnetic import MAGNETIC_CONTROL
from jaxsat.core.quotients import SMALLEST
from jaxsat.spacecraft.dynamics import PlantState

PARALLEL = 1e-9
"""One less the cosine of the angle between two axes that count as one."""

NO_RATE = 1e-30
"""Rate (rad/s) below which no body is."""

NOWHERE = -1
"""Number of the set while another law flies."""


class TolerantMagneticMemory(NamedTuple):
    """The memory of the law `magnetic`, and the number of the set of wheels that it flies with."""

    own: MagneticMemory
    number: IntScalar


class MagneticFlight(NamedTuple):
    """What the law `magnetic` does, whether it `flies`, and whether it at least `acts`: beside
    actuators that damp rates, magnetorquers do so too.

    `dipoles` are in A m², `torques` of wheels on the body in N m.
    """

    flies: BoolScalar
    acts: BoolScalar
    dipoles: Float[Array, " k"]
    torques: Float[Array, " m"]
    memory: TolerantMagneticMemory

    @property
    def mode(self) -> IntScalar:
        """The `TolerantMode`."""
        return tolerant_mode(self.memory.own.mode, MagneticMode, "MAGNETIC_")


class TolerantMagnetic(eqx.Module):
    """The law `magnetic` with gains for each set of wheels that leaves less than a plane.

    The first set has no wheel, the others those along one axis each. Of `laws`, what differs
    between sets has a leading axis. `members` are the wheels of each set, and `of_wheel` the number
    of the set of each wheel. A set `holds` all axes if it has gains that do; else magnetorquers and
    its wheels damp the rate.
    """

    laws: MagneticLaw
    members: Bool[Array, "sets m"]
    of_wheel: Int[Array, " m"]
    holds: Bool[Array, " sets"]

    @staticmethod
    def of(
        laws: Sequence[MagneticLaw | None], members: Bool[np.ndarray, "sets m"]
    ) -> "TolerantMagnetic | None":
        """With the law of each set, None for one without gains; None where no set has some."""
        some = next((law for law in laws if law is not None), None)
        if some is None:
            return None
        damping = dataclasses.replace(some.steering, command_part=np.eye(3), bias=np.zeros(3))
        steerings = [damping if law is None else law.steering for law in laws]
        gains = [_with_wheels((some if law is None else law).gain) for law in laws]
        stacked = (
            np.stack([one.command_part for one in steerings]),
            np.stack([one.bias for one in steerings]),
            np.stack([basis for _, basis in gains]),
            np.stack([table for table, _ in gains]),
        )
        return TolerantMagnetic(
            eqx.tree_at(_of_each_set, some, tuple(map(as_array, stacked))),
            as_array(members),
            as_array(np.argmax(members, axis=0)),
            as_array(np.array([law is not None for law in laws])),
        )

    def holds_with(self, axes: Float[np.ndarray, "3 k"], rods: Bool[np.ndarray, " rods"]) -> bool:
        """Whether it holds all axes with wheels along these parallel unit axes, or with none.

        It commands all magnetorquers, of which these work.
        """
        number, wheels = 0, self.laws.wheel_axes
        if axes.shape[1] and wheels is not None:
            number = int(self.of_wheel[np.argmax(np.abs(axes[:, 0] @ np.asarray(wheels)))])
        if rods.all() or not self.holds[number]:
            return bool(self.holds[number])
        law = self._law(jnp.array(number), jnp.where(self.members[number], 1.0, 0.0))
        gain = _without_padding(np.asarray(law.gain.gains[number]), np.asarray(law.gain.basis))
        return dataclasses.replace(law, gain=PeriodicGain(*gain, law.gain.rate)).holds_with(rods)

    def init(self, state: PlantState) -> TolerantMagneticMemory:
        """Another law flies."""
        return TolerantMagneticMemory(self.laws.init(state), jnp.array(NOWHERE))

    def diagnosed(self, rods: TolerantRods) -> "TolerantMagnetic":
        """Return a copy that steers with what these magnetorquers still make."""
        if rods.fit is None:
            return self
        now = rods.steering
        steering = dataclasses.replace(
            self.laws.steering, axes=now.axes, shares=now.shares, dipole_limit=now.dipole_limit
        )
        return dataclasses.replace(self, laws=dataclasses.replace(self.laws, steering=steering))

    def act(
        self,
        sample: Sample,
        unsettled: BoolScalar,
        flows: BoolScalar,
        in_use: WheelsInUse | None,
        before: TolerantMagneticMemory,
        body_dipole: tuple[Vector, Vector] | None = None,
    ) -> MagneticFlight:
        """What it does where no other law settles (`unsettled`) beside the wheels in use, None for
        no wheels.

        It flies where these are along one axis and no failed thruster `flows`; else magnetorquers
        damp the rate. What was learnt of dipole and torque is kept as wheels fail, but not how the
        body moved. The `body_dipole` (A m²), of the body and of stuck magnetorquers by their
        diagnosis, replaces the law's own where they differ by more than its error, of
        these standard deviations (A m²). The law's own is not exact: it follows drag. A dipole of
        the body that no magnetorquer opposes is first turned into the field, and the law has what
        this leaves of the dipoles. Wheels make the rest of its torque about their axis.
        """
        none = jnp.zeros(0)
        usable = none if in_use is None else in_use.usable
        few = jnp.array(True) if in_use is None else in_use.rank == Rank.LESS
        flies = unsettled & few & ~flows
        number = self._number(jnp.where(flies, usable, 0.0))
        used = jnp.where(self.members[number], usable, 0.0)
        law = self._law(number, used, self.holds[number] & flies)
        same = number == before.number
        own = before.own._replace(
            mode=jnp.where(same, before.own.mode, int(MagneticMode.DAMPING)),
            predicts=same & before.own.predicts,
        )
        if body_dipole is not None:
            dipole, sigma = body_dipole
            apart = dipole - own.dipole
            own = own._replace(dipole=own.dipole + believed(jnp.sum((apart / sigma) ** 2)) * apart)
        steering, state = law.steering, sample.state
        field = steering.field.in_body(sample.t, state.attitude)
        body = own.dipole
        besides = steering.shortened(steering.shares @ body - steering.turned(field, body))
        torque, own = law.beside(sample.t, state, own, besides)
        demand = steering.demand(state, torque)
        dipoles, rod_torque = steering.within_limits(field, demand, besides)
        torques = none
        if law.wheel_axes is not None:
            along = law.wheel_axes.T @ law.gain.basis[:, 0]
            shares = used * along / (jnp.sum(used * along**2) + SMALLEST)
            torques = shares * jnp.sum(law.gain.basis[:, 0] * (torque - rod_torque))
        memory = TolerantMagneticMemory(own, jnp.where(flies, number, NOWHERE))
        return MagneticFlight(flies, unsettled, besides + dipoles, torques, memory)

    def _number(self, usable: Float[Array, " m"]) -> IntScalar:
        """The set with the wheel that has the most torque to spare, of `usable` ones (N m)."""
        if not usable.shape[0]:
            return jnp.array(0)
        return jnp.where(jnp.any(usable > 0), self.of_wheel[jnp.argmax(usable)], 0)

    def _law(
        self, number: IntScalar, usable: Float[Array, " m"], points: BoolScalar | bool = True
    ) -> MagneticLaw:
        """That of a set, with the wheels that are usable; it damps for ever unless it `points`."""
        laws, gain = self.laws, self.laws.gain
        command_part, bias, basis = (one[number] for one in _of_each_set(laws)[:3])
        axes = laws.wheel_axes
        used = None if axes is None else jnp.where(usable > 0, axes, 0.0)
        return dataclasses.replace(
            laws,
            steering=dataclasses.replace(
                laws.steering, command_part=command_part, bias=bias, wheel_axes=used
            ),
            gain=PeriodicGain(gain.gains, basis, gain.rate, (number,)),
            pointing_rate=jnp.where(points, laws.pointing_rate, NO_RATE),
        )


def tolerant_magnetic(
    values: Mapping[str, Any], context: LawContext, settles: bool
) -> TolerantMagnetic | None:
    """The law `magnetic` with each set of wheels that leaves less than a plane of torques.

    None without magnetorquers that hold all axes with any set. Raises `UnsuitableModel` where they
    and such a set do not hold all axes and nothing else does at the start; thrusters do if they
    are said to have a law that `settles`.
    """
    magnetic = context.magnetic
    if magnetic is None:
        return None
    axes = np.zeros((3, 0)) if context.wheel_axes is None else context.wheel_axes
    parallel = np.abs(axes.T @ axes) > 1 - PARALLEL
    members = np.vstack([0 * parallel[:1], np.unique(parallel, axis=0)[::-1]]).astype(bool)
    if not axes.size:
        members = np.zeros((1, 0), bool)
    working = None if context.wheels is None else members[:, ~context.wheels.failed].any(axis=1)
    begins = 0 if working is None or not working.any() else int(working.argmax())
    alone = not settles and (working is None or working.sum() < 2)
    laws: list[MagneticLaw | None] = []
    for number, one in enumerate(members):
        try:
            laws.append(_magnetic_law(values, context, magnetic, axes[:, one][:, :1]))
        except UnsuitableModel:
            if alone and number == begins:
                raise
            laws.append(None)
    return TolerantMagnetic.of(laws, members)


def _magnetic_law(
    values: Mapping[str, Any],
    context: LawContext,
    magnetic: MagneticContext,
    axis: Float[np.ndarray, "3 p"],
) -> MagneticLaw:
    """The law `magnetic` with wheels along a unit axis, or none. They keep the bias along it."""
    unmade, bias = np.eye(3) - axis @ axis.T, np.asarray(magnetic.steering.bias)
    along = np.abs(unmade @ bias).max() <= PARALLEL * np.abs(bias).max()
    own_bias = bias if along else np.zeros(3)
    steering = dataclasses.replace(magnetic.steering, command_part=unmade, bias=own_bias)
    own = MagneticContext(steering, magnetic.momentum + own_bias - bias)
    table = {key.name: key.default for key in MAGNETIC_CONTROL.keys}
    table["period_s"] = values["period_s"]
    return MagneticLaw.from_table(table, context._replace(magnetic=own))


def _of_each_set(law: MagneticLaw) -> tuple:
    """What differs between laws of sets of wheels."""
    return law.steering.command_part, law.steering.bias, law.gain.basis, law.gain.gains


def _without_padding(gains: np.ndarray, basis: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Gains and basis of a set before `_with_wheels`."""
    if basis.any():
        return gains, basis
    return np.delete(np.delete(gains, 3, axis=-2), 6, axis=-1), np.zeros((3, 0))


def _with_wheels(gain: PeriodicGain) -> tuple[np.ndarray, np.ndarray]:
    """The gains and the basis, also without wheels with a row, a column and an axis of some."""
    gains, basis = np.asarray(gain.gains), np.asarray(gain.basis)
    if basis.shape[1]:
        return gains, basis
    gains = np.insert(np.insert(gains, 3, 0.0, axis=-2), 6, 0.0, axis=-1)
    return gains, np.zeros((3, 1))
