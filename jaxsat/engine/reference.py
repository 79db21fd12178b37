"""diffrax over a block of cases: any solver, adaptive steps, every loop. The reference."""

from typing import Any, cast

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr
from jaxtyping import PyTree

from jaxsat.dynamics import PlantState
from jaxsat.engine.fingerprint import traced_block
from jaxsat.engine.interface import AbstractEngine, CostGradient, Mode
from jaxsat.engine.program import Copy, Program
from jaxsat.engine.progress import Integrals, Outputs, judged_at
from jaxsat.engine.rates import augmented_rate, held_rate, plant_state
from jaxsat.metrics import Since
from jaxsat.simulation import (
    AbstractContinuousLoop,
    Method,
    Outcome,
    SampledLoop,
    Signals,
    default_method,
)
from jaxsat.simulation.assessment import Look, Sight, WatchedSolver, WatchedState, still
from jaxsat.simulation.loops import SampledState
from jaxsat.simulation.solve import all_within, outcome_code


class ReferenceEngine(AbstractEngine):
    """`diffeqsolve`, vmapped over the cases of a block.

    `method` is what suits the loop unless given; a sampled loop takes its solver with equal steps,
    `substeps` in each period. Adaptive steps run a block at the pace of its slowest case. Reverse
    mode goes by `adjoint`, one that differentiates what a term closes over, as all but
    `diffrax.BacksolveAdjoint` do.
    """

    method: Method | None = None
    width: int = eqx.field(static=True, default=32)
    adjoint: diffrax.AbstractAdjoint = diffrax.RecursiveCheckpointAdjoint()

    def __check_init__(self):
        if self.width < 1:
            raise ValueError(f"Argument `width` must be at least 1, but got {self.width}.")

    def identity(self) -> dict[str, Any]:
        """The width, and the method with its numbers."""
        if self.method is None:
            return {"name": "diffrax", "width": self.width, "method": None}
        numbers = jax.tree.leaves(eqx.filter(self.method, eqx.is_array))
        method = {
            "solver": type(self.method.solver).__name__,
            "steps": type(self.method.step_size).__name__,
            "numbers": [float(x) for x in numbers],
            "max_steps": self.method.max_steps,
        }
        return {"name": "diffrax", "width": self.width, "method": method}

    def traced(
        self, program: Program, cases: PyTree, gains: PyTree = None, mode: Mode | None = None
    ) -> dict[str, ClosedJaxpr]:
        """The operations of a block."""
        return traced_block(self, program, cases, gains, mode)

    def run_block(self, program: Program, cases: PyTree, gains: PyTree) -> Outputs:
        """Outputs of one block."""
        return _run(self, program, cases, gains)[0]

    def replay_block(
        self, program: Program, cases: PyTree, gains: PyTree, instants: np.ndarray
    ) -> tuple[Outputs, Signals]:
        """Outputs and history of one block, both from the program that runs blocks."""
        outputs, signals = _run(self, program, cases, gains)
        return outputs, jax.tree.map(lambda x: x[:, instants], signals)

    def block_gradient(
        self, program: Program, cases: PyTree, gains: PyTree, mode: Mode
    ) -> CostGradient:
        """Outputs of one block and the derivatives of its costs."""
        return _gradient(self, program, cases, gains, mode)


@eqx.filter_jit
def _run(engine, program, cases, gains):
    def one(case):
        adjoint = diffrax.RecursiveCheckpointAdjoint()
        return _one(engine, program, program.copies(case, gains), adjoint)

    return jax.vmap(one)(cases)


@eqx.filter_jit
def _gradient(engine, program, cases, gains, mode):
    reverse = mode == "reverse"
    adjoint = engine.adjoint if reverse else diffrax.ForwardMode()
    differentiate = jax.jacrev if reverse else jax.jacfwd

    def cost(gains, case):
        copy = program.copies(case, gains)
        outputs = _one(engine, program, copy, adjoint)[0]
        return outputs.cost, outputs

    def one(case):
        derivatives, outputs = differentiate(cost, has_aux=True)(gains, case)
        return CostGradient(outputs, derivatives)

    return jax.vmap(one)(cases)


def _one(engine, program: Program, copy: Copy, adjoint) -> tuple[Outputs, Signals]:
    method = default_method(copy.loop) if engine.method is None else engine.method
    if isinstance(copy.loop, SampledLoop):
        return _sampled(program, copy, method.solver, adjoint)
    return _continuous(program, copy, method, adjoint)


