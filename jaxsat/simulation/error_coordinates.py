"""The closed loop in error coordinates (43): a law with corners has no jumps in rate errors."""

import dataclasses
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float

from jaxsat.control.controller import AbstractBacksteppingLaw, AbstractIntegratingFactor, Memory
from jaxsat.core.array_types import Pair, RealScalar
from jaxsat.core.attitude import AbstractAttitude
from jaxsat.core.checks import concrete
from jaxsat.core.quotients import reciprocal
from jaxsat.simulation.loops import AbstractContinuousLoop, Motion, continuous_signals
from jaxsat.simulation.trajectory import Signals
from jaxsat.spacecraft.dynamics import PlantState, RigidBody


class ErrorState(NamedTuple):
    """Attitude, third rate (rad/s), rate error η (rad/s) and memory."""

    attitude: AbstractAttitude
    omega3: RealScalar
    rate_error: Pair
    memory: Memory


class ErrorCoordinateLoop(AbstractContinuousLoop):
    """The loop of (43): a backstepping law whose model is the plant, in error coordinates.

    With unlimited torques about body x and y and the same inertia and orbit in law and plant, the
    derivative of the reference cancels, so no derivative of sat appears and the loop is Lipschitz
    away from w = 0. Only a disturbance of ω3 that the law does not model reintroduces it, because
    the reference depends on ω3. Raises `ValueError` where law and plant differ.
    """

    plant: RigidBody
    law: AbstractBacksteppingLaw

    def __check_init__(self):
        if self.plant.effectors:
            raise ValueError("Error coordinates must have a plant without wheels.")
        leaves = [concrete(x) for x in jax.tree.leaves((self.plant, self.law))]
        if any(leaf is None for leaf in leaves):
            return
        model, true = self.law.model, self.plant
        same_body = np.array_equal(model.spacecraft.inertia, true.spacecraft.inertia)
        same_orbit = bool(eqx.tree_equal(*jax.tree.map(np.asarray, (model.orbit, true.orbit))))
        inertia = np.asarray(true.spacecraft.inertia)
        principal = np.array_equal(inertia, np.diag(np.diag(inertia)))
        if not (same_body and same_orbit and principal):
            raise ValueError(
                "Error coordinates must have principal body axes and the same inertia and orbit "
                "in law and plant; simulate this loop at torque level instead."
            )
        if model.third_rate_held != true.third_rate_held:
            raise ValueError("Law and plant must agree on whether the third rate is held.")

    def start(self, state: PlantState) -> ErrorState:
        """The plant's state with rate errors in place of rates, and the law's initial memory."""
        error, memory = self.law.rate_error(state), self.law.init(state)
        return ErrorState(state.attitude, state.omega[2], error, memory)

    @property
    def torque_count(self) -> int:
        """Number of torque components: 2, about body x and y."""
        return 2

    def plant_state(self, t: RealScalar, state: ErrorState) -> PlantState:
        """The state of the plant, with rates reconstructed from the rate errors."""
        return self._with_rates(state, self._reference(state.attitude, state.omega3))

    def motion(self, t: RealScalar, state: ErrorState) -> Motion:
        """Equations (36) and (43), with (37) for ω3, and the torque by (39) or (42)."""
        is_held = self.plant.third_rate_held
        variables = (state.attitude,) if is_held else (state.attitude, state.omega3)
        reference, along = jax.linearize(
            lambda attitude, omega3=state.omega3: self._reference(attitude, omega3), *variables
        )
        plant_state = self._with_rates(state, reference)
        relative_rate = self.plant.relative_rate(plant_state)
        attitude_rate = state.attitude.rate(relative_rate)
        unmodelled = self.plant.disturbance_torque(t, plant_state)
        unmodelled = unmodelled - self.law.model.disturbance_torque(t, plant_state)
        feedback = self.law.feedback(plant_state, state.rate_error, state.memory)
        moments = self.plant.spacecraft.moments
        error_rate = (feedback + unmodelled[:2]) * reciprocal(moments[:2])
        omega3_rate = jnp.zeros_like(state.omega3)
        model_rates = (attitude_rate,)
        if not is_held:
            disturbance = self.plant.disturbance_torque(t, plant_state)
            omega3_rate = self.plant.angular_acceleration(plant_state.omega, disturbance)[2]
            unknown = unmodelled[2] / moments[2]
            still = jax.tree.map(jnp.zeros_like, state.attitude)
            error_rate = error_rate - along(still, unknown)
            model_rates = (attitude_rate, omega3_rate - unknown)
        rate = ErrorState(
            attitude_rate,
            omega3_rate,
            error_rate,
            self.law.memory_rate(state.rate_error, state.memory),
        )
        command = self.law.torque_of(t, plant_state, feedback, along(*model_rates))
        torque = jnp.concatenate([command, jnp.zeros_like(command[:1])])
        return Motion(rate, plant_state, relative_rate, state.rate_error, torque)

    def signals(self, t: RealScalar, state: ErrorState) -> Signals:
        """All signals at one instant, with the torque by (39) or (42)."""
        motion = self.motion(t, state)
        return continuous_signals(
            self.plant, self.law, t, motion.plant, state.memory, motion.torque
        )

    def event_functions(self, t: RealScalar, state: ErrorState) -> Float[Array, " m"]:
        """The event functions of the law."""
        return self.law.event_functions(self._probe(state.attitude, state.omega3))

    def smooth_piece(self, signs: Bool[Array, " m"]) -> "ErrorCoordinateLoop":
        """The loop with the law fixed to the smooth piece selected by these signs."""
        return dataclasses.replace(self, law=self.law.smooth_piece(signs))

    def integrating_factor(self, t: RealScalar) -> AbstractIntegratingFactor | None:
        """The integrating factor of the law."""
        return self.law.integrating_factor(t)

    def _probe(self, attitude: AbstractAttitude, omega3: RealScalar) -> PlantState:
        zero = jnp.zeros_like(omega3)
        return PlantState(attitude, jnp.stack([zero, zero, omega3]))

    def _reference(self, attitude: AbstractAttitude, omega3: RealScalar) -> Pair:
        return self.law.reference_rate(self._probe(attitude, omega3))

    def _with_rates(self, state: ErrorState, reference: Pair) -> PlantState:
        omega1, omega2 = reference + state.rate_error
        return PlantState(state.attitude, jnp.stack([omega1, omega2, state.omega3]))
