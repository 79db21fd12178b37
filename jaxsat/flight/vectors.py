"""Test vectors, samples of closed loops and edge cases with expected results; a recorded flight."""

from collections.abc import Callable
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, PyTree

from jaxsat.compiler.llvm.mapped import compiled_over_cases
from jaxsat.control.navigation.estimator import AbstractEstimator, Estimate, Measurement
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.array_types import IntScalar, RealScalar
from jaxsat.core.attitude import Quaternion
from jaxsat.core.solvers import NamedSolver
from jaxsat.core.text import csv_text
from jaxsat.core.trees import choose
from jaxsat.flight.calls import EXTREMES, trees_of
from jaxsat.flight.flight import Input, Seen, State, modulator_of
from jaxsat.flight.guard import first_attitude, has_tracker, real_type
from jaxsat.flight.measurements import measured_by, vectors_of
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.reference import Reference, rows_of
from jaxsat.flight.templates import template
from jaxsat.simulation.engine.runge_kutta import explicit_step, tableau_of
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.wheels import wheel_momentum

CASES, SAMPLES, EDGES = 8, 1280, 512
"""Closed-loop runs, samples kept of each, and edge cases."""

LONGEST = 20_000
"""Largest number of samples of a run."""


class Vectors(NamedTuple):
    """Rows of numbers, one a sample: inputs, then state (`given`), and outputs, then the next state
    (`expected`)."""

    given: Float[np.ndarray, "n given"]
    expected: Float[np.ndarray, "n expected"]


class _Record(NamedTuple):
    """Memory of an estimator or a law, with its last input."""

    memory: PyTree
    last_input: PyTree


class _RecordingLaw(AbstractSampledController):
    """A law that also records the state at its last sample."""

    law: AbstractSampledController
    period: RealScalar

    def init(self, state: PlantState) -> _Record:
        return _Record(self.law.init(state), state)

    def step(self, t, state, memory):
        command, following = self.law.step(t, state, memory.memory)
        return command, _Record(following, state)


class _RecordingEstimator(AbstractEstimator):
    """An estimator that also records its last measurement, first an `example`, which has the
    attitude that the estimator begins with."""

    estimator: AbstractEstimator
    example: Measurement

    def init(self, attitude: Quaternion, sigma: Array) -> _Record:
        begin = None if self.example.attitude is None else attitude
        first = self.example._replace(attitude=begin)
        return _Record(self.estimator.init(attitude, sigma), first)

    def step(self, sample, period, measurement, memory) -> tuple[Estimate, _Record]:
        estimate, following = self.estimator.step(sample, period, measurement, memory.memory)
        return estimate, _Record(following, measurement)


def vectors(
    program: FlightProgram,
    loop: SampledLoop,
    start: PlantState,
    duration: float,
    seed: int = 0,
    reference: Reference | None = None,
) -> tuple[Vectors, Float[np.ndarray, "samples inputs"]]:
    """Return ten thousand samples of closed loops from starts of all attitudes, and edge cases; and
    the inputs of the first `SAMPLES` samples of the first loop, one after the other.

    Expected are the results of the compiled engine without fused operations.
    """
    with jax.enable_x64(True):
        now, state, recorded = _closed_loops(loop, start, duration, seed)
        rng = np.random.default_rng(seed)
        begin: Any = rng.integers(-(2**31), 2**31, len(now.sample), np.int32)
        now = now._replace(sample=begin + now.sample)  # which wraps
        state = state._replace(begin_sample=begin)
        now, state = _with_edges(rng, now), _with_edges(rng, state)
    reference = Reference(program) if reference is None else reference
    rows = Vectors(rows_of((now, state)), reference.step(now, state))
    return rows, rows_of(recorded)


def with_law(
    loop: SampledLoop,
    law: AbstractSampledController,
    estimator: Callable[[AbstractEstimator], AbstractEstimator],
) -> SampledLoop:
    """Return the loop with another law, and with another estimator in place of any."""
    loop = eqx.tree_at(lambda x: x.controller, loop, law)
    if loop.navigation is None:
        return loop
    return eqx.tree_at(lambda x: x.navigation.estimator, loop, estimator(loop.navigation.estimator))