def _continuous(program: Program, copy: Copy, method: Method, adjoint):
    loop = copy.loop
    if not isinstance(loop, AbstractContinuousLoop):
        raise TypeError(f"A loop must be one of jaxsat.simulation, but got {type(loop)}.")
    times = jnp.arange(program.intervals + 1) * program.interval
    zero = jnp.zeros((), times.dtype)
    solver = WatchedSolver(method.solver, _looker(*still((program, loop))))
    solution = diffrax.diffeqsolve(
        diffrax.ODETerm(lambda t, both, args: augmented_rate(program, loop)(t, both)),
        solver,
        t0=times[0],
        t1=times[-1],
        dt0=method.first_step,
        y0=(loop.start(copy.start), Integrals(zero, zero)),
        saveat=diffrax.SaveAt(
            subs=[
                diffrax.SubSaveAt(ts=times, fn=lambda t, both, args: loop.signals(t, both[0])),
                diffrax.SubSaveAt(t1=True),
            ],
            solver_state=True,
        ),
        stepsize_controller=method.step_size,
        max_steps=method.max_steps,
        adjoint=adjoint,
        event=diffrax.Event(lambda t, y, args, **_: ~all_within(y[0], program.state_limit)),
        throw=False,
    )
    signals, final = cast(tuple[Signals, PyTree], solution.ys)
    signals = jax.tree.map(lambda x: jnp.where(jnp.isinf(x), jnp.nan, x), signals)
    state, integrals = jax.tree.map(lambda x: x[0], final)
    code = outcome_code(solution.result)
    plant = plant_state(loop, state)
    settled = solver.since(cast(WatchedState, solution.solver_state).watched, 0)
    return _outputs(program, copy, plant, integrals, signals, settled, code), signals


def _looker(program: Program, loop):
    def look(t, both) -> Look:
        del t
        sight = Sight.of(loop.plant, loop.plant_state(both[0]))
        return Look((sight.excess(program.tolerances),), jnp.zeros(0, sight.z.dtype))

    return look


def _sampled(program: Program, copy: Copy, solver, adjoint):
    loop = cast(SampledLoop, copy.loop)

    def period(carry, number):
        state, integrals, settled, code = carry
        t = number * program.interval
        torque, memory, signals = loop.sample(number, t, state)
        both = (state.plant, integrals)
        for hold in loop.holds(state, torque):
            begin = t + hold.begin
            both, settled = _held(program, loop, solver, adjoint, begin, hold, both, settled)
        plant = PlantState(both[0].attitude.normalised(), both[0].omega)
        fine = all_within((plant, memory), program.state_limit)
        after = (SampledState(plant, memory, torque), both[1], settled)
        new_code = jnp.where(fine, code, int(Outcome.STATE_LIMIT))
        ended = new_code != int(Outcome.SUCCESS)
        kept = jax.tree.map(lambda x, y: jnp.where(ended, y, x), after, carry[:3])
        blank = code != int(Outcome.SUCCESS)
        signals = jax.tree.map(lambda x: jnp.where(blank, jnp.nan, x), signals)
        return (*kept, new_code), signals

    start = loop.start(copy.start)
    zero = jnp.zeros((), start.plant.omega.dtype)
    settled = judged_at(
        Since.begun(zero, 3), zero, Sight.of(loop.plant, start.plant), program.tolerances
    )
    first = (start, Integrals(zero, zero), settled, jnp.array(int(Outcome.SUCCESS)))
    carry, signals = jax.lax.scan(period, first, jnp.arange(program.intervals))
    (state, integrals, settled, code) = carry
    _, last = period(carry, jnp.array(program.intervals))
    signals = jax.tree.map(lambda x, y: jnp.concatenate([x, y[None]]), signals, last)
    return _outputs(program, copy, state.plant, integrals, signals, settled, code), signals


def _held(program, loop, solver, adjoint, begin, hold, both, settled):
    """Equal steps, counted out by a time of their own so that a hold of no length is none."""
    rate = held_rate(program, loop, hold.torque)
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
        y0=both,
        saveat=diffrax.SaveAt(ts=jnp.arange(1.0, loop.substeps + 1)),
        stepsize_controller=diffrax.ConstantStepSize(),
        max_steps=loop.substeps + 1,
        adjoint=adjoint,
        throw=False,
    )
    plants, integrals = cast(tuple[PlantState, Integrals], solution.ys)
    for number in range(loop.substeps):
        plant = jax.tree.map(lambda x, i=number: x[i], plants)
        sight = Sight.of(loop.plant, plant)
        settled = judged_at(settled, begin + (number + 1) * step, sight, program.tolerances)
    return jax.tree.map(lambda x: x[-1], (plants, integrals)), settled


def _outputs(program, copy, plant, integrals, signals, settled: Since, code) -> Outputs:
    code = jnp.where(copy.possible, code, int(Outcome.IMPOSSIBLE_CASE))
    success = code == int(Outcome.SUCCESS)
    rates = jnp.sqrt(jnp.sum(signals.omega**2, axis=1))
    reached = jnp.maximum(jnp.sum(jnp.isfinite(rates)) - 1, 0)  # even the start may be none

    def kept(value):
        return jnp.where(success, value, jnp.nan)

    ended_at = jnp.where(copy.possible, reached * program.interval, 0.0)
    whole = program.cost.whole(integrals.cost, success, program.duration - ended_at)
    return Outputs(
        code=code,
        settling_time=jnp.where(success, settled.settled(program.duration), jnp.inf),
        effort=kept(integrals.effort),
        cost=jnp.where(copy.possible, whole, jnp.nan),
        peak_rate=kept(jnp.max(rates)),
        ended_at=ended_at,
        w=kept(plant.attitude.as_wz().w),
        z=kept(plant.attitude.as_wz().z),
        quaternion=kept(plant.attitude.as_quaternion().q),
        omega=kept(plant.omega),
        drawn=copy.drawn,
    )
