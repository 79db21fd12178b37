"""A flight controller as scalar programs: its stages, and their structures."""

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
from jaxsat.compiler.ir import Function, Source, Value, uses
from jaxsat.compiler.passes.narrowing import Ports
from jaxsat.compiler.scalar_program import ScalarProgram, scalar_program
from jaxsat.core.fingerprint import fingerprint
from jaxsat.flight.flight import FlightController, Input, SampleCommands, Seen, State, as_type
from jaxsat.flight.measurements import measured_example
from jaxsat.flight.whole_numbers import Macros, named, narrowed
from jaxsat.spacecraft.dynamics import PlantState

STRUCTURES = {
    "p": "parameters",
    "at": "clock",
    "in": "input",
    "seen": "seen",
    "now": "state",
    "next": "state",
    "out": "output",
}
"""Structures by pointer."""

LARGEST = 8192
"""Largest number of elements of a parameter."""


def is_parameter(leaf: Any) -> bool:
    """Whether an array is a parameter of flight code; larger tables of gains are constants."""
    return eqx.is_array(leaf) and np.size(leaf) <= LARGEST


@dataclass(frozen=True)
class ProgramStage:
    """One program with the C expressions of its inputs and of the targets of its results."""

    name: str
    title: str
    program: ScalarProgram
    inputs: list[str]
    outputs: list[str]

    def ports(self) -> Ports:
        """Return the function, whose parameters and results are fields such as "state.law_leg"."""

        def key(text: str) -> str | None:
            pointer, _, name = text.partition("[")[0].partition("->")
            return f"{STRUCTURES[pointer]}.{name}" if name else None

        function = self.program.function
        return Ports(function, list(map(key, self.inputs)), list(map(key, self.outputs)))


@dataclass(frozen=True)
class FlightProgram:
    """All stages in order, first those of the initialisation, and their structures.

    `whole(parameters, input, state)` is the step as one function, the reference of the proof,
    `start(parameters, attitude, input)` the initialisation, and `coast(parameters, input, memory)`
    the estimator's part of a step; `parameters` are the arrays of the structure, `now` and
    `start_state` an input and a state for their shapes. These count samples from the first on; the
    structures have them from any number on, and the state has the first. `order` is the index of
    the parameter of each array of `FlightController`, `macros` has the names of the numbers of
    enumerations, and `attitude` is the quaternion of the scenario's start.
    Once written, `calls` has the C call of each stage, `functions` the elementary functions by
    their C names, `operations` those of numbers that have branches, with the types of operands and
    result, `origins` the Python functions of C functions, and `wholes` the function that
    each part belongs to.
    """

    begin: list[ProgramStage]
    step: list[ProgramStage]
    structs: dict[str, Struct]
    parameters: list[Any]
    modes: dict[str, int]
    macros: Macros
    estimates: bool
    single: bool
    hash: str
    whole: Callable
    start: Callable
    coast: Callable
    now: Input
    start_state: State
    period: Any
    order: list[int]
    attitude: np.ndarray
    calls: dict[str, str] = field(default_factory=dict)
    functions: dict[str, Function] = field(default_factory=dict)
    operations: dict[str, tuple[str, np.dtype, np.dtype]] = field(default_factory=dict)
    origins: dict[str, list[Source]] = field(default_factory=dict)
    wholes: dict[str, str] = field(default_factory=dict)


def flight_program(loop: object, start: PlantState, *, single: bool = False) -> FlightProgram:
    """Return the program of a loop's controller; `start` is an example of the law's input state.

    With `single` all floats have 32 bits. Raises `CannotExport` for a loop that is not sampled, and
    `CannotLower` for an unsupported operation.
    """
    with jax.enable_x64(not single):
        return _flight_program(loop, start, np.float32 if single else np.float64)


def _flight_program(loop: object, start: PlantState, dtype: Any) -> FlightProgram:
    flight = as_type(FlightController.of(loop), dtype)
    arrays, rest = eqx.partition(flight, is_parameter)
    defaults, fields, order = parameter_fields(arrays)
    structure = jax.tree.structure(arrays)

    def controller(parameters: list) -> FlightController:
        leaves = [parameters[number] for number in order]
        return eqx.combine(jax.tree.unflatten(structure, leaves), rest)

    start = as_type(start, dtype)
    estimates = flight.estimator is not None
    law_input = Seen.of(start)
    flight.require_steered(law_input)
    q = start.attitude.as_quaternion().q
    measured = as_type(measured_example(loop, start), dtype)
    now = Input(jnp.zeros((), np.int32), measured)
    start_state: Any = State(
        jax.eval_shape(lambda p: controller(p).begin_law(law_input), defaults),
        jax.eval_shape(lambda p: controller(p).begin_estimator(q), defaults) if estimates else None,
        jax.eval_shape(lambda p: controller(p).begin_modulation(), defaults),
    )
    out = jax.eval_shape(
        lambda p, state: controller(p).sample(now, state)[0], defaults, start_state
    )
    structs = _structs(fields, now, start_state, out, law_input)
    stages, starts = _stages(controller, defaults, now, start_state, law_input, q, structs)
    structs["parameters"] = _without_unread(structs["parameters"], [*stages, *starts])
    ports = [stage.ports() for stage in (*starts, *stages) if stage.outputs]
    structs, macros = named(ports, narrowed(ports, structs, defaults), flight.law.modes)
    traces = {stage.name: stage.program.jaxpr for stage in (*starts, *stages)}
    return FlightProgram(
        starts,
        stages,
        structs,
        defaults,
        {member.name: int(member) for member in flight.law.modes},
        macros,
        estimates,
        dtype == np.float32,
        _hash(traces, structs),
        lambda parameters, now, state: controller(parameters).sample(now, state),
        lambda parameters, attitude, now: controller(parameters).begin(attitude, now),
        lambda parameters, now, memory: controller(parameters).estimate(now, memory)[1],
        now,
        start_state,
        flight.law.period,
        order,
        np.asarray(q),
    )


