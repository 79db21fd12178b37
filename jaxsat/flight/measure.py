"""Measurements of an export by compiler and emulator: stack, code size, instructions of a step.

Emulation takes 2 ms a sample. Therefore this machine's compiler, if there is one, first runs all
samples and counts the blocks of code of each, and the emulator gets those that can matter. Results
are kept in the cache of machine code, under a hash of the files, the tools and this module.
"""

import dataclasses
import hashlib
import json
import re
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from jaxtyping import Int

from jaxsat.compiler.llvm import cache
from jaxsat.flight.templates import template

ARM, QEMU = "arm-none-eabi-gcc", "qemu-system-arm"
LONGEST = 120.0
"""Time limit of a compiler or an emulator, s."""

HOST = "cc"
"""Compiler of this machine."""

BOUND_SCRIPTS = ("longest_path.py", "loop_bounds.py", "machine_code.py")
"""Script of an export that bounds instructions by the longest path, and its modules."""

DEAREST = 512
"""Number of emulated samples that run most blocks of code."""

PROCESSORS = {
    "Cortex-M4F": (("-mcpu=cortex-m4", "-mfpu=fpv4-sp-d16"), "mps2-an386"),
    "Cortex-M7": (("-mcpu=cortex-m7", "-mfpu=fpv5-d16"), "mps2-an500"),
}
"""Options of the compiler for a processor, and its emulated board. The floating-point unit of the
first has single precision only, that of the second double precision too."""

_FLAGS = "-mthumb -mfloat-abi=hard -O2 -std=c99 -ffp-contract=off --specs=rdimon.specs".split()  # noqa: SIM905


@dataclass(frozen=True)
class ProcessorUse:
    """Use of a processor: bytes of stack, of code and constants, and most instructions of a step.

    `guarded_stack` and `guarded` are stack and instructions of a step behind the guard.
    Instructions are those of `samples` emulated samples. `bound` and `guarded_bound` are those of
    the longest path through the code, whatever the input. None marks what could not be measured,
    for the reason `why`.
    """

    stack: int | None = None
    code: int | None = None
    instructions: int | None = None
    samples: int | None = None
    why: str = ""
    guarded_stack: int | None = None
    guarded: int | None = None
    bound: int | None = None
    guarded_bound: int | None = None


def measured(files: Mapping[str, bytes]) -> dict[str, ProcessorUse]:
    """Measure these files with the installed tools, for each of `PROCESSORS`."""
    missing = [tool for tool in (ARM, QEMU) if shutil.which(tool) is None]
    if ARM in missing:
        why = f"{' and '.join(missing)} not installed where this was exported"
        return dict.fromkeys(PROCESSORS, ProcessorUse(why=why))
    sources = {file: files[file] for file in sorted(files) if file.endswith((".c", ".h", ".bin"))}
    entry = _entry(sources)
    content = cache.content_of(entry)
    if content is not None:
        return {name: ProcessorUse(**use) for name, use in json.loads(content).items()}
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for file, content in sources.items():
            (folder / file).write_bytes(content)
        try:
            uses = _measure(folder, has_emulator=QEMU not in missing)
        except (OSError, subprocess.SubprocessError) as error:
            why = f"the tools failed: {type(error).__name__}"
            return dict.fromkeys(PROCESSORS, ProcessorUse(why=why))
    content = json.dumps({name: dataclasses.asdict(use) for name, use in uses.items()})
    cache.keep(entry, content.encode())
    return uses


def _entry(files: Mapping[str, bytes]) -> str:
    """Return the name of a cache entry for these files and the installed tools."""
    tools = []
    for tool in (ARM, QEMU, HOST):
        place = shutil.which(tool)
        status = None if place is None else Path(place).stat()
        tools.append(None if status is None else (place, status.st_size, status.st_mtime_ns))
    scripts = [template(name) for name in ("blocks.c", *BOUND_SCRIPTS)]
    origin = (Path(__file__).read_bytes(), *scripts, tools, *files.items())
    return f"{hashlib.sha256(repr(origin).encode()).hexdigest()}.measured"


def _measure(folder: Path, *, has_emulator: bool) -> dict[str, ProcessorUse]:
    samples = 0
    if has_emulator:
        numbers = samples_worth_emulating(folder)
        samples = len(numbers)
        vectors = folder / "test_vectors.bin"
        vectors.write_bytes(_some_of(vectors.read_bytes(), numbers))
    return {
        name: _use(folder, (*processor, *_FLAGS), board, samples)
        for name, (processor, board) in PROCESSORS.items()
    }


