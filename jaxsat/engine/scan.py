"""A plain loop over intervals, compiled once for any horizon.

Runs of any length are pieces of one compiled loop with the number of intervals as an input, so a
replay that stops at every interval goes through the same machine code as the run did.
"""

import itertools
import math
from typing import Any

import diffrax
import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jax.extend.core import ClosedJaxpr
from jaxtyping import Array, Int, PyTree

from jaxsat.engine import adaptive
from jaxsat.engine.adaptive import Tolerance
from jaxsat.engine.dense_output import dense_output
from jaxsat.engine.fingerprint import traced_block
from jaxsat.engine.fixed import advance_in_equal_steps, advance_with_drawn_noise
from jaxsat.engine.interface import AbstractEngine, CostGradient, Mode
from jaxsat.engine.program import Program
from jaxsat.engine.progress import (
    Outputs,
    Progress,
    begun,
    judged_at,
    looked_at,
    outputs_of,
)
from jaxsat.engine.rates import plant_state
from jaxsat.engine.runge_kutta import tableau_of
from jaxsat.simulation import AbstractLoop, Outcome, SampledLoop, Signals
from jaxsat.simulation.assessment import Sight

NOISE_BLOCK = 16
"""Samples whose noise is drawn together. More gain little, and a replay, which stops at every
sample, draws all but one of them in vain."""

CASES = "cases"
"""The name of a block's axis."""


class ScanEngine(AbstractEngine):
    """A loop of our own around the tableau of an explicit Runge-Kutta solver of diffrax.

    A sampled loop takes its own `substeps` in each period, any other loop `substeps` of the engine
    in each interval, or, with a `tolerance`, steps of whatever length meets it.
    """

    solver: diffrax.AbstractSolver = diffrax.Tsit5()
    substeps: int = eqx.field(static=True, default=20)
    lanes: int = eqx.field(static=True, default=64)
    tolerance: Tolerance | None = None

    def __check_init__(self):
        tableau_of(self.solver)
        if self.tolerance is not None:
            dense_output(self.solver)
        for name in ("substeps", "lanes"):
            if getattr(self, name) < 1:
                raise ValueError(
                    f"Argument `{name}` must be at least 1, but got {getattr(self, name)}."
                )

    @property
    def width(self) -> int:  # pyright: ignore[reportIncompatibleVariableOverride]
        """How many cases a block has."""
        return self.lanes

    def identity(self) -> dict[str, Any]:
        """Solver, steps and lanes."""
        solver = type(self.solver).__name__
        fixed = {"name": "scan", "solver": solver, "substeps": self.substeps, "lanes": self.lanes}
        if self.tolerance is None:
            return fixed
        numbers = [float(x) for x in jax.tree.leaves(self.tolerance)]
        return fixed | {"tolerance": [*numbers, self.tolerance.max_steps]}

    def traced(
        self, program: Program, cases: PyTree, gains: PyTree = None, mode: Mode | None = None
    ) -> dict[str, ClosedJaxpr]:
        """The operations of a block."""
        return traced_block(self, program, cases, gains, mode)

    def run_block(self, program: Program, cases: PyTree, gains: PyTree) -> Outputs:
        """Outputs of one block."""
        progress = _begin(self, program, cases, gains)
        progress = _advance(self, program, cases, gains, progress, 0, program.intervals)
        return _finish(self, program, cases, gains, progress)

    def replay_block(
        self, program: Program, cases: PyTree, gains: PyTree, instants: np.ndarray
    ) -> tuple[Outputs, Signals]:
        """Outputs of one block, stopped at some intervals to be observed."""
        progress = _begin(self, program, cases, gains)
        history = []
        for number, following in itertools.pairwise(instants.tolist()):
            history.append(_to_host(_observe(self, program, cases, gains, progress, number)))
            progress = _advance(self, program, cases, gains, progress, number, following - number)
        last = _observe(self, program, cases, gains, progress, program.intervals)
        history.append(_to_host(last))
        signals = jax.tree.map(lambda *parts: np.stack(parts, axis=1), *history)
        return _finish(self, program, cases, gains, progress), signals

    def block_gradient(
        self, program: Program, cases: PyTree, gains: PyTree, mode: Mode
    ) -> CostGradient:
        """Outputs of one block and the derivatives of its costs."""
        if mode == "reverse" and self.tolerance is not None:
            raise ValueError(
                'Argument `mode` must be "forward" with adaptive steps of the scan engine, '
                'but got "reverse"; the diffrax engine has both.'
            )
        return _gradient(self, program, cases, gains, mode)


def _to_host(signals: Signals) -> Signals:
    """NumPy arrays: thousands of instants are not to be stacked by a compiled program."""
    return jax.tree.map(np.asarray, signals)


def begin_one(engine: ScanEngine, program: Program, case: PyTree, gains: PyTree) -> Progress:
    """Progress of one trajectory at time zero."""
    copy = program.copies(case, gains)
    if engine.tolerance is not None and _is_adaptive(engine, copy.loop):
        return adaptive.begin(engine.solver, engine.tolerance, program, copy)
    return begun(copy.loop.start(copy.start), copy.start.omega, copy.possible)


def _is_adaptive(engine: ScanEngine, loop: AbstractLoop) -> bool:
    return engine.tolerance is not None and not isinstance(loop, SampledLoop)


