"""The reference engine: any solver of diffrax, adaptive steps, every loop, over batches of cases.

diffrax is imported on use.
"""

from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxsat.core.checks import require_counts
from jaxsat.core.solvers import class_name
from jaxsat.simulation.engine.batches import AbstractBatchEngine
from jaxsat.simulation.engine.diffrax_run import Integrated, integrated
from jaxsat.simulation.engine.interface import CostGradient, Mode
from jaxsat.simulation.engine.program import Case, Program
from jaxsat.simulation.engine.progress import Outputs
from jaxsat.simulation.held_torque import saved
from jaxsat.simulation.methods import AdaptiveSteps, Adjoint, Method, checkpoints, default_method
from jaxsat.simulation.trajectory import Signals


class ReferenceEngine(AbstractBatchEngine):
    """`diffeqsolve`, vmapped over the cases of a batch.

    By default `method` is the loop's `default_method`; a sampled loop takes its solver with equal
    steps, `substeps` in each period. Adaptive steps run a batch at the pace of its slowest case.
    Reverse mode of a continuous loop uses `adjoint`, by default with checkpoints; it must
    differentiate the variables that a term closes over, as all but `diffrax.BacksolveAdjoint` do.
    """

    method: Method | None = None
    batch_size: int = eqx.field(static=True, default=32)
    adjoint: Adjoint | None = None

    def __check_init__(self):
        require_counts(batch_size=self.batch_size)

    def identity(self) -> dict[str, Any]:
        """The batch size, and the method with its numbers."""
        if self.method is None:
            return {"name": "diffrax", "batch_size": self.batch_size, "method": None}
        numbers = jax.tree.leaves(eqx.filter(self.method, eqx.is_array))
        method = {
            "solver": class_name(self.method.solver),
            "steps": _step_control(self.method),
            "numbers": [float(x) for x in numbers],
            "max_steps": self.method.max_steps,
        }
        return {"name": "diffrax", "batch_size": self.batch_size, "method": method}

    def run_batch(self, program: Program, cases: PyTree, gains: PyTree) -> Outputs:
        """Outputs of one batch."""
        return _run(self, program, cases, gains).outputs

    def observe_batch(
        self, program: Program, cases: PyTree, gains: PyTree, instants: np.ndarray
    ) -> tuple[Outputs, Signals]:
        """Outputs and history of one batch, both from the program that runs batches."""
        outputs, signals, holds = _run(self, program, cases, gains)
        if holds is None:
            return outputs, jax.tree.map(lambda x: x[:, instants], signals)
        numbers = jnp.asarray(instants)
        return outputs, jax.vmap(lambda *case: saved(case[0], numbers, case[1]))(signals, holds)

    def differentiate_batch(
        self, program: Program, cases: PyTree, gains: PyTree, mode: Mode
    ) -> CostGradient:
        """Outputs of one batch and the derivatives of its costs."""
        return _gradient(self, program, cases, gains, mode)


@eqx.filter_jit
def _run(engine, program, cases, gains) -> Integrated:
    def one(case):
        return _run_case(engine, program, program.case_factory(case, gains), checkpoints())

    return jax.vmap(one)(cases)


@eqx.filter_jit
def _gradient(engine, program, cases, gains, mode):
    import diffrax

    reverse = mode == "reverse"
    adjoint = (engine.adjoint or checkpoints()) if reverse else diffrax.ForwardMode()
    differentiate = jax.jacrev if reverse else jax.jacfwd

    def cost(gains, case):
        outputs = _run_case(engine, program, program.case_factory(case, gains), adjoint).outputs
        return outputs.cost, outputs

    def one(case):
        derivatives, outputs = differentiate(cost, has_aux=True)(gains, case)
        return CostGradient(outputs, derivatives)

    return jax.vmap(one)(cases)


def _run_case(
    engine: ReferenceEngine, program: Program, case: Case, adjoint: Adjoint
) -> Integrated:
    method = default_method(case.loop) if engine.method is None else engine.method
    times = program.time_of(jnp.arange(program.intervals + 1))
    return integrated(program, case, times, method, adjoint)


def _step_control(method: Method) -> str:
    """Name of the class by which diffrax controls the method's steps."""
    steps = method.step_size
    if steps is None:
        return "ConstantStepSize"
    return "PIDController" if isinstance(steps, AdaptiveSteps) else type(steps).__name__