def _use(folder: Path, flags: Sequence[str], board: str, samples: int) -> ProcessorUse:
    """Measure one processor, without emulation if there are no samples."""
    names = ("controller", "controller_guard")
    for name in names:
        run_tool(folder, ARM, *flags, "-g", "-c", f"{name}.c")
    sizes = run_tool(folder, "arm-none-eabi-size", "controller.o").splitlines()[1].split()
    section = "-Wl,--section-start=.vectors=0x0"
    objects = [f"{name}.o" for name in names]
    parts = ["-DSTEPS", "cortex_m.c", *objects, "-o", "steps.elf", "-lm"]
    run_tool(folder, ARM, *flags, section, *parts)
    bounds, why = _bounds(folder, [f"{name}_step" for name in names])
    (bound, stack), (guarded_bound, guarded_stack) = bounds
    static = ProcessorUse(
        stack,
        int(sizes[0]),
        guarded_stack=guarded_stack,
        bound=bound,
        guarded_bound=guarded_bound,
    )
    if not samples:
        return replace(static, why=", ".join([f"{QEMU} not installed", *why]))
    output = run_tool(
        folder, QEMU, "-M", board, "-nographic", "-icount", "shift=0",
        "-semihosting-config", "enable=on,target=native", "-kernel", "steps.elf",
    )  # fmt: skip
    match = re.search(r"(\d+) instructions a step at most, (\d+) behind the guard", output)
    counts = [int(count) for count in match.groups()] if match else [None, None]
    return replace(
        static, instructions=counts[0], guarded=counts[1], samples=samples, why=", ".join(why)
    )


def _bounds(folder: Path, functions: Sequence[str]) -> tuple[list[list[int | None]], list[str]]:
    """Return the bounds of instructions and stack (bytes) of functions, and why some have none."""
    for name in BOUND_SCRIPTS:
        (folder / name).write_text(template(name))
    try:
        output = run_tool(folder, sys.executable, BOUND_SCRIPTS[0], "steps.elf", *functions)
    except subprocess.SubprocessError as error:
        return [[None, None] for _ in functions], [f"no bounds: {type(error).__name__}"]
    matches = [
        [
            re.search(rf"^{name}: (\d+) {what} at most$", output, re.M)
            for what in ("instructions", "bytes of stack")
        ]
        for name in functions
    ]
    numbers = [[int(one[1]) if one else None for one in row] for row in matches]
    return numbers, re.findall(r"^\w+: no bound of .*$", output, re.M)


def samples_worth_emulating(folder: Path) -> Int[np.ndarray, " chosen"]:
    """Return the indices of the samples in a folder that run a block of code for the first time, or
    most blocks; all samples where no compiler on this machine counts blocks."""
    count = int(np.fromfile(folder / "test_vectors.bin", "<f8", 4)[1])
    (folder / "blocks.c").write_text(template("blocks.c"))
    options = ["-std=gnu99", "-ffp-contract=off", "-O0"]
    coverage = "-fsanitize-coverage=trace-pc"
    try:
        run_tool(folder, HOST, *options, coverage, "-c", "controller.c")
        run_tool(folder, HOST, *options, "blocks.c", "controller.o", "-o", "blocks", "-lm")
        output = run_tool(folder, str(folder / "blocks"))
    except (OSError, subprocess.SubprocessError):
        return np.arange(count)
    blocks, is_new = np.array(output.split(), int).reshape(count, 2).T
    dearest = np.argsort(-blocks, kind="stable")[:DEAREST]
    return np.union1d(np.flatnonzero(is_new), dearest)


def _some_of(vectors: bytes, places: Int[np.ndarray, " places"]) -> bytes:
    """Return a file of test vectors with some of its rows."""
    numbers = np.frombuffer(vectors, "<f8")
    head = numbers[:4].copy()
    rows = numbers[4:].reshape(int(head[1]), -1)[places]
    head[1] = len(rows)
    return head.tobytes() + rows.tobytes()


def run_tool(folder: Path, *command: str, longest: float = LONGEST) -> str:
    """Return the output of a command in a folder; raises `subprocess.SubprocessError`."""
    process = subprocess.run(
        command, cwd=folder, capture_output=True, text=True, timeout=longest, check=True,
        stdin=subprocess.DEVNULL,
    )  # fmt: skip
    return process.stdout
