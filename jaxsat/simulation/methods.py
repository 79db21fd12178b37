"""Integration methods (solver, steps and tolerances), with a default for each kind of loop."""

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
"""Largest number of adaptive steps: many times a sound run's; sliding on a corner exhausts it."""

SMOOTH_STEP = 0.01
"""Length (s) of equal steps of a smooth loop whose scenario names a solver of low order alone."""

MIN_STEP = 1e-10
"""Smallest step, s: far below a law's time scales, far above the round-off of 1000 s."""


class AdaptiveSteps(eqx.Module):
    """Adaptive step control by tolerances; steps of `min_step` (s) are accepted with any error.

    `atol` is in the unit of each state, for momenta of wheels `Spacecraft.momentum_unit`.
    """

    rtol: RealScalar = eqx.field(converter=positive("rtol"))
    atol: RealScalar = eqx.field(converter=positive("atol"))
    min_step: RealScalar | None = None

    def controller(self, body: RigidBody) -> StepSizeController:
        """The step-size controller of diffrax for a loop of this body."""
        from jaxsat.simulation.diffrax_parts import StepControl  # imports diffrax

        return StepControl(
            rtol=self.rtol, atol=self.atol, dtmin=self.min_step, force_dtmin=True, body=body
        )


class Method(eqx.Module):
    """A solver of diffrax and its steps: adaptive, any controller of diffrax, or None for equal
    steps.

    The numbers are arrays, so changing a tolerance or a step does not recompile.
    """

    solver: Solver
    step_size: AdaptiveSteps | StepSizeController | None
    first_step: RealScalar | None
    max_steps: int = eqx.field(static=True)


def step_size_for(method: Method, loop: AbstractLoop) -> StepSizeController:
    """The method's step-size controller; adaptive steps end at the loop's failures in flight."""
    import diffrax  # slow to import

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
    """Adaptive steps by tolerances; steps of `min_step` (s) are accepted with any error.

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
    """The default differentiation of diffrax: reverse mode with checkpoints."""
    import diffrax  # slow to import

    return diffrax.RecursiveCheckpointAdjoint()


def default_method(loop: AbstractLoop, solver: Solver | None = None) -> Method:
    """The default method of a loop, with the given solver or Dopri8.

    Continuous loops get tight adaptive steps, with a smallest step that passes the zero crossings
    of ω3 in (38); smooth ones equal steps of 0.01 s with a solver of low order, which would take
    too many adaptive steps. Sampled loops derive their steps from their own period.
    """
    smooth = isinstance(loop, ContinuousLoop) and loop.is_smooth()
    low = isinstance(solver, NamedSolver) and solver.name not in HIGH_ORDER
    if isinstance(loop, AbstractContinuousLoop) and not (smooth and low):
        most = MAX_FIXED_STEPS if smooth else ADAPTIVE_MAX_STEPS
        return adaptive(solver=solver, min_step=MIN_STEP, max_steps=most)
    return fixed(SMOOTH_STEP, solver or NamedSolver("dopri8"))
