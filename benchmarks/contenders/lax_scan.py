"""A `lax.scan` written by hand: RK4 with equal steps, what a person in a hurry would write."""

import functools

import jax
import jax.numpy as jnp

from contenders.contender import Contender, Run
from contenders.work import final_state, is_smooth, starts
from contenders.work import rate as rate_of
from jaxsat.studies.ensemble import Study


def rk4(study: Study, count: int, step: float) -> Run:
    """Every case in one vmapped scan."""
    smooth = is_smooth(study)
    rate = functools.partial(rate_of, smooth=smooth)
    steps = round(float(study.program.duration) / step)

    @jax.jit
    @jax.vmap
    def run(y, *torque):
        def body(y, k):
            t = k * step
            a = rate(t, y, *torque)
            b = rate(t + step / 2, y + step / 2 * a, *torque)
            c = rate(t + step / 2, y + step / 2 * b, *torque)
            d = rate(t + step, y + step * c, *torque)
            return y + step / 6 * (a + 2 * b + 2 * c + d), None

        return jax.lax.scan(body, y, jnp.arange(steps))[0]

    inputs = starts(study, count)
    return lambda: final_state(run(*inputs), smooth)


def contenders() -> list[Contender]:
    """RK4 from coarse to fine."""
    return [Contender("lax.scan by hand, RK4", (0.1, 0.05, 0.025, 0.0125), rk4)]