def _recording(loop: SampledLoop) -> SampledLoop:
    law = _RecordingLaw(law=loop.controller, period=loop.controller.period)
    navigation = loop.navigation

    def recording(one: AbstractEstimator) -> _RecordingEstimator:
        assert navigation is not None
        return _RecordingEstimator(one, navigation.example())

    return with_law(loop, law, recording)


def _closed_loops(
    loop: SampledLoop, start: PlantState, duration: float, seed: int
) -> tuple[Input, State, Input]:
    """Return inputs and prior states at samples of several runs, one after the other, and the
    inputs of the first run from its first sample on."""
    recording = _recording(loop)
    period = float(np.asarray(loop.controller.period))
    total = max(SAMPLES, min(LONGEST, round(duration / period)))

    def first(case, shared):
        return recording.start(_start(loop, start, *case))

    def block(case, stride):
        """Simulate `stride` periods, of which the last is observed."""
        state, begin = case

        def one(i, before_and_now):
            return before_and_now[1], _after(recording, begin + i, period, before_and_now[1])

        before, following = jax.lax.fori_loop(0, stride, one, (state, state))
        return following, _observation(loop, begin + stride - 1, before, following)

    keys = jax.random.split(jax.random.key(seed), CASES)
    cases = keys, np.arange(CASES)
    starts = _over_cases(first, cases)(cases, None)
    run = _over_cases(block, (starts, np.zeros(CASES, np.int32)), np.int32(1))

    def flown(stride: int) -> tuple[Input, State]:
        state, samples = starts, []
        for number in range(SAMPLES):
            case = (state, np.full(CASES, number * stride, np.int32))
            state, sample = run(case, np.int32(stride))
            samples.append(sample)
        count = CASES * SAMPLES
        return jax.tree.map(
            lambda *rows: np.stack(rows, 1).reshape(count, *rows[0].shape[1:]), *samples
        )

    stride = total // SAMPLES
    each = flown(1)
    recorded = jax.tree.map(lambda rows: rows[:SAMPLES], each[0])
    return *(each if stride == 1 else flown(stride)), recorded


def _over_cases(
    function: Callable[[PyTree, PyTree], PyTree], cases: PyTree, shared: PyTree = None
) -> Callable[[PyTree, PyTree], PyTree]:
    """Compile a function of one case and of shared data over leading axes like those of `cases`."""
    one = jax.tree.map(lambda x: jax.ShapeDtypeStruct(x.shape[1:], x.dtype), cases)
    return compiled_over_cases(function, one, shared, contract=False)


def _start(loop: SampledLoop, start: PlantState, key: Array, number: IntScalar) -> PlantState:
    """Return a start of any attitude; rates are those of the scenario, rotated and scaled.

    A law with a plan has every second start near the scenario's.
    """
    one, two = jax.random.split(key)
    quaternion = Quaternion(jax.random.normal(one, (4,))).normalised()
    attitude = quaternion if isinstance(start.attitude, Quaternion) else quaternion.as_wz()
    size = jnp.sqrt(jnp.sum(start.omega**2)) + 1e-3
    omega = size * jax.random.normal(two, (3,))
    anywhere = PlantState(attitude, omega, start.effectors)
    if not loop.controller.plan_keys:
        return anywhere
    near = PlantState(start.attitude, start.omega * (1 + 0.02 * number), start.effectors)
    return choose(number % 2 == 0, near, anywhere)


def _after(loop: SampledLoop, number, period: float, state):
    """Return the state one period later."""

    def integrate(t, hold, plant, carry):
        def rate(instant, plant):
            return loop.motion(instant, plant, hold, instant - t).rate

        return explicit_step(tableau_of(NamedSolver("bosh3")), rate, t, hold.length, plant), carry

    return loop.period(number, number * period, state, integrate, None)[0]


