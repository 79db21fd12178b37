"""Wrapper of a controller: a functional mock-up unit for co-simulation (FMI 3.0).

A unit (FMU) is a zip archive of a model description, of sources, and of a shared library for each
platform: here that of the machine that exports, if it has a C compiler.
"""

import io
import platform
import re
import shutil
import subprocess
import tempfile
import zipfile
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from xml.sax.saxutils import quoteattr

import numpy as np

from jaxsat.compiler.c.naming import ascii_text
from jaxsat.core.errors import JaxsatError
from jaxsat.flight.guard import first_attitude, is_quaternion, is_vector, real_type
from jaxsat.flight.interface import Parameter, Row
from jaxsat.flight.measure import HOST, run_tool
from jaxsat.flight.messages import Item, commanded, measured, tuned, words_of_modes
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.templates import template

UNIT = "controller.fmu"
"""Name of the unit in an export."""

SOURCES = ("controller.c", "controller_guard.c", "controller_parameters.c", "controller_fmi.c")
HEADERS = ("controller.h", "controller_guard.h", "controller_parameters.h")

TYPES = {
    "bool": "Boolean", "int8_t": "Int8", "int16_t": "Int16", "int32_t": "Int32",
    "int64_t": "Int64", "uint8_t": "UInt8", "uint16_t": "UInt16", "uint32_t": "UInt32",
    "uint64_t": "UInt64", "float": "Float32", "double": "Float64",
}  # fmt: skip
"""Types of FMI by those of C."""

PLACES = {
    "input": "input.", "valid": "valid.", "output": "output.", "read": "parameters.",
    "limits": "limits.", "": "",
}  # fmt: skip

DIMENSIONS = {
    "kg": {"kg": 1}, "m": {"m": 1}, "s": {"s": 1}, "A": {"A": 1}, "rad": {"rad": 1},
    "N": {"kg": 1, "m": 1, "s": -2}, "J": {"kg": 1, "m": 2, "s": -2},
    "T": {"kg": 1, "s": -2, "A": -1}, "Hz": {"s": -1}, "W": {"kg": 1, "m": 2, "s": -3},
}  # fmt: skip
"""Exponents of base units by unit."""

MACHINES = {"AMD64": "x86_64", "arm64": "aarch64"}
SYSTEMS = {
    "Linux": ("linux", ".so"),
    "Darwin": ("darwin", ".dylib"),
    "Windows": ("windows", ".dll"),
}


class NoLibrary(JaxsatError):
    """The shared library of a unit was not made; the message gives the reason."""


def unit_sources(
    program: FlightProgram,
    rows: Sequence[Row],
    of_parameters: Sequence[Parameter],
    intro: Sequence[str],
    hold_samples: int,
    title: str,
) -> dict[str, str]:
    """Return the files of a unit that its controller does not have, by their names in it.

    `rows` are those of the interface control document, `hold_samples` the guard's default.
    """
    parts = {
        "INPUT": [(item, _start(program, item)) for item in measured(rows)],
        "PARAMETER": tuned(rows, of_parameters, hold_samples),
        "READ": [(item, np.zeros(item.shape)) for item in commanded(rows)],
    }
    numbers = [
        (use, *number) for use, items in parts.items() for one in items for number in _numbers(*one)
    ]
    numbers_of_attitude, words = first_attitude(program)
    begin = f"  static const {real_type(program)} attitude[4] = {numbers_of_attitude}; "
    begin += f"/* {words} */\n\n"
    code = template(
        "fmi/controller_fmi.c",
        PERIOD=repr(unit_period(program)),
        TOKEN=program.hash,
        VARIABLES="\n".join(
            [
                "  {offsetof(instance, time), FLOAT64, READ},",
                *(_row(item, use) for use, item, _ in numbers),
            ]
        ),
        START="\n".join(
            f"  one->{item.place_in(PLACES)} = {'true' if item.type == 'bool' else '1'};"
            for use, item, value in numbers
            if use == "INPUT" and value
        ),
        BEGIN=begin * program.estimates,
        ATTITUDE="attitude, " * program.estimates,
    )
    variables = ['<Float64 name="time" valueReference="0" causality="independent" unit="s"/>']
    for number, (use, item, value) in enumerate(numbers, 1):
        about = words_of_modes(program) if (use, item.name) == ("READ", "mode") else item.about
        variables.append(_variable(replace(item, about=about), use, value, number))
    units = sorted({"s", *(item.unit for _, item, _ in numbers if item.unit)})
    ends = [number for number, (use, *_) in enumerate(numbers, 1) if use == "READ"]
    description = template(
        "fmi/modelDescription.xml",
        TITLE=quoteattr(ascii_text(title)),
        TOKEN=program.hash,
        PERIOD=repr(unit_period(program)),
        UNITS="\n".join(map(_unit, units)),
        VARIABLES="\n".join(f"    {one}" for one in variables),
        OUTPUTS="\n".join(f'    <Output valueReference="{number}"/>' for number in ends),
    )
    build = template(
        "fmi/buildDescription.xml",
        FILES="\n".join(f'      <SourceFile name="{name}"/>' for name in SOURCES),
    )
    return {
        "modelDescription.xml": description,
        "sources/buildDescription.xml": build,
        "sources/controller_fmi.c": "\n".join([*intro, code]),
    }


