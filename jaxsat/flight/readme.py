"""README.md of an export."""

from collections.abc import Mapping
from typing import TYPE_CHECKING

import numpy as np

from jaxsat.flight.guard import HOLD_SAMPLES, RATE_LIMIT, groups, status_bits
from jaxsat.flight.measure import DEAREST, ProcessorUse
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.templates import DEVIATIONS
from jaxsat.flight.vectors import EDGES, Vectors

if TYPE_CHECKING:
    from jaxsat.flight.files import Request

SHOWN = 12
"""Numbers of an array that the table of parameters shows; controller.c has all."""


def readme(
    request: "Request",
    program: FlightProgram,
    vectors: Vectors,
    uses: Mapping[str, ProcessorUse],
    lines: int,
) -> str:
    """The text: what an export is, where it comes from, how it is built, tested and called."""
    versions = request.provenance["versions"]
    version_rows = "\n".join(f"| {name} | {version} |" for name, version in versions.items())
    functions = "the C library's" if request.libm else "in controller.c, those of the native engine"
    return f"""# {request.title}: flight code

The controller of `scenario.toml` as C99: {_parts(program)}. One call of `controller_step` a
period; no allocation, no recursion, no global state that changes, every loop bounded.

| | |
|---|---|
| traced program | `{program.hash}` |
| precision | {"single" if program.single else "double"} |
| elementary functions | {functions} |
| lines of controller.c | {lines} |
{version_rows}
| exported | {request.provenance["created"]} on {request.provenance["platform"]} |

## Build and test

    make test           # gcc or clang: CC=clang make test
    make sanitize       # undefined behaviour and addresses
    make cppcheck       # static analysis with the MISRA add-on
    make cortex-m       # on an emulated Cortex-M4F and M7 (arm-none-eabi-gcc, qemu-system-arm)

or `cmake -S . -B build && cmake --build build && ctest --test-dir build`.

`test_vectors.bin` holds {len(vectors.given)} samples, of closed-loop runs and {EDGES} of them again
with extreme numbers (zeros of both signs, infinities, NaN, the largest and least numbers). Each is
an input and a state, and the output and next state that the simulator's compiled engine makes of
them without fused operations. {_agreement(request)}

Compile without `-ffast-math`, and without fused operations (`-ffp-contract=off`): then every
processor with IEEE 754 arithmetic gives the same bits.

## Use

```c
controller_state state;
controller_input in = {{...}};
controller_output out;
controller_init(&controller_default_parameters, {_attitude(program)}&in, &state); /* once */
controller_step(&controller_default_parameters, &in, &state, &out);              /* each period */
```

`controller.h` has every field with its unit and meaning, in the words of the Python classes. The
period is {_period(program)} s. Time and samples count from the sample of `controller_init`.

## Invalid measurements

```c
controller_guard guard;
const controller_validity valid = {{{_flags(program)}}}; /* what the sensors say of themselves */
controller_guard_init({_attitude(program)}&guard);                              /* once */
status = controller_guard_step(&controller_default_parameters,         /* each period */
                               &controller_default_guard_parameters, &in, &valid, &guard, &out);
```

These take the place of `controller_init` and `controller_step`. A measurement is invalid if it is
flagged or not finite, if a rate exceeds `rate_limit` ({RATE_LIMIT:g} rad/s), or if a quaternion is
not a unit quaternion. Then the guard holds the commands for `hold_samples` ({HOLD_SAMPLES}) calls,
after which they are zero. Valid measurements give the bits of `controller_step`. The status is a
sum of

{_status(program)}

## Instructions and stack (-O2, floating-point unit on)

The unit of the Cortex-M4F computes in single precision only, that of the Cortex-M7 in both.

{_measurements(uses, vectors)}

## Software in the loop

    make
    jaxsat montecarlo scenario.toml --controller build/libcontroller.so

runs a study with this code in the place of the law{" and the estimator" * program.estimates}.
{_precision(program)}
## Parameters

`controller_check_parameters` (`controller_parameters.h`) returns 0 for a table of parameters within
the ranges of `icd.md`, else the number of the first that is not. `controller_parameter_checksum` is
the CRC-32 of a table, and `CONTROLLER_DEFAULT_CHECKSUM` that of these numbers:

{_parameters(program)}

## MISRA C:2012

Deviations, which `misra_deviations.txt` has for cppcheck:

{chr(10).join(f"- {rule}: {why}" for rule, why in DEVIATIONS.items())}
"""


def _precision(program: FlightProgram) -> str:
    if not program.single:
        return ""
    return (
        "\nSingle precision costs the difference between the settled fraction of that study and\n"
        "of the same one without `--controller`, or with a library exported without `--float`:\n"
        "same cases, same seed.\n"
    )


def _flags(program: FlightProgram) -> str:
    return ", ".join(f".{group.name} = true" for group in groups(program))


def _status(program: FlightProgram) -> str:
    bits = status_bits(program).items()
    return "\n".join(f"- `{name}` ({number}): {words}" for name, (number, words) in bits)


def _parts(program: FlightProgram) -> str:
    return ("estimator, " if program.estimates else "") + "law, allocation and modulation"


def _agreement(request: "Request") -> str:
    if request.libm:
        return (
            "The C library's elementary functions differ in their last bits, and differences of "
            "their results by more (hundreds of units in the last place), so `make test` reports "
            "the largest difference and allows it."
        )
    return "All bits must agree."


def _attitude(program: FlightProgram) -> str:
    return "first_attitude, " if program.estimates else ""


def _period(program: FlightProgram) -> str:
    return f"{float(np.asarray(program.period)):.9g}"


def _emulated_vectors(numbers: ProcessorUse, vectors: Vectors) -> str:
    """The words for the test vectors over which instructions were counted."""
    if numbers.samples == len(vectors.given):
        return "the test vectors"
    return (
        f"{numbers.samples} test vectors: all that run a block of code which none before ran, "
        f"and the {DEAREST} that run most blocks"
    )


def _measurements(uses: Mapping[str, ProcessorUse], vectors: Vectors) -> str:
    return "\n\n".join(f"{name}:\n\n{_measurement(use, vectors)}" for name, use in uses.items())


def _measurement(numbers: ProcessorUse, vectors: Vectors) -> str:
    samples = _emulated_vectors(numbers, vectors)
    rows = {
        f"instructions of a step, the most over {samples}": numbers.instructions,
        "bytes of stack at most": numbers.stack,
        "bytes of code and constants": numbers.code,
    }
    measurements = [f"- {name}: {number}" for name, number in rows.items() if number is not None]
    return "\n".join([*measurements, *([f"- not measured: {numbers.why}"] if numbers.why else [])])


def _parameters(program: FlightProgram) -> str:
    lines = ["| field | value |", "|---|---|"]
    for field in program.structs["parameters"].fields:
        value = np.asarray(program.parameters[field.number])
        text = str(value.tolist()) if value.size <= SHOWN else f"{value.size} numbers"
        lines.append(f"| `{field.path}` | {text} |")
    return "\n".join(lines)
