"""A flight controller as programs of scalars: its stages, and the structures that they work on."""

import hashlib
from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxsat.compiler.c.layout import Field, Struct, about, fields_of, parameter_fields
from jaxsat.compiler.c.naming import Names
from jaxsat.compiler.ir import Block, Value, uses
from jaxsat.compiler.scalar_program import ScalarProgram, scalar_program
from jaxsat.core.fingerprint import fingerprint
from jaxsat.flight.flight import (
    Begin,
    FlightController,
    Input,
    Measured,
    SampleCommands,
    Seen,
    State,
    as_type,
)
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.wheels import wheel_momentum


@dataclass(frozen=True)
class ProgramStage:
    """One program with the C expressions of its inputs and the places of its results."""

    name: str
    title: str
    program: ScalarProgram
    inputs: list[str]
    outputs: list[str]


@dataclass(frozen=True)
class FlightProgram:
    """All stages in order, first those that begin, and their structures.

    `whole(parameters, input, state)` is the step as one function, the reference of the proof, and
    `start(parameters, attitude, input)` what is before the first; `parameters` are the arrays of
    the structure, `now` and `begun` an input and a state for their shapes. These take time and
    sample from the first on; the structures have them from any time on, in double precision, and
    the state has when that was. `order` tells of each
    array of `FlightController` which of the parameters it is. `calls` are those of the stages in
    C, once they are written.
    """

    begin: list[ProgramStage]
    step: list[ProgramStage]
    structs: dict[str, Struct]
    parameters: list[Any]
    modes: dict[str, int]
    estimates: bool
    single: bool
    hash: str
    whole: Callable
    start: Callable
    now: Input
    begun: State
    period: Any
    order: list[int]
    calls: dict[str, str] = field(default_factory=dict)


def flight_program(loop: object, start: PlantState, *, single: bool = False) -> FlightProgram:
    """The program of a loop's controller; `start` is a state as the law may be told.

    With `single` all floats are of 32 bits. Raises `CannotExport` for a loop that is not sampled,
    and `CannotLower` for an operation that cannot be written.
    """
    with jax.enable_x64(not single):
        return _flight_program(loop, start, np.float32 if single else np.float64)


def _flight_program(loop: object, start: PlantState, dtype: Any) -> FlightProgram:
    flight = as_type(FlightController.of(loop), dtype)
    arrays, rest = eqx.partition(flight, eqx.is_array)
    kept, fields, order = parameter_fields(arrays)
    structure = jax.tree.structure(arrays)

    def made(parameters: list) -> FlightController:
        leaves = [parameters[number] for number in order]
        return eqx.combine(jax.tree.unflatten(structure, leaves), rest)

    start = as_type(start, dtype)
    estimates = flight.estimator is not None
    momentum = wheel_momentum(start)
    seen = Seen(start.attitude, start.omega, momentum)
    q = start.attitude.as_quaternion().q
    measured = Measured(seen.omega, q, jnp.array(True), momentum) if estimates else seen
    now = Input(jnp.zeros((), dtype), jnp.zeros((), np.int32), measured)
    begun: Any = State(
        jax.eval_shape(lambda p: made(p).begin_law(seen), kept),
        jax.eval_shape(lambda p: made(p).begin_estimator(q), kept) if estimates else None,
        jax.eval_shape(lambda p: made(p).begin_modulation(), kept),
    )

    def whole(parameters, now, state):
        flight = made(parameters)
        told, memory = (
            flight.estimate(now, state.estimator) if estimates else (now.measured, state.estimator)
        )
        command, mode, law = flight.control(now.time, told, state.law)
        asked, modulation = flight.allocate(told, command, state.modulation)
        return SampleCommands(command, mode, **asked), State(law, memory, modulation)

    def begin(parameters, attitude, now):
        flight = made(parameters)
        memory = flight.begin_estimator(attitude) if estimates else None
        told = flight.estimate(now, memory)[0] if estimates else now.measured
        return State(flight.begin_law(told), memory, flight.begin_modulation())

    out = jax.eval_shape(whole, kept, now, begun)[0]
    names = Names(fields=True)
    instant: Any = jax.ShapeDtypeStruct((), np.float64), jax.ShapeDtypeStruct((), np.int32)
    own = fields_of(Input(instant[0], instant[1], None), names)
    remembered = begun._replace(begin=Begin(*instant))
    in_fields = (*own, *fields_of(measured, names))
    structs = {
        "parameters": Struct("controller_parameters", "Gains and what the law believes.", fields),
        "input": Struct("controller_input", about(Input), in_fields),
        "state": Struct(
            "controller_state", about(State), fields_of(remembered, Names(fields=True))
        ),
        "output": Struct(
            "controller_output", about(SampleCommands), fields_of(out, Names(fields=True))
        ),
        "clock": Struct(
            "controller_clock",
            "Time (s) and number of a sample since the controller began.",
            fields_of(now._replace(measured=None), Names(fields=True)),
        ),
        "seen": Struct("controller_seen", about(Seen), fields_of(seen, Names(fields=True))),
    }
    stages, starts = _stages(made, kept, now, begun, seen, q, structs)
    structs["parameters"] = _used(structs["parameters"], [*stages, *starts])
    traces = {stage.name: stage.program.jaxpr for stage in (*starts, *stages)}
    modes = {member.name: int(member) for member in flight.law.modes}
    return FlightProgram(
        starts,
        stages,
        structs,
        kept,
        modes,
        estimates,
        dtype == np.float32,
        _hash(traces, structs),
        whole,
        begin,
        now,
        begun,
        flight.law.period,
        order,
    )


