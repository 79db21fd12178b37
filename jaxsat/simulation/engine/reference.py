"""diffrax over a batch of cases: any solver, adaptive steps, every loop. The reference.

What is run by diffrax imports it there.
"""

import dataclasses
from typing import Any, cast

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import PyTree

from jaxsat.core.checks import require_counts
from jaxsat.core.solvers import class_name, solver_of
from jaxsat.core.tolerances import SettlingTracker
from jaxsat.simulation import (
    Method,
    SampledLoop,
    Signals,
    default_method,
    step_size_for,
)
from jaxsat.simulation.assessment import (
    MonitoredState,
    MonitorSample,
    Observation,
    stop_gradient,
)
from jaxsat.simulation.engine.batches import AbstractBatchEngine
from jaxsat.simulation.engine.failure_record import FailureRecord, initial_record, record_of_history
from jaxsat.simulation.engine.interface import CostGradient, Mode
from jaxsat.simulation.engine.program import Case, Program
from jaxsat.simulation.engine.progress import (
    Integrals,
    Outputs,
    initial_progress,
    outputs_of,
    settled_at,
)
from jaxsat.simulation.engine.rates import (
    augmented_rate,
    consumption,
    continuous_loop,
    held_rate,
    plant_state,
)
from jaxsat.simulation.held_torque import HeldTorque
from jaxsat.simulation.methods import AdaptiveSteps, Adjoint, checkpoints
from jaxsat.simulation.solve import outcome_code, run_samples, within_limit
from jaxsat.spacecraft.dynamics import PlantState


