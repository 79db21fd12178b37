"""diffrax as a newcomer would write it: `vmap` over `diffeqsolve` of the equations."""

import diffrax
import jax
import jax.numpy as jnp

from contenders.contender import TOLERANCES, Contender, Run
from contenders.work import final_state, is_smooth, rate, starts
from jaxsat.studies.ensemble import Study


def solved(study: Study, count: int, solver, steps, first_step: float | None = None) -> Run:
    """A solver of diffrax with the steps of this controller."""
    smooth = is_smooth(study)
    duration = float(study.program.duration)

    @jax.jit
    @jax.vmap
    def run(y, *torque):
        solution = diffrax.diffeqsolve(
            diffrax.ODETerm(lambda t, y, args: rate(t, y, *args, smooth)),
            solver,
            t0=0.0,
            t1=duration,
            dt0=first_step,
            y0=y,
            args=torque,
            stepsize_controller=steps,
            max_steps=None,
        )
        return jnp.asarray(solution.ys)[-1]

    inputs = starts(study, count)
    return lambda: final_state(run(*inputs), smooth)


def tsit5(study: Study, count: int, tolerance: float) -> Run:
    """Steps chosen by diffrax, at the pace of the slowest case."""
    steps = diffrax.PIDController(rtol=tolerance, atol=tolerance)
    return solved(study, count, diffrax.Tsit5(), steps)


def dopri8(study: Study, count: int, tolerance: float) -> Run:
    """The same with a method of eighth order."""
    steps = diffrax.PIDController(rtol=tolerance, atol=tolerance)
    return solved(study, count, diffrax.Dopri8(), steps)


def constant(study: Study, count: int, step: float) -> Run:
    """Equal steps."""
    return solved(study, count, diffrax.Tsit5(), diffrax.ConstantStepSize(), step)


def contenders() -> list[Contender]:
    """Adaptive and constant steps."""
    steps = (0.1, 0.05, 0.025, 0.0125)
    return [
        Contender("diffrax by hand, Tsit5 adaptive", TOLERANCES, tsit5, most=1024),
        Contender("diffrax by hand, Dopri8 adaptive", TOLERANCES, dopri8),
        Contender("diffrax by hand, Tsit5 constant", steps, constant, most=32),
    ]
