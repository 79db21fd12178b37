"""How a loop is integrated: solver, steps and tolerances, with a default that suits the loop."""

import diffrax
import equinox as eqx
from jaxtyping import Array, Float

from jaxsat.checks import as_float, require_positive
from jaxsat.ranges import MAX_FIXED_STEPS
from jaxsat.simulation.error_coordinates import ErrorCoordinateLoop
from jaxsat.simulation.loops import AbstractLoop, ContinuousLoop

ADAPTIVE_MAX_STEPS = 2**17
"""Many times what a sound run needs; a law that slides on a corner uses them up in seconds."""

MIN_STEP = 1e-10
"""Seconds. Far below anything a law resolves, and far above the rounding of a time of 1000 s."""


class Method(eqx.Module):
    """A diffrax solver with its step-size controller.

    Numbers in it are arrays, so changing a tolerance or a step compiles nothing anew.
    """

    solver: diffrax.AbstractSolver
    step_size: diffrax.AbstractStepSizeController
    first_step: Float[Array, ""] | None
    max_steps: int = eqx.field(static=True)


def step_size_for(method: Method, loop: AbstractLoop) -> diffrax.AbstractStepSizeController:
    """The method's steps, which end where something of the loop fails, if they are adaptive."""
    steps = method.step_size
    if not isinstance(loop, ContinuousLoop) or not isinstance(steps, diffrax.PIDController):
        return steps
    times = loop.failure_times
    return diffrax.ClipStepSizeController(steps, jump_ts=times) if times.size else steps


def adaptive(
    rtol: float = 1e-13,
    atol: float = 1e-14,
    solver: diffrax.AbstractSolver | None = None,
    min_step: float | None = None,
    max_steps: int = ADAPTIVE_MAX_STEPS,
) -> Method:
    """Steps chosen to meet tolerances; `min_step` (s) is taken whatever the error there.

    The default solver is Dopri8. A smallest step lets a run pass points where a law has no
    derivative, such as ω3 = 0 in (38), at the cost of an error of that step's size.
    """
    for name, value in (("rtol", rtol), ("atol", atol)):
        require_positive(name, value)
    controller = diffrax.PIDController(
        rtol=as_float(rtol),
        atol=as_float(atol),
        dtmin=None if min_step is None else as_float(min_step),
        force_dtmin=True,
    )
    return Method(solver or diffrax.Dopri8(), controller, None, max_steps)


def fixed(step: float, solver: diffrax.AbstractSolver | None = None) -> Method:
    """Equal steps of `step` seconds; the default solver is Dopri5."""
    require_positive("step", step)
    return Method(
        solver or diffrax.Dopri5(), diffrax.ConstantStepSize(), as_float(step), MAX_FIXED_STEPS
    )


def default_method(loop: AbstractLoop) -> Method:
    """What suits a loop.

    Printed laws have corners: they get tight adaptive steps, with a smallest step that passes the
    zero crossings of ω3 in (38). Smooth loops get equal steps of 0.01 s, and sampled loops take
    their steps from their own period.
    """
    if isinstance(loop, ErrorCoordinateLoop):
        return adaptive(min_step=MIN_STEP)
    if isinstance(loop, ContinuousLoop) and not loop.is_smooth():
        return adaptive(min_step=MIN_STEP)
    return fixed(0.01, diffrax.Dopri8())