class ReferenceEngine(AbstractBatchEngine):
    """`diffeqsolve`, vmapped over the cases of a batch.

    `method` is what suits the loop unless given; a sampled loop takes its solver with equal steps,
    `substeps` in each period. Adaptive steps run a batch at the pace of its slowest case. Reverse
    mode goes by `adjoint`, with checkpoints unless told otherwise; it must differentiate what a
    term closes over, as all but `diffrax.BacksolveAdjoint` do.
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
        return _run(self, program, cases, gains)[0]

    def observe_batch(
        self, program: Program, cases: PyTree, gains: PyTree, instants: np.ndarray
    ) -> tuple[Outputs, Signals]:
        """Outputs and history of one batch, both from the program that runs batches."""
        outputs, signals, held = _run(self, program, cases, gains)
        seen = jax.tree.map(lambda x: x[:, instants], signals)
        if held is None:
            return outputs, seen
        ranges = jax.vmap(lambda held, last: held.between(jnp.asarray(instants), last))
        return outputs, dataclasses.replace(seen, torque_range=ranges(held, seen.torque[:, -1]))

    def differentiate_batch(
        self, program: Program, cases: PyTree, gains: PyTree, mode: Mode
    ) -> CostGradient:
        """Outputs of one batch and the derivatives of its costs."""
        return _gradient(self, program, cases, gains, mode)


@eqx.filter_jit
def _run(engine, program, cases, gains):
    def one(case):
        adjoint = checkpoints()
        return _one(engine, program, program.case_factory(case, gains), adjoint)

    return jax.vmap(one)(cases)


@eqx.filter_jit
def _gradient(engine, program, cases, gains, mode):
    import diffrax

    reverse = mode == "reverse"
    adjoint = (engine.adjoint or checkpoints()) if reverse else diffrax.ForwardMode()
    differentiate = jax.jacrev if reverse else jax.jacfwd

    def cost(gains, case):
        made = program.case_factory(case, gains)
        outputs = _one(engine, program, made, adjoint)[0]
        return outputs.cost, outputs

    def one(case):
        derivatives, outputs = differentiate(cost, has_aux=True)(gains, case)
        return CostGradient(outputs, derivatives)

    return jax.vmap(one)(cases)


def _one(
    engine, program: Program, case: Case, adjoint
) -> tuple[Outputs, Signals, HeldTorque | None]:
    method = default_method(case.loop) if engine.method is None else engine.method
    if isinstance(case.loop, SampledLoop):
        return _sampled(program, case, solver_of(method.solver), adjoint)
    return _continuous(program, case, method, adjoint)


def _continuous(program: Program, case: Case, method: Method, adjoint):
    import diffrax

    from jaxsat.simulation.monitored_solver import MonitoredSolver

    loop = continuous_loop(case)
    times = program.time_of(jnp.arange(program.intervals + 1))
    zero = jnp.zeros((), times.dtype)
    solver = MonitoredSolver(solver_of(method.solver), _monitor(*stop_gradient((program, loop))))
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, both, args: augmented_rate(program, loop)(t, both)),
        solver,
        t0=times[0],
        t1=times[-1],
        dt0=method.first_step,
        y0=(loop.start(case.start), Integrals(zero, zero)),
        saveat=diffrax.SaveAt(
            subs=[
                diffrax.SubSaveAt(ts=times, fn=lambda t, both, args: loop.signals(t, both[0])),
                diffrax.SubSaveAt(t1=True),
            ],
            solver_state=True,
        ),
        stepsize_controller=step_size_for(method, loop),
        max_steps=method.max_steps,
        adjoint=adjoint,
        event=diffrax.Event(lambda t, y, args, **_: ~within_limit(y[0], program.state_limit)),
        throw=False,
    )
    signals, final = cast(tuple[Signals, PyTree], solution.ys)
    signals = jax.tree.map(lambda x: jnp.where(jnp.isinf(x), jnp.nan, x), signals)
    state, integrals = jax.tree.map(lambda x: x[0], final)
    code = outcome_code(solution.result)
    settled = solver.since(cast(MonitoredState, solution.solver_state).record, 0)
    return _outputs(program, case, state, integrals, signals, settled, code), signals, None


def _monitor(program: Program, loop):
    def monitor(t, both) -> MonitorSample:
        observed = Observation.of(loop.plant, loop.plant_state(t, both[0]))
        return MonitorSample((observed.excess(program.tolerances),), jnp.zeros(0, observed.z.dtype))

    return monitor


def _sampled(program: Program, case: Case, solver, adjoint):
    loop = cast(SampledLoop, case.loop)

    def integrate(t, hold, plant, carry):
        return _over_hold(program, loop, solver, adjoint, t, hold, plant, carry)

    zero = jnp.zeros((), case.start.omega.dtype)
    observed = Observation.of(loop.plant, case.start)
    settled = settled_at(SettlingTracker.initial(zero, 3), zero, observed, program.tolerances)
    nothing, limit = HeldTorque.none(case.start.omega), program.state_limit
    carry = (Integrals(zero, zero), settled, nothing)

    def split(carry):
        return (*carry[:2], nothing), carry[2]

    state, (integrals, settled, _), code, signals, held = run_samples(
        loop, case.start, program.intervals, integrate, carry, limit, split=split
    )
    return _outputs(program, case, state, integrals, signals, settled, code), signals, held


def _over_hold(program, loop, solver, adjoint, begin, hold, plant, carry):
    """Equal steps, counted out by a time of their own so that a hold of no length is none."""
    import diffrax

    integrals, settled, held = carry
    rate = held_rate(program, loop, hold, begin)
    first = loop.torque(begin, plant, hold, jnp.zeros_like(hold.length))
    step = hold.length / loop.substeps

    def scaled(number, both, args):
        slope = rate(begin + number * step, both)
        return jax.tree.map(lambda x: x * step, slope)

    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(scaled),
        solver,
        t0=0.0,
        t1=float(loop.substeps),
        dt0=1.0,
        y0=(plant, integrals),
        saveat=diffrax.SaveAt(ts=jnp.arange(1.0, loop.substeps + 1)),
        stepsize_controller=diffrax.ConstantStepSize(),
        max_steps=loop.substeps + 1,
        adjoint=adjoint,
        throw=False,
    )
    plants, integrals = cast(tuple[PlantState, Integrals], solution.ys)
    for number in range(loop.substeps):
        plant = jax.tree.map(lambda x, i=number: x[i], plants)
        observed = Observation.of(loop.plant, plant)
        settled = settled_at(settled, begin + (number + 1) * step, observed, program.tolerances)
    plant, integrals = jax.tree.map(lambda x: x[-1], (plants, integrals))
    last = loop.torque(begin + hold.length, plant, hold, hold.length)
    held = held.with_hold(*stop_gradient((hold.length, first, last)))
    return plant, (integrals, settled, held)


def _outputs(program, case, state, integrals, signals, settled: SettlingTracker, code) -> Outputs:
    plant, momentum = plant_state(case.loop, program.duration, state), signals.wheel_momentum
    squares = jnp.sum(signals.omega**2, axis=1)
    reached = jnp.maximum(jnp.sum(jnp.isfinite(squares)) - 1, 0)  # even the start may be none
    progress = initial_progress(None, plant, case.possible)
    progress = progress._replace(
        integrals=integrals,
        peak_square=jnp.max(squares),
        settled=settled,
        ended_at=jnp.where(case.possible, program.time_of(reached), 0.0),
        code=jnp.where(case.possible, code, progress.code),
        peak_momentum=None if momentum is None else jnp.max(jnp.abs(momentum), axis=0),
        failures=_failures(program, case, signals),
    )
    used = consumption(case.loop, state)
    return outputs_of(
        progress,
        plant,
        program.duration,
        case.drawn,
        program.cost,
        used,
        program.interval,
        dwell=program.tolerances.dwell,
    )


def _failures(program: Program, case: Case, signals: Signals) -> FailureRecord | None:
    """What the history of a sampled loop with failures tells of them."""
    if not isinstance(case.loop, SampledLoop):
        return None
    samples = jax.tree.map(lambda x: x[:-1], signals)
    times = program.time_of(jnp.arange(program.intervals))
    begin = initial_record(case.loop, case.loop.start(case.start))
    return record_of_history(begin, times, samples, program.tolerances)


def _step_control(method: Method) -> str:
    """The class by which diffrax controls the method's steps."""
    steps = method.step_size
    if steps is None:
        return "ConstantStepSize"
    return "PIDController" if isinstance(steps, AdaptiveSteps) else type(steps).__name__