def advance_one(
    engine, program, case, gains, progress, first, count, noise_block: int = 1, batch=None
) -> Progress:
    """Progress of one trajectory after `count` intervals from number `first` on.

    Noise of sensors is drawn for `noise_block` samples at a time. Under `vmap` over an axis of
    name `batch` steps are those of the whole batch.
    """
    copy = program.copies(case, gains)
    loop, tableau = copy.loop, tableau_of(engine.solver)
    if _is_adaptive(engine, loop):
        return adaptive.advance_adaptively(
            engine.solver, engine.tolerance, program, copy, progress, first + count, batch
        )
    where = (program, loop, progress, first, count)
    if noise_block > 1 and isinstance(loop, SampledLoop) and loop.sensors is not None:
        return advance_with_drawn_noise(tableau, *where, noise_block)
    return advance_in_equal_steps(tableau, engine.substeps, *where)


def finish_one(engine, program, case, gains, progress, number) -> Outputs:
    """Outputs of one trajectory that has gone through all its intervals, `number` of them."""
    copy, end = program.copies(case, gains), number * program.interval
    if _is_adaptive(engine, copy.loop):
        return adaptive.finish(engine.solver, program, copy, progress, end)
    signals = _signals(copy.loop, program, number, progress.state)
    plant = plant_state(copy.loop, progress.state)
    sight = Sight.of(copy.loop.plant, plant)
    settled = judged_at(progress.settled, end, sight, program.tolerances)
    seen = looked_at(progress, signals)._replace(settled=settled)
    return outputs_of(seen, plant, end, copy.drawn, program.cost)


def observe_one(engine, program, case, gains, progress, number) -> Signals:
    """Signals at the beginning of interval `number`; NaN after the end of a failed run."""
    copy = program.copies(case, gains)
    if _is_adaptive(engine, copy.loop):
        signals = adaptive.observe(engine.solver, program, copy, progress, number)
    else:
        signals = _signals(copy.loop, program, number, progress.state)
    ended = progress.code != int(Outcome.SUCCESS)
    return jax.tree.map(lambda x: jnp.where(ended, jnp.nan, x), signals)


def _signals(loop, program, number: Int[Array, ""], state) -> Signals:
    t = number * program.interval
    if isinstance(loop, SampledLoop):
        return loop.sample(number, t, state)[2]
    return loop.signals(t, state)


def _over_cases(engine, one, *per_case):
    """`one` for a block."""
    del engine
    return jax.vmap(one, axis_name=CASES)(*per_case)


@eqx.filter_jit
def _begin(engine, program, cases, gains):
    return _over_cases(engine, lambda case: begin_one(engine, program, case, gains), cases)


@eqx.filter_jit
def _advance_jit(engine, program, cases, gains, progress, first, count):
    def one(case, progress):
        return _noise_in_blocks(engine, program, case, gains, progress, first, count)

    return _over_cases(engine, one, cases, progress)


def _advance(engine, program, cases, gains, progress, first: int, count: int):
    bounds = (jnp.array(first), jnp.array(count))
    return _advance_jit(engine, _any_length(program), cases, gains, progress, *bounds)


def _any_length(program: Program) -> Program:
    """The program with a length that says nothing: the compiled loop takes it as an input."""
    rest = (program.interval, 1, program.tolerances, program.cost, program.state_limit)
    return Program(program.copies, *rest)


@eqx.filter_jit
def _finish_jit(engine, program, cases, gains, progress, number):
    def one(case, progress):
        return finish_one(engine, program, case, gains, progress, number)

    return _over_cases(engine, one, cases, progress)


def _finish(engine, program, cases, gains, progress):
    number = jnp.array(program.intervals)
    return _finish_jit(engine, _any_length(program), cases, gains, progress, number)


@eqx.filter_jit
def _observe_jit(engine, program, cases, gains, progress, number):
    def one(case, progress):
        return observe_one(engine, program, case, gains, progress, number)

    return _over_cases(engine, one, cases, progress)


def _observe(engine, program, cases, gains, progress, number: int):
    return _observe_jit(engine, _any_length(program), cases, gains, progress, jnp.array(number))


@eqx.filter_jit
def _gradient(engine, program, cases, gains, mode):
    def cost(gains, case):
        advance = _checkpointed if mode == "reverse" else _noise_in_blocks
        progress = begin_one(engine, program, case, gains)
        progress = advance(engine, program, case, gains, progress, 0, program.intervals)
        outputs = finish_one(engine, program, case, gains, progress, jnp.array(program.intervals))
        return outputs.cost, outputs

    differentiate = jax.jacrev if mode == "reverse" else jax.jacfwd

    def one(case):
        derivatives, outputs = differentiate(cost, has_aux=True)(gains, case)
        return CostGradient(outputs, derivatives)

    return _over_cases(engine, one, cases)


def _noise_in_blocks(engine, program, case, gains, progress, first, count) -> Progress:
    return advance_one(engine, program, case, gains, progress, first, count, NOISE_BLOCK, CASES)


def _checkpointed(engine, program, case, gains, progress, first, count: int) -> Progress:
    """Like `advance_one`, for reverse mode: about 2 √count states are kept instead of every step.

    Blocks of intervals are computed again on the way back, and in them every interval.
    """
    size = max(1, math.isqrt(count))

    @jax.checkpoint
    def one(progress, number):
        return advance_one(engine, program, case, gains, progress, number, 1), None

    @jax.checkpoint
    def block(progress, numbers):
        return jax.lax.scan(one, progress, numbers)[0], None

    numbers = first + jnp.arange(count)
    whole = count - count % size
    progress = jax.lax.scan(block, progress, numbers[:whole].reshape(-1, size))[0]
    return jax.lax.scan(one, progress, numbers[whole:])[0]