def _observation(loop: SampledLoop, number, before: Any, following: Any) -> tuple[Input, State]:
    """Return input and state of one sample, from the loop's states before and after its period."""
    plant_state = following.memory.last_input
    state = State(before.memory.memory, None, modulator_of(loop.plant.effectors, before.effectors))
    measured: Any = Seen(plant_state.attitude, plant_state.omega, wheel_momentum(plant_state))
    if before.navigation is not None:
        measurement = following.navigation.memory.last_input
        measured = measured_by(measurement, vectors_of(loop), wheel_momentum(plant_state))
        state = state._replace(estimator=before.navigation.memory.memory)
    return Input(jnp.asarray(number, jnp.int32), measured), state


def _with_edges(rng: np.random.Generator, tree: PyTree) -> PyTree:
    """Append rows with extreme numbers in random places to copies of some rows."""
    count = len(jax.tree.leaves(tree)[0]) if jax.tree.leaves(tree) else 0
    places = rng.integers(0, max(count, 1), EDGES)

    def more(leaf: np.ndarray) -> np.ndarray:
        again = leaf[places].copy()
        struck = rng.random(again.shape) < 0.05
        if leaf.dtype.kind == "f":
            again = np.where(struck, rng.choice(EXTREMES, again.shape), again)
        elif leaf.dtype.kind == "b":
            again = again ^ struck
        return np.concatenate([leaf, again.astype(leaf.dtype)])

    return jax.tree.map(more, tree)


Recording = Float[np.ndarray, "samples numbers"]
"""Rows of inputs, then commands."""


def recorded_flight(reference: Reference, inputs: Float[np.ndarray, "samples inputs"]) -> Recording:
    """Return inputs of consecutive samples with the commands of each.

    The controller begins with the first sample, and keeps its own state from then on.
    """
    program = reference.program
    structs = program.structs
    none = np.zeros((1, structs["state"].size))
    first = trees_of(program, inputs[:1], none)[0]
    attitude = np.zeros((1, 0))
    if program.estimates:
        measured = first.measured.attitude if has_tracker(program) else program.attitude
        attitude = np.asarray(measured, float).reshape(1, 4)
    state, rows = reference.begin(attitude, first), []
    for row in inputs:
        now, before = trees_of(program, row[None], state)
        results = reference.step(now, before)[0]
        rows.append([*row, *results[: structs["output"].size]])
        state = results[None, structs["output"].size :]
    return np.array(rows)


def recording_text(program: FlightProgram, recording: Recording) -> str:
    """Return a recording as comma-separated values, with a line of names."""
    names = [text for one in ("input", "output") for text in program.structs[one].elements("")]
    return csv_text([names, *([_text(x) for x in row] for row in recording)])


def _text(x: float) -> str:
    """Return the shortest decimal that is read back to the same bits."""
    return repr(float(x)).removesuffix(".0")


def rounding(program: FlightProgram, recording: Recording) -> float:
    """Return the difference of commands that round-off of another C library may make.

    It is the cube root of the relative precision of the floats, as a part of the largest command;
    of the fields of `controller_output`, each with commands of one unit, the smallest one counts.
    """
    place, sizes = program.structs["input"].size, []
    for field in program.structs["output"].fields:
        commands = np.abs(recording[:, place : place + field.size])
        place += field.size
        if field.dtype.kind == "f":
            sizes.append(np.max(commands, initial=0.0, where=np.isfinite(commands)))
    kind = np.float32 if program.single else np.float64
    least = min((size for size in sizes if size > 0), default=0.0)
    return float(np.cbrt(np.finfo(kind).eps) * least)


def recording_program(program: FlightProgram) -> str:
    """Return run_controller.c, which flies a recording on a host."""
    if not program.estimates:
        return template("run_controller.c", ATTITUDE="")
    attitude = f"(const {real_type(program)}[4]){first_attitude(program)[0]}"
    if has_tracker(program):
        fields = program.structs["input"].fields
        attitude = f"in.{next(one.name for one in fields if one.path == 'attitude')}"
    return template("run_controller.c", ATTITUDE=f"{attitude}, ")
