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
    the structure, `now` and `begun` an input and a state for their shapes. These count samples from
    the first on; the structures have them from any number on, and the state has the first. `order`
    tells of each array of `FlightController` which of the parameters it is. `calls` has the call of
    each stage in C, once that is written.
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
    defaults, fields, order = parameter_fields(arrays)
    structure = jax.tree.structure(arrays)

    def controller(parameters: list) -> FlightController:
        leaves = [parameters[number] for number in order]
        return eqx.combine(jax.tree.unflatten(structure, leaves), rest)

    start = as_type(start, dtype)
    estimates = flight.estimator is not None
    momentum = wheel_momentum(start)
    law_input = Seen(start.attitude, start.omega, momentum)
    q = start.attitude.as_quaternion().q
    measured = Measured(law_input.omega, q, jnp.array(True), momentum) if estimates else law_input
    now = Input(jnp.zeros((), np.int32), measured)
    begun: Any = State(
        jax.eval_shape(lambda p: controller(p).begin_law(law_input), defaults),
        jax.eval_shape(lambda p: controller(p).begin_estimator(q), defaults) if estimates else None,
        jax.eval_shape(lambda p: controller(p).begin_modulation(), defaults),
    )

    def whole(parameters, now, state):
        flight = controller(parameters)
        law_input, memory = (
            flight.estimate(now, state.estimator) if estimates else (now.measured, state.estimator)
        )
        command, mode, law = flight.control(now.sample, law_input, state.law)
        commands, modulation = flight.allocate(law_input, command, state.modulation)
        return SampleCommands(command, mode, **commands), State(law, memory, modulation)

    def begin(parameters, attitude, now):
        flight = controller(parameters)
        memory = flight.begin_estimator(attitude) if estimates else None
        law_input = flight.estimate(now, memory)[0] if estimates else now.measured
        return State(flight.begin_law(law_input), memory, flight.begin_modulation())

    out = jax.eval_shape(whole, defaults, now, begun)[0]
    names = Names(fields=True)
    own = fields_of(now._replace(measured=None), names)
    remembered = begun._replace(begin_sample=now.sample)
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
            "The number of a sample since the controller began.",
            fields_of(now._replace(measured=None), Names(fields=True)),
        ),
        "seen": Struct("controller_seen", about(Seen), fields_of(law_input, Names(fields=True))),
    }
    stages, starts = _stages(controller, defaults, now, begun, law_input, q, structs)
    structs["parameters"] = _without_unread(structs["parameters"], [*stages, *starts])
    traces = {stage.name: stage.program.jaxpr for stage in (*starts, *stages)}
    modes = {member.name: int(member) for member in flight.law.modes}
    return FlightProgram(
        starts,
        stages,
        structs,
        defaults,
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
    """The hash of operations and of the structures that they use; no comment is part of it."""
    layout = [line for struct in structs.values() for line in struct.layout()]
    return hashlib.sha256("\n".join([fingerprint(traces), *layout]).encode()).hexdigest()


def _stages(
    controller, defaults, now, begun, law_input, q, structs
) -> tuple[list[ProgramStage], list[ProgramStage]]:
    """The stages of a sample, and the stages before the first."""
    estimates = controller(defaults).estimator is not None
    p = structs["parameters"].elements("p->")
    measured, clock = structs["input"].elements("in->")[1:], structs["clock"].elements("at->")
    law_elements = structs["seen"].elements("seen->") if estimates else measured
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
            lambda p, now, memory: controller(p).estimate(now, memory),
            (defaults, now, begun.estimator),
        )
        inputs = [*p, *clock, *measured, *at("estimator", "now")]
        outputs = [*structs["seen"].elements("seen->"), *at("estimator", "next")]
        stages.append(ProgramStage("estimate", "The estimator", program, inputs, outputs))
    program = scalar_program(
        "control",
        lambda p, sample, law_input, memory: controller(p).control(sample, law_input, memory),
        (defaults, now.sample, law_input, begun.law),
    )
    outputs = [*out["torque"], *out["mode"], *at("law", "next")]
    inputs = [*p, *clock, *law_elements, *at("law", "now")]
    stages.append(ProgramStage("control", "The law", program, inputs, outputs))
    command = program.outputs[0]
    program = scalar_program(
        "allocate",
        lambda p, law_input, command, memory: controller(p).allocate(law_input, command, memory),
        (defaults, law_input, command, begun.modulation),
    )
    names = sorted(program.outputs[0])
    outputs = [text for name in names for text in out[name]]
    inputs = [*p, *law_elements, *out["torque"], *at("modulation", "now")]
    outputs += at("modulation", "next")
    stages.append(ProgramStage("allocate", "Allocation and modulation", program, inputs, outputs))
    if estimates:
        program = scalar_program(
            "begin_estimator", lambda p, q: controller(p).begin_estimator(q), (defaults, q)
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
    program = scalar_program(
        "begin_law",
        lambda p, law_input: controller(p).begin_law(law_input),
        (defaults, law_input),
    )
    starts.append(
        ProgramStage(
            "begin_law", "The law's first memory", program, [*p, *law_elements], at("law", "next")
        )
    )
    program = scalar_program(
        "begin_modulation", lambda p: controller(p).begin_modulation(), (defaults,)
    )
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


def _without_unread(parameters: Struct, stages: Sequence[ProgramStage]) -> Struct:
    """The structure of parameters without those that no stage reads."""
    places_read = _places_read(stages)
    fields, place = [], 0
    for one in parameters.fields:
        if places_read & set(range(place, place + one.size)):
            fields.append(one)
        place += one.size
    return Struct(parameters.name, parameters.about, tuple(fields))


def _places_read(stages: Sequence[ProgramStage]) -> set[int]:
    """Numbers of the scalars that are the first parameters of all stages and that one reads."""
    places: set[int] = set()
    for stage in stages:
        numbers = {param.number: place for place, param in enumerate(stage.program.function.params)}
        values_read = _values(stage.program.function.block) | {
            x.number for x in stage.program.function.results if isinstance(x, Value)
        }
        places |= {numbers[number] for number in values_read if number in numbers}
    return places


def _values(block: Block) -> set[int]:
    return {number for step in block.steps for number in uses(step)}
