"""A plain loop over intervals, compiled once for any horizon.

Runs of any length are pieces of one compiled loop with the number of intervals as an input, so a
replay that stops at every interval uses the same machine code as the run.
"""

import itertools
import math
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxsat.core.checks import require_counts
from jaxsat.simulation.engine.adaptive import AdaptiveStepper
from jaxsat.simulation.engine.batches import AbstractBatchEngine
from jaxsat.simulation.engine.fixed import FixedStepper, stepper_for
from jaxsat.simulation.engine.interface import CostGradient, Mode, stops, with_ranges_ahead
from jaxsat.simulation.engine.program import Program
from jaxsat.simulation.engine.progress import Outputs, Progress
from jaxsat.simulation.engine.stepper import AbstractStepper
from jaxsat.simulation.trajectory import Signals

CASES = "cases"
"""Name of a batch's axis."""


class ScanEngine(AbstractBatchEngine):
    """Steps by an explicit Runge-Kutta solver of diffrax, compiled by XLA, over batches of cases.

    `batch_size` cases go through one compiled program at a time. A sampled loop takes its own
    substeps in each period, with the stepper's solver.
    """

    stepper: AbstractStepper = eqx.field(default_factory=FixedStepper)
    batch_size: int = eqx.field(static=True, default=64)

    def __check_init__(self):
        require_counts(batch_size=self.batch_size)

    def identity(self) -> dict[str, Any]:
        """Steps and batch size, as plain data."""
        return {"name": "scan", **self.stepper.identity(), "batch_size": self.batch_size}

    def run_batch(self, program: Program, cases: PyTree, gains: PyTree) -> Outputs:
        """Outputs of one batch."""
        work = (self.stepper, program.of_any_length(), cases, gains)
        number = jnp.array(program.intervals)
        progress = _of_cases("advance", *work, _of_cases("begin", *work), jnp.array(0), number)
        return _of_cases("finish", *work, progress, number)

    def observe_batch(
        self, program: Program, cases: PyTree, gains: PyTree, instants: np.ndarray
    ) -> tuple[Outputs, Signals]:
        """Outputs of one batch, stopped at these intervals for observation."""
        work = (self.stepper, program.of_any_length(), cases, gains)
        progress = _of_cases("begin", *work)
        history = []
        behind = progress.sums is not None
        for before, number in itertools.pairwise([0, *stops(instants.tolist(), behind)]):
            first, count = jnp.array(before), jnp.array(number - before)
            progress = _of_cases("advance", *work, progress, first, count)
            signals = _of_cases("observe", *work, progress, jnp.array(number))
            history.append(jax.tree.map(np.asarray, signals))  # JAX would compile a stack of them
        signals = jax.tree.map(lambda *parts: np.stack(parts, axis=1), *history)
        outputs = _of_cases("finish", *work, progress, jnp.array(program.intervals))
        return outputs, with_ranges_ahead(signals, behind)

    def differentiate_batch(
        self, program: Program, cases: PyTree, gains: PyTree, mode: Mode
    ) -> CostGradient:
        """Outputs of one batch and the derivatives of its costs."""
        if mode == "reverse" and isinstance(self.stepper, AdaptiveStepper):
            raise ValueError(
                'Argument `mode` must be "forward" with adaptive steps of the scan engine, '
                'but got "reverse"; the diffrax engine has both.'
            )
        return _gradient(self.stepper, program, cases, gains, mode)


@eqx.filter_jit
def _of_cases(
    method: str, stepper, program, cases, gains, progress: Progress | None = None, *numbers
):
    """The results of a stepper's method for the cases of a batch, all with the same numbers."""
    last = (CASES,) if method == "advance" else ()

    def one(case, progress):
        case = program.case_factory(case, gains)
        before = () if progress is None else (progress,)
        return getattr(stepper_for(stepper, case.loop), method)(
            program, case, *before, *numbers, *last
        )

    return jax.vmap(one, axis_name=CASES)(cases, progress)


@eqx.filter_jit
def _gradient(stepper, program, cases, gains, mode):
    reverse = mode == "reverse"
    differentiate = jax.jacrev if reverse else jax.jacfwd

    def cost(gains, case):
        case = program.case_factory(case, gains)
        steps = stepper_for(stepper, case.loop)
        work, progress = (program, case), steps.begin(program, case)
        if reverse:
            progress = _advance_with_checkpoints(steps, *work, progress, program.intervals)
        else:
            progress = steps.advance(*work, progress, 0, program.intervals, CASES)
        outputs = steps.finish(*work, progress, jnp.array(program.intervals))
        return outputs.cost, outputs

    def one(case):
        derivatives, outputs = differentiate(cost, has_aux=True)(gains, case)
        return CostGradient(outputs, derivatives)

    return jax.vmap(one, axis_name=CASES)(cases)


def _advance_with_checkpoints(
    stepper: AbstractStepper, program, case, progress, count: int
) -> Progress:
    """The progress after all intervals, for reverse mode, which stores about 2 √count states.

    Blocks of intervals, and every interval in them, are recomputed in the backward pass.
    """
    size = max(1, math.isqrt(count))

    @jax.checkpoint
    def one(progress, number):
        return stepper.advance(program, case, progress, number, 1), None

    @jax.checkpoint
    def block(progress, numbers):
        return jax.lax.scan(one, progress, numbers)[0], None

    numbers = jnp.arange(count)
    whole = count - count % size
    progress = jax.lax.scan(block, progress, numbers[:whole].reshape(-1, size))[0]
    return jax.lax.scan(one, progress, numbers[whole:])[0]