def _structs(
    parameters: tuple[Field, ...],
    now: Input,
    start_state: State,
    out: Any,
    law_input: Seen,
) -> dict[str, Struct]:
    """Return all structures, by the names in `STRUCTURES`."""

    def struct(name: str, words: str, *trees: Any) -> Struct:
        names = Names(fields=True)
        return Struct(f"controller_{name}", words, sum((fields_of(x, names) for x in trees), ()))

    clock = now._replace(measured=None)
    return {
        "parameters": Struct(
            "controller_parameters", "Gains and what the law believes.", parameters
        ),
        "input": struct("input", about(Input), clock, now.measured),
        "state": struct("state", about(State), start_state._replace(begin_sample=now.sample)),
        "output": struct("output", about(SampleCommands), out),
        "clock": struct("clock", "The number of a sample since the controller began.", clock),
        "seen": struct("seen", about(Seen), law_input),
    }


def _hash(traces, structs: dict[str, Struct]) -> str:
    """Return the hash of operations and of the structures that they use, without comments."""
    layout = [line for struct in structs.values() for line in struct.layout()]
    return hashlib.sha256("\n".join([fingerprint(traces), *layout]).encode()).hexdigest()


def _stages(
    controller, defaults, now, start_state, law_input, q, structs
) -> tuple[list[ProgramStage], list[ProgramStage]]:
    """Return the stages of a sample, and of the initialisation: methods of `FlightController`."""
    out = {one.path: one.elements("out->") for one in structs["output"].fields}
    measured, clock = structs["input"].elements("in->")[1:], structs["clock"].elements("at->")
    estimate = structs["seen"].elements("seen->")

    def stage(name: str, title: str, inputs: list[tuple], outputs: list[str]) -> ProgramStage:
        """Return the stage of a method; inputs are examples with C expressions of elements."""

        def method(p, *args):
            return getattr(controller(p), name)(*args)

        program = scalar_program(name, method, (defaults, *(example for example, _ in inputs)))
        texts = (text for _, texts in inputs for text in texts)
        parameters = structs["parameters"].elements("p->")
        return ProgramStage(name, title, program, [*parameters, *texts], outputs)

    def kept(part: str) -> tuple[Any, list[str]]:
        return getattr(start_state, part), _elements_under(structs["state"], part, "now->")

    def keeps(part: str) -> list[str]:
        return _elements_under(structs["state"], part, "next->")

    estimates = start_state.estimator is not None
    law_argument = (law_input, estimate if estimates else measured)
    control = stage(
        "control",
        "The law",
        [(now.sample, clock), law_argument, kept("law")],
        [*out["torque"], *out["mode"], *keeps("law")],
    )
    command = (control.program.outputs[0], out["torque"])
    commands = [text for name in sorted(out.keys() - {"torque", "mode"}) for text in out[name]]
    steered = [(now.sample, clock)] if controller(defaults).steering else []
    allocate = stage(
        "allocate",
        "Allocation and modulation",
        [law_argument, command, kept("modulation"), *steered],
        [*commands, *keeps("modulation")],
    )
    stages = [control, allocate]
    starts = [
        stage("begin_law", "The law's first memory", [law_argument], keeps("law")),
        stage("begin_modulation", "The modulator's first memory", [], keeps("modulation")),
    ]
    if estimates:
        sample, title = (now, [*clock, *measured]), "The estimator's first memory"
        attitude = (q, [f"attitude[{i}]" for i in range(4)])
        outputs = [*estimate, *keeps("estimator")]
        stages.insert(0, stage("estimate", "The estimator", [sample, kept("estimator")], outputs))
        starts.insert(0, stage("begin_estimator", title, [attitude], keeps("estimator")))
    return stages, starts


def _elements_under(struct: Struct, part: str, pointer: str) -> list[str]:
    """Return the elements of the fields of a part, as C expressions."""
    begins = (f"{part}.", f"{part}[")
    fields = (one for one in struct.fields if one.path == part or one.path.startswith(begins))
    return [text for one in fields for text in one.elements(pointer)]


def _without_unread(parameters: Struct, stages: Sequence[ProgramStage]) -> Struct:
    """Return the structure of parameters without those that no stage reads."""
    places_read = _places_read(stages)
    fields, place = [], 0
    for one in parameters.fields:
        if places_read & set(range(place, place + one.size)):
            fields.append(one)
        place += one.size
    return Struct(parameters.name, parameters.about, tuple(fields))


def _places_read(stages: Sequence[ProgramStage]) -> set[int]:
    """Return the indices of the scalar parameters that any stage reads."""
    places: set[int] = set()
    for stage in stages:
        function = stage.program.function
        numbers = {param.number: place for place, param in enumerate(function.params)}
        values_read = {number for step in function.block.steps for number in uses(step)}
        values_read |= {x.number for x in function.results if isinstance(x, Value)}
        places |= {numbers[number] for number in values_read if number in numbers}
    return places