def unit_file(sources: Mapping[str, str], files: Mapping[str, bytes]) -> tuple[bytes, str]:
    """Return the unit and, if it has no library, the reason; `files` are those of the export."""
    content = {name: text.encode() for name, text in sources.items()}
    for name in (*SOURCES, *HEADERS):
        if name in files:
            content[f"sources/{name}"] = files[name]
    missing = ""
    try:
        name, library = _library(content)
        content[name] = library
    except NoLibrary as error:
        missing = str(error)
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, data in content.items():  # equal exports give equal archives, without a date
            archive.writestr(zipfile.ZipInfo(name), data, zipfile.ZIP_DEFLATED)
    return buffer.getvalue(), missing


def _library(content: Mapping[str, bytes]) -> tuple[str, bytes]:
    """Return the name in the unit and the content of the shared library for this machine."""
    system, ending = SYSTEMS.get(platform.system(), ("", ""))
    if shutil.which(HOST) is None or not system:
        raise NoLibrary(f"no C compiler ({HOST}) is installed")
    machine = MACHINES.get(platform.machine(), platform.machine())
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, data in content.items():
            if file.startswith("sources/"):
                (folder / Path(file).name).write_bytes(data)
        options = ["-std=c99", "-O2", "-ffp-contract=off", "-fPIC", "-fvisibility=hidden"]
        target = f"controller{ending}"
        try:
            run_tool(folder, HOST, *options, "-shared", *SOURCES, "-o", target, "-lm")
        except (OSError, subprocess.SubprocessError) as error:
            raise NoLibrary(f"{HOST} failed: {error}") from None
        return f"binaries/{machine}-{system}/{target}", (folder / target).read_bytes()


def unit_period(program: FlightProgram) -> float:
    """Return the control period (s) as the scenario writes it, also where the controller is single.

    A single-precision 0.02 is 4e-10 s short: after 45 steps of 0.02 s a sample would come early.
    """
    return float(str(np.asarray(program.period)))


def _start(program: FlightProgram, item: Item) -> np.ndarray:
    """Return the start of an input: no turn, at rest, and all measurements are there and valid."""
    value = np.full(item.shape, float(item.type == "bool"))
    for field in program.structs["input"].fields:
        is_direction = is_quaternion(field) or (is_vector(field) and field.shape == (3,))
        if item.place == ("input", field.name) and is_direction:
            value[0] = 1.0
    return value


def _numbers(item: Item, values: np.ndarray) -> Iterator[tuple[Item, float]]:
    """Yield an item and its value for each element, numbered from 1 by names such as `omega[1]`.

    Importers have trouble with arrays of different sizes.
    """
    structure, field = item.place
    for index, value in np.ndenumerate(values):
        name = f"{item.name}[{','.join(str(i + 1) for i in index)}]" if index else item.name
        place = (structure, field + "".join(f"[{i}]" for i in index))
        yield replace(item, name=name, shape=(), place=place), float(value)


def _row(item: Item, use: str) -> str:
    return f"  {{offsetof(instance, {item.place_in(PLACES)}), {TYPES[item.type].upper()}, {use}}},"


def _variable(item: Item, use: str, value: float, number: int) -> str:
    """Return the element of `ModelVariables` for a number."""
    kind = TYPES[item.type]
    is_float = kind.startswith("Float")
    if is_float:
        start = str(np.float32(value) if kind == "Float32" else value)
    else:
        start = str(bool(value)).lower() if kind == "Boolean" else str(int(value))
    roles = {"INPUT": ("input", "" if is_float else "discrete"), "READ": ("output", "discrete")}
    causality, variability = roles.get(use, ("parameter", "tunable"))
    attributes = {
        "name": item.name,
        "valueReference": str(number),
        "description": ascii_text(item.about),
        "causality": causality,
        "variability": variability,
        "initial": "" if use == "INPUT" else "exact",
        "unit": item.unit if is_float else "",
        "start": start,
    }
    words = " ".join(f"{name}={quoteattr(text)}" for name, text in attributes.items() if text)
    return f"<{kind} {words}/>"


def _unit(unit: str) -> str:
    """Return the element of `UnitDefinitions` for a unit such as `N m s` or `rad/s2`."""
    exponents: dict[str, int] = {}
    above, _, below = unit.translate(str.maketrans("²³", "23")).partition("/")
    for sign, words in ((1, above), (-1, below)):
        for word in words.split():
            if word == "1":
                continue
            match = re.fullmatch(r"([A-Za-z]+)(\d*)", word)
            if match is None or match[1] not in DIMENSIONS:
                return f"    <Unit name={quoteattr(unit)}/>"
            for base, power in DIMENSIONS[match[1]].items():
                exponents[base] = exponents.get(base, 0) + sign * power * int(match[2] or 1)
    powers = " ".join(f'{base}="{power}"' for base, power in exponents.items() if power)
    return f"    <Unit name={quoteattr(unit)}><BaseUnit {powers}/></Unit>"
