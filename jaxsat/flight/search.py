"""Search for calls that run branches of controller.c which no drawn call runs.

This machine's compiler instruments the controller's blocks and comparisons, and
assets/search_calls.c changes calls until they run something new. Results are kept in the cache of
machine code, under a hash of the files, the compiler and the initial calls.
"""

import hashlib
import shutil
import subprocess
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np
from jaxtyping import Float

from jaxsat.compiler.llvm import cache
from jaxsat.core.errors import JaxsatError
from jaxsat.flight.calls import call_sizes, whole_range
from jaxsat.flight.interface import Parameter
from jaxsat.flight.measure import HOST, run_tool
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.templates import template

BLOCKS = 300_000
"""Blocks of code that a search runs for each line of controller.c: some 3 s for 1,000 lines."""

LONGEST = 600.0
"""Time limit of a search, s."""

SEEDS = 256
"""Samples from which a search begins, beside the drawn calls."""

FLOAT, WHOLE, FLAG, FIXED = range(4)
"""Ways in which a number of a call may change."""

_OPTIONS = ["-std=gnu99", "-ffp-contract=off"]


class NoSearch(JaxsatError):
    """No calls were searched for; the message gives the reason."""


def found_calls(
    files: Mapping[str, str],
    program: FlightProgram,
    of_parameters: Sequence[Parameter],
    random_calls: Float[np.ndarray, "calls numbers"],
    samples: Float[np.ndarray, "n given"],
) -> Float[np.ndarray, "found numbers"]:
    """Return calls that run a branch, or an outcome of a comparison, which no random call does.

    Parameters stay within their bounds. `files` are the sources by name. Raises `NoSearch` where no
    compiler on this machine can instrument blocks, and where compiler or search fail.
    """
    compiler = shutil.which(HOST)
    if compiler is None:
        raise NoSearch(f"no C compiler ({HOST}) is installed")
    status = Path(compiler).stat()
    numbers = _given(program, of_parameters, random_calls, samples)
    sources = {**files, "search_calls.c": template("search_calls.c")}
    origin = (BLOCKS, compiler, status.st_size, status.st_mtime_ns, *sources.items(), numbers)
    entry = f"{hashlib.sha256(repr(origin).encode()).hexdigest()}.calls"
    content = cache.content_of(entry)
    if content is None:
        try:
            content = _search(sources, numbers)
        except (OSError, subprocess.SubprocessError) as error:
            raise NoSearch(_reason(error)) from None
        cache.keep(entry, content)
    return np.frombuffer(content, "<f8").reshape(-1, random_calls.shape[1])


def _search(sources: Mapping[str, str], calls: bytes) -> bytes:
    blocks = BLOCKS * sources["controller.c"].count("\n")
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, text in sources.items():
            (folder / file).write_text(text)
        (folder / "seeds.bin").write_bytes(calls)
        telling = "-fsanitize-coverage=trace-pc,trace-cmp"
        run_tool(folder, HOST, *_OPTIONS, "-O0", telling, "-c", "controller.c")
        objects = ["controller.o", "-o", "search", "-lm"]
        run_tool(folder, HOST, *_OPTIONS, "-O1", "search_calls.c", *objects)
        run_tool(
            folder, str(folder / "search"), "seeds.bin", "found.bin", str(blocks), longest=LONGEST
        )
        return (folder / "found.bin").read_bytes()


def _reason(error: OSError | subprocess.SubprocessError) -> str:
    """Describe a failure, with the first line of an error message."""
    if isinstance(error, subprocess.TimeoutExpired):
        return f"it took longer than {error.timeout:g} s"
    if not isinstance(error, subprocess.CalledProcessError):
        return str(error)
    lines = [line for line in (error.stderr or "").splitlines() if "error" in line]
    name = Path(error.cmd[0]).name
    return f"{name} failed with code {error.returncode}" + "".join(f": {x}" for x in lines[:1])


def _given(
    program: FlightProgram,
    of_parameters: Sequence[Parameter],
    random_calls: Float[np.ndarray, "calls numbers"],
    samples: Float[np.ndarray, "n given"],
) -> bytes:
    """Return counts, then the way each number may change, its bounds, and the initial calls."""
    ways = {"f": FLOAT, "i": WHOLE, "u": FIXED, "b": FLAG}
    of_numbers: list[tuple[float, float, float]] = [(FIXED, 0.0, 0.0)]
    for one in of_parameters:
        way = ways[one.field.dtype.kind]
        bounds = whole_range(one) if way == WHOLE else (one.bounds or (-np.inf, np.inf))
        fixed = way == FLOAT and one.bounds is None
        row = (FIXED if fixed else way, float(bounds[0]), float(bounds[1]))
        of_numbers += [row] * one.field.size
    of_numbers += [(FLOAT, -np.inf, np.inf)] * call_sizes(program)["attitude"]
    for struct in ("input", "state"):
        for field in program.structs[struct].fields:
            of_numbers += [(ways[field.dtype.kind], -np.inf, np.inf)] * field.size
    places = np.random.default_rng(0).integers(0, len(samples), SEEDS)
    steps = np.repeat(random_calls[:1], SEEDS, axis=0)
    steps[:, 0], steps[:, -samples.shape[1] :] = 0.0, samples[places]
    seeds = np.concatenate([steps, random_calls])
    head = np.array(seeds.shape, "<f8").tobytes()
    table = np.array(of_numbers, "<f8").T.tobytes()
    return head + table + seeds.astype("<f8").tobytes()
