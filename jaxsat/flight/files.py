"""All files of an export by name: sources, tests, build files, provenance."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from jaxsat.core.declaration.laws import value_of
from jaxsat.flight import interface
from jaxsat.flight.calls import drawn_calls, expected_of_calls, function_calls
from jaxsat.flight.cfs import cfs_app, table_cautions
from jaxsat.flight.flight import CannotExport, FlightController, flight_loop
from jaxsat.flight.fmu import UNIT, unit_file, unit_sources
from jaxsat.flight.fprime import fprime_component
from jaxsat.flight.guard import first_attitude, groups, guard_header, real_type
from jaxsat.flight.guard_source import guard_source
from jaxsat.flight.harness import (
    MAGIC_OF_CALLS,
    calls_header,
    library_source,
    records_header,
    test_program,
    vectors_file,
)
from jaxsat.flight.measure import BOUND_SCRIPTS, ProcessorUse, measured
from jaxsat.flight.parameters import (
    parameters_header,
    parameters_source,
    plan_code,
    plan_files,
    plan_table,
)
from jaxsat.flight.program import FlightProgram, flight_program
from jaxsat.flight.readme import readme, trace_table
from jaxsat.flight.reference import Reference
from jaxsat.flight.request import Request
from jaxsat.flight.search import NoSearch, found_calls
from jaxsat.flight.source import header, source
from jaxsat.flight.templates import DEVIATIONS, template
from jaxsat.flight.vectors import (
    Vectors,
    recorded_flight,
    recording_program,
    recording_text,
    rounding,
    vectors,
)
from jaxsat.simulation.sampled_loop import SampledLoop


@dataclass(frozen=True)
class Export:
    """Files and measurements of an export; `cautions` are sentences for the user."""

    program: FlightProgram
    files: Mapping[str, bytes]
    vectors: Vectors
    calls: Vectors
    measured: Mapping[str, ProcessorUse]
    lines: int
    cautions: tuple[str, ...]


def export(request: Request) -> Export:
    """Return all files of a controller.

    Raises `CannotExport` for a loop without flight code, and `CannotLower` for an unsupported
    operation, with its line in the source.
    """
    loop = flight_loop(request.loop, request.start)
    program = flight_program(loop, request.start, single=request.single)
    assert isinstance(loop, SampledLoop)  # another one has no flight program
    intro = request.intro(program)
    texts = {
        "controller.h": header(program, intro),
        "controller.c": source(program, intro, libm=request.libm),
    }
    reference = Reference(program)
    samples, inputs = vectors(program, loop, request.start, request.duration, reference=reference)
    recording = recorded_flight(reference, inputs)
    table = interface.parameters(program, loop, request.keys)
    texts |= {
        "controller_records.h": records_header(program, intro),
        "controller_calls.h": calls_header(program, intro),
    }
    random_calls = drawn_calls(program, table, samples.given)
    all_calls, unsearched = random_calls, ""
    try:
        searched_calls = found_calls(texts, program, table, random_calls, samples.given)
        all_calls = np.concatenate([random_calls, searched_calls])
    except NoSearch as error:
        unsearched = str(error)
    calls = Vectors(all_calls, expected_of_calls(reference, all_calls))
    rows = interface.rows(program, table, request.hold_samples)
    ulp = "1e18" if request.libm else "0"
    difference = f"{rounding(program, recording):.1e}" if request.libm else "0"
    texts |= {
        "controller_parameters.h": parameters_header(table, intro),
        "controller_parameters.c": parameters_source(program, table, intro),
        "icd.csv": interface.as_csv(rows),
        "icd.md": interface.as_markdown(request.title, rows),
        "controller_guard.h": guard_header(program, intro),
        "controller_guard.c": guard_source(program, intro, request.hold_samples),
        "test_controller.c": test_program(program, intro),
        "test_functions.c": function_calls(program, intro),
        "run_controller.c": recording_program(program),
        "recorded_flight.csv": recording_text(program, recording),
        "controller_library.c": library_source(program, intro),
        "cortex_m.c": template("cortex_m.c"),
        "freertos_task.c": freertos_task(program),
        "trace.csv": trace_table(program, texts["controller.c"]),
        "misra_deviations.txt": "".join(f"{rule}\n" for rule in DEVIATIONS),
        **{name: template(name) for name in ("mcdc.py", *BOUND_SCRIPTS)},
        "Makefile": template("Makefile", ULP=ulp, DIFFERENCE=difference),
        "CMakeLists.txt": template("CMakeLists.txt", ULP=ulp, DIFFERENCE=difference),
        "scenario.toml": request.scenario,
        "export.json": request.record(program, texts["controller.h"] + texts["controller.c"]),
    }
    plan = plan_table(loop.controller, single=program.single)
    texts |= plan_code(program, plan, intro) | plan_files(plan, intro)
    texts["prove_controller.c"] = prove_source(program, intro, has_plan=bool(plan))
    files = {name: text.encode() for name, text in texts.items()}
    files["test_vectors.bin"] = vectors_file(samples)
    files["test_calls.bin"] = vectors_file(calls, MAGIC_OF_CALLS)
    processor_uses = measured(files)
    lines = texts["controller.c"].count("\n")
    words = readme(request, program, samples, calls, processor_uses, lines, unsearched)
    files["README.md"] = words.encode()
    wrappers = cfs_app(program, rows, intro, request.hold_samples)
    wrappers |= fprime_component(program, rows, table, intro, request.hold_samples)
    files |= {name: text.encode() for name, text in wrappers.items()}
    cautions = table_cautions(program)
    if unsearched:
        words = f"no test calls were searched for that run other branches: {unsearched}"
        cautions = (words, *cautions)
    if request.unit:
        own = unit_sources(program, rows, table, intro, request.hold_samples, request.title)
        files[UNIT], missing = unit_file(own, files)
        if missing:
            cautions = (f"{UNIT} has sources alone: {missing}", *cautions)
    return Export(program, files, samples, calls, processor_uses, lines, cautions)


def export_plan(request: Request, begin: float) -> Mapping[str, bytes]:
    """Return the files of a plan from the start at the time `begin` (s), for an earlier export.

    Raises `CannotExport` for a law without a plan.
    """
    loop = flight_loop(request.loop, request.start, begin)
    law = FlightController.of(loop).law
    plan = plan_table(law, single=request.single)
    if not plan:
        name = value_of(type(law))
        raise CannotExport(f"control.law: must be a law that plans, for a plan, got {name}")
    return {name: text.encode() for name, text in plan_files(plan, [*request.head(), ""]).items()}


def freertos_task(program: FlightProgram) -> str:
    """Return freertos_task.c, an example of a task that runs an exported controller.

    Its period is the law's in whole milliseconds.
    """
    period, (numbers, words) = float(np.asarray(program.period)), first_attitude(program)
    begin = f"  const {real_type(program)} attitude[4] = {numbers}; /* {words} */\n"
    return template(
        "freertos_task.c",
        PERIOD=f"{period:.9g}",
        PERIOD_MS=max(1, round(1000 * period)),
        BEGIN=begin * program.estimates,
        ATTITUDE="attitude, " * program.estimates,
    )


def prove_source(program: FlightProgram, intro: Sequence[str], *, has_plan: bool) -> str:
    """Return prove_controller.c: calls with any numbers, for a proof of no run-time error.

    `make prove` has Frama-C's Eva analyse them. Eva assumes any value of its type for a global
    variable, infinities and NaN included.
    """

    def any_truths(struct: str, variable: str) -> list[str]:
        fields = (one for one in program.structs[struct].fields if one.dtype.kind == "b")
        return [text for one in fields for text in one.elements(f"{variable}.")]

    def statements(places: Sequence[str]) -> str:
        return "".join(f"  {place} = choice != 0;\n" for place in places)

    inputs = [*any_truths("input", "in"), *(f"valid.{one.name}" for one in groups(program))]
    arguments = {"parameters": "p", "state": "state", "output": "out"}
    coast = "  case 1:\n    controller_coast(&p, &in, &state);\n    break;\n"
    load = "    (void)controller_load_plan(&plan, (uint32_t)choice, &p);\n"
    variables = f"static {real_type(program)} attitude[4];\n" * program.estimates
    variables += "static controller_plan plan;\n" * has_plan
    text = template(
        "prove_controller.c",
        VARIABLE=variables,
        INPUT=statements(inputs),
        ARGUMENTS=statements([one for item in arguments.items() for one in any_truths(*item)]),
        ATTITUDE="attitude, " * program.estimates,
        COAST=coast * program.estimates,
        INCLUDE='#include "controller_plan.h"\n' * has_plan,
        PLAN=f"  case 5:\n{load}    break;\n" * has_plan,
    )
    return "\n".join([*intro, text])
