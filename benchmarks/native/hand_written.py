"""The C programs beside this file: built where a compiler is found, called through ctypes."""

import ctypes
import hashlib
import os
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import numpy as np

HERE = Path(__file__).parent
FLAGS = (
    "-O3 -march=native -mprefer-vector-width=512 -fopenmp-simd -fno-math-errno "
    "-fno-trapping-math -std=gnu11 -shared -fPIC"
).split()
POINTER, WHOLE, NUMBER = ctypes.c_void_p, ctypes.c_int64, ctypes.c_double


def compiler() -> str | None:
    """A C compiler, if there is one."""
    return next(filter(None, map(shutil.which, (os.environ.get("CC", ""), "gcc", "clang"))), None)


@cache
def library(name: str, header: str = "") -> ctypes.CDLL:
    """A program of this folder, compiled with `header` as its own tableau.h."""
    command = compiler()
    assert command is not None, "there is no C compiler"
    folder = Path(tempfile.mkdtemp(prefix="hand-written-"))
    (folder / "tableau.h").write_text(header)
    made = folder / f"{hashlib.sha256(header.encode()).hexdigest()[:8]}.so"
    arguments = [command, *FLAGS, f"-I{folder}", "-o", made, HERE / f"{name}.c", "-lm"]
    subprocess.run(arguments, check=True)
    return ctypes.CDLL(str(made))


def address(array: np.ndarray) -> int:
    """Where an array of doubles lies, for a C function."""
    assert array.dtype == np.float64
    assert array.flags.c_contiguous
    return array.ctypes.data


class FixedSteps:
    """fixed.c: RK4 with equal steps."""

    columns = 13

    def __init__(self, limits: np.ndarray, length: float, intervals: int, substeps: int):
        self.function = library("fixed").fixed
        self.function.argtypes = [*[POINTER] * 4, NUMBER, *[WHOLE] * 4, POINTER]
        self.function.restype = None
        self.limits, self.numbers = limits, (length, intervals, substeps)

    def run(self, start, torque, gains, results, begin: int, end: int) -> None:
        """Fill the rows `begin` to `end` of the results."""
        arrays = [address(x) for x in (start, torque, gains, self.limits)]
        self.function(*arrays, *self.numbers, begin, end, address(results))
