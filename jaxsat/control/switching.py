"""Switching between the rate law and the three-axis law, as the paper proposes in section 5.

The rate law takes over while |ω3| is large and hands back when |ω3| has become small. The active
law is memory, so this controller is sampled: it reads the state once per period and the torque is
held in between.
"""

import enum
import math
from collections.abc import Mapping
from typing import Any, ClassVar, NamedTuple

import equinox as eqx
import jax.numpy as jnp
import numpy as np

from jaxsat.control.controller import LawContext, Memory
from jaxsat.control.rate import RateLaw
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.control.three_axis import ThreeAxisLaw
from jaxsat.core.array_types import BoolScalar, IntScalar, Pair, RealScalar
from jaxsat.core.checks import concrete, positive
from jaxsat.core.declaration import LawDeclaration
from jaxsat.core.declaration.paper import SLOPE_LIMITS, SWITCHING
from jaxsat.spacecraft.dynamics import PlantState


class SwitchingMode(enum.IntEnum):
    """The active one of the two laws."""

    THREE_AXIS_LAW = 0
    RATE_LAW = 1

    @property
    def label(self) -> str:
        """The law's name in the paper."""
        return "rate law" if self is SwitchingMode.RATE_LAW else "three-axis law"


class SwitchingMemory(NamedTuple):
    """Memory of `SwitchingLaw` from one sample to the next."""

    rate_law_active: BoolScalar
    previous_reference: Pair
    has_previous: BoolScalar
    three_axis: Memory


class SwitchingLaw(AbstractSampledController):
    """Rate law while |ω3| is large, three-axis law otherwise, with hysteresis.

    The rate law takes over when |ω3| exceeds `upper_threshold` and hands back when |ω3| falls
    below `lower_threshold` (rad/s). The derivative of the active law's reference is a backward
    difference over one `period` (s), zero at the first sample of each law and clipped to
    `rate_slope_limit` or `three_axis_slope_limit` (rad/s², shape (2,)), because the printed
    reference jumps in slope where sat switches.
    """

    declaration: ClassVar[LawDeclaration] = SWITCHING
    modes: ClassVar[type[enum.IntEnum]] = SwitchingMode

    rate_law: RateLaw
    three_axis_law: ThreeAxisLaw
    upper_threshold: RealScalar = eqx.field(converter=positive("upper_threshold"))
    lower_threshold: RealScalar = eqx.field(converter=positive("lower_threshold"))
    period: RealScalar = eqx.field(converter=positive("period"))
    rate_slope_limit: Pair = eqx.field(converter=positive("rate_slope_limit"))
    three_axis_slope_limit: Pair = eqx.field(converter=positive("three_axis_slope_limit"))

    def __check_init__(self):
        lower, upper = concrete(self.lower_threshold), concrete(self.upper_threshold)
        if lower is not None and upper is not None and not lower <= upper:
            raise ValueError(
                "Argument `lower_threshold` must not exceed `upper_threshold`, "
                f"but got {lower} > {upper} rad/s."
            )

    @classmethod
    def from_table(cls, values: Mapping[str, Any], context: LawContext) -> "SwitchingLaw":
        """The law from a scenario's table."""
        limit = math.inf if context.torque_limit is None else context.torque_limit
        usual = limit / np.diag(np.asarray(context.model.spacecraft.inertia))[:2]
        rate_limit, three_axis_limit = (values[name] for name in SLOPE_LIMITS)
        return cls(
            rate_law=RateLaw.from_table(values, context),
            three_axis_law=ThreeAxisLaw.from_table(values, context),
            upper_threshold=values["upper_threshold_rad_s"],
            lower_threshold=values["lower_threshold_rad_s"],
            period=values["period_s"],
            rate_slope_limit=usual if rate_limit is None else rate_limit,
            three_axis_slope_limit=5 * usual if three_axis_limit is None else three_axis_limit,
        )

    def init(self, state: PlantState) -> SwitchingMemory:
        """The initial memory: the three-axis law, unless |ω3| exceeds the upper threshold."""
        return SwitchingMemory(
            jnp.abs(state.omega[2]) > self.upper_threshold,
            jnp.zeros(2, state.omega.dtype),
            jnp.array(False),
            self.three_axis_law.init(state),
        )

    def step(
        self, t: RealScalar, state: PlantState, memory: SwitchingMemory
    ) -> tuple[Pair, SwitchingMemory]:
        """The torque of the chosen law, with the reference derivative by a backward difference."""
        threshold = jnp.where(memory.rate_law_active, self.lower_threshold, self.upper_threshold)
        active = jnp.abs(state.omega[2]) > threshold
        reference = self._reference(state, active)
        slope_limit = jnp.where(active, self.rate_slope_limit, self.three_axis_slope_limit)
        difference = (reference - memory.previous_reference) / self.period
        usable = memory.has_previous & (active == memory.rate_law_active)
        slope = jnp.where(usable, jnp.clip(difference, -slope_limit, slope_limit), 0.0)
        command = jnp.where(
            active,
            self.rate_law.torque(t, state, None, slope),
            self.three_axis_law.torque(t, state, memory.three_axis, slope),
        )
        drive = jnp.where(active, 0.0, state.omega[:2] - reference)
        internal = self.three_axis_law.advance(drive, memory.three_axis, self.period)
        return command, SwitchingMemory(active, reference, jnp.array(True), internal)

    def rate_error(self, state: PlantState, memory: SwitchingMemory) -> Pair:
        """η of the active law, rad/s."""
        return state.omega[:2] - self._reference(state, memory.rate_law_active)

    def mode(self, memory: SwitchingMemory) -> IntScalar:
        """The active `SwitchingMode`."""
        rate, three_axis = SwitchingMode.RATE_LAW, SwitchingMode.THREE_AXIS_LAW
        return jnp.where(memory.rate_law_active, rate, three_axis)

    def _reference(self, state: PlantState, rate_law_active: BoolScalar) -> Pair:
        return jnp.where(
            rate_law_active,
            self.rate_law.reference_rate(state),
            self.three_axis_law.reference_rate(state),
        )