def _hash(traces, structs: dict[str, Struct]) -> str:
    """Of the operations, and of the structures that they work on; no comment is part of it."""
    layout = [line for struct in structs.values() for line in struct.layout()]
    return hashlib.sha256("\n".join([fingerprint(traces), *layout]).encode()).hexdigest()


def _stages(
    made, kept, now, begun, seen, q, structs
) -> tuple[list[ProgramStage], list[ProgramStage]]:
    """Those of a sample, and those before the first."""
    estimates = made(kept).estimator is not None
    p = structs["parameters"].elements("p->")
    measured, clock = structs["input"].elements("in->")[2:], structs["clock"].elements("at->")
    told = structs["seen"].elements("seen->") if estimates else measured
    state = {
        part: [text for one in _under(structs["state"], part) for text in one.elements("{}->")]
        for part in State._fields
    }

    def at(part: str, struct: str) -> list[str]:
        return [text.format(struct) for text in state[part]]

    out = {one.path: one.elements("out->") for one in structs["output"].fields}
    stages, starts = [], []
    if estimates:
        program = scalar_program(
            "estimate",
            lambda p, now, memory: made(p).estimate(now, memory),
            (kept, now, begun.estimator),
        )
        inputs = [*p, *clock, *measured, *at("estimator", "now")]
        outputs = [*structs["seen"].elements("seen->"), *at("estimator", "next")]
        stages.append(ProgramStage("estimate", "The estimator", program, inputs, outputs))
    program = scalar_program(
        "control",
        lambda p, time, told, memory: made(p).control(time, told, memory),
        (kept, now.time, seen, begun.law),
    )
    outputs = [*out["torque"], *out["mode"], *at("law", "next")]
    inputs = [*p, clock[0], *told, *at("law", "now")]
    stages.append(ProgramStage("control", "The law", program, inputs, outputs))
    command = program.outputs[0]
    program = scalar_program(
        "allocate",
        lambda p, told, command, memory: made(p).allocate(told, command, memory),
        (kept, seen, command, begun.modulation),
    )
    names = sorted(program.outputs[0])
    outputs = [text for name in names for text in out[name]]
    inputs = [*p, *told, *out["torque"], *at("modulation", "now")]
    outputs += at("modulation", "next")
    stages.append(ProgramStage("allocate", "Allocation and modulation", program, inputs, outputs))
    if estimates:
        program = scalar_program(
            "begin_estimator", lambda p, q: made(p).begin_estimator(q), (kept, q)
        )
        attitude = [f"attitude[{i}]" for i in range(4)]
        starts.append(
            ProgramStage(
                "begin_estimator",
                "The estimator's first memory",
                program,
                [*p, *attitude],
                at("estimator", "next"),
            )
        )
    program = scalar_program("begin_law", lambda p, told: made(p).begin_law(told), (kept, seen))
    starts.append(
        ProgramStage("begin_law", "The law's first memory", program, [*p, *told], at("law", "next"))
    )
    program = scalar_program("begin_modulation", lambda p: made(p).begin_modulation(), (kept,))
    starts.append(
        ProgramStage(
            "begin_modulation",
            "The modulator's first memory",
            program,
            list(p),
            at("modulation", "next"),
        )
    )
    return stages, starts


def _under(struct: Struct, part: str) -> list[Field]:
    return [
        one
        for one in struct.fields
        if one.path == part or one.path.startswith((f"{part}.", f"{part}["))
    ]


def _used(parameters: Struct, stages: Sequence[ProgramStage]) -> Struct:
    """The structure without what no stage reads."""
    read = _read_by(stages)
    kept, place = [], 0
    for one in parameters.fields:
        if read & set(range(place, place + one.size)):
            kept.append(one)
        place += one.size
    return Struct(parameters.name, parameters.about, tuple(kept))


def _read_by(stages: Sequence[ProgramStage]) -> set[int]:
    """Numbers of the scalars that are the first parameters of all stages and that one reads."""
    found: set[int] = set()
    for stage in stages:
        numbers = {param.number: place for place, param in enumerate(stage.program.function.params)}
        read = _values(stage.program.function.block) | {
            x.number for x in stage.program.function.results if isinstance(x, Value)
        }
        found |= {numbers[number] for number in read if number in numbers}
    return found


def _values(block: Block) -> set[int]:
    return {number for step in block.steps for number in uses(step)}
