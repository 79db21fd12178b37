"""How a loop is integrated: solver, steps and tolerances, with a default that suits the loop."""

from typing import TYPE_CHECKING, Any

import equinox as eqx

from jaxsat.core.array_types import RealScalar
from jaxsat.core.checks import as_float, positive, require_positive
from jaxsat.core.ranges import MAX_FIXED_STEPS
from jaxsat.core.solvers import HIGH_ORDER, NamedSolver, Solver
from jaxsat.simulation.loops import AbstractContinuousLoop, AbstractLoop, ContinuousLoop
from jaxsat.spacecraft.dynamics import RigidBody

if TYPE_CHECKING:
    from diffrax import AbstractAdjoint as Adjoint
    from diffrax import AbstractStepSizeController as StepSizeController
else:
    Adjoint = StepSizeController = Any

ADAPTIVE_MAX_STEPS = 2**17
"""Many times what a sound run needs; a law that slides on a corner uses them up in seconds."""

SMOOTH_STEP = 0.01
"""Seconds; equal steps of a smooth loop whose scenario names a solver of low order alone."""

MIN_STEP = 1e-10
"""Seconds. Far below anything a law resolves, and far above the rounding of a time of 1000 s."""


class AdaptiveSteps(eqx.Module):
    """Steps chosen to meet tolerances; `min_step` (s) is taken whatever the error there.

    `atol` is in the unit of each state, for momenta of wheels `Spacecraft.momentum_unit`.
    """

    rtol: RealScalar = eqx.field(converter=positive("rtol"))
    atol: RealScalar = eqx.field(converter=positive("atol"))
    min_step: RealScalar | None = None

    def controller(self, body: RigidBody) -> StepSizeController:
        """What diffrax takes for it, in a loop of this body."""
        from jaxsat.simulation.diffrax_parts import StepControl  # imports diffrax

        return StepControl(
            rtol=self.rtol, atol=self.atol, dtmin=self.min_step, force_dtmin=True, body=body
        )


class Method(eqx.Module):
    """A solver of diffrax and its steps: adaptive ones, any controller of diffrax, or None: equal.

    Numbers in it are arrays, so changing a tolerance or a step compiles nothing anew.
    """

    solver: Solver
    step_size: AdaptiveSteps | StepSizeController | None
    first_step: RealScalar | None
    max_steps: int = eqx.field(static=True)


def step_size_for(method: Method, loop: AbstractLoop) -> StepSizeController:
    """The method's steps, which end where something of the loop fails, if they are adaptive."""
    import diffrax  # takes its time

    steps = method.step_size
    if steps is None:
        return diffrax.ConstantStepSize()
    if isinstance(steps, AdaptiveSteps):
        steps = steps.controller(loop.plant)
    if not isinstance(loop, ContinuousLoop) or not isinstance(steps, diffrax.PIDController):
        return steps
    times = loop.failure_times
    return diffrax.ClipStepSizeController(steps, jump_ts=times) if times.size else steps


def adaptive(
    rtol: float = 1e-13,
    atol: float = 1e-14,
    solver: Solver | None = None,
    min_step: float | None = None,
    max_steps: int = ADAPTIVE_MAX_STEPS,
) -> Method:
    """Steps chosen to meet tolerances; `min_step` (s) is taken whatever the error there.

    The default solver is Dopri8. A smallest step lets a run pass points where a law has no
    derivative, such as ω3 = 0 in (38), at the cost of an error of that step's size.
    """
    least = None if min_step is None else as_float(min_step)
    steps = AdaptiveSteps(rtol, atol, least)
    return Method(solver or NamedSolver("dopri8"), steps, None, max_steps)


def fixed(step: float, solver: Solver | None = None) -> Method:
    """Equal steps of `step` seconds; the default solver is Dopri5."""
    require_positive("step", step)
    return Method(solver or NamedSolver("dopri5"), None, as_float(step), MAX_FIXED_STEPS)


def checkpoints() -> Adjoint:
    """How diffrax differentiates unless stated otherwise: reverse mode with checkpoints."""
    import diffrax  # takes its time

    return diffrax.RecursiveCheckpointAdjoint()


def default_method(loop: AbstractLoop, solver: Solver | None = None) -> Method:
    """What suits a loop, with a solver of one's own or Dopri8.

    Continuous loops get tight adaptive steps, with a smallest step that passes the zero crossings
    of ω3 in (38); smooth ones equal steps of 0.01 s with a solver of low order, which would take
    too many of the others. Sampled loops take their steps from their own period.
    """
    smooth = isinstance(loop, ContinuousLoop) and loop.is_smooth()
    low = isinstance(solver, NamedSolver) and solver.name not in HIGH_ORDER
    if isinstance(loop, AbstractContinuousLoop) and not (smooth and low):
        most = MAX_FIXED_STEPS if smooth else ADAPTIVE_MAX_STEPS
        return adaptive(solver=solver, min_step=MIN_STEP, max_steps=most)
    return fixed(SMOOTH_STEP, solver or NamedSolver("dopri8"))
