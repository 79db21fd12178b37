"""The C programs beside this file: built where a compiler is found, called through ctypes."""

import ctypes
import hashlib
import os
import shutil
import subprocess
import tempfile
from functools import cache
from pathlib import Path

import diffrax
import numpy as np

from jaxsat.simulation.engine.adaptive import Tolerance
from jaxsat.simulation.engine.dense_output import dense_output

HERE = Path(__file__).parent
FLAGS = (
    *("-O3", "-march=native", "-mprefer-vector-width=512", "-fopenmp-simd", "-fno-math-errno"),
    *("-fno-trapping-math", "-std=gnu11", "-shared", "-fPIC"),
)
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
    """fixed.c: RK4 with equal steps; or gradient.c, the same with four sensitivities."""

    def __init__(
        self,
        limits: np.ndarray,
        length: float,
        intervals: int,
        substeps: int,
        *,
        gradient: bool = False,
    ):
        name = "gradient" if gradient else "fixed"
        self.columns = 17 if gradient else 13
        self.function = getattr(library(name), name)
        self.function.argtypes = [*[POINTER] * 4, NUMBER, *[WHOLE] * 4, POINTER]
        self.function.restype = None
        self.limits, self.numbers = limits, (length, intervals, substeps)

    def run(self, start, torque, gains, results, begin: int, end: int) -> None:
        """Fill the rows `begin` to `end` of the results."""
        arrays = [address(x) for x in (start, torque, gains, self.limits)]
        self.function(*arrays, *self.numbers, begin, end, address(results))


class Adaptive:
    """adaptive.c: Tsit5 with located switches."""

    columns = 14

    def __init__(self, limits: np.ndarray, interval: float, intervals: int, tolerance: Tolerance):
        self.function = library("adaptive", tableau_header()).adaptive
        self.function.argtypes = [*[POINTER] * 5, NUMBER, *[WHOLE] * 3, POINTER]
        self.function.restype = None
        self.limits, self.numbers = limits, (interval, intervals)
        parts = (tolerance.rtol, tolerance.atol, tolerance.first_step, tolerance.min_step)
        self.tolerance = np.array([float(x) for x in parts])

    def run(self, start, torque, gains, results, begin: int, end: int) -> None:
        """Fill the rows `begin` to `end` of the results."""
        arrays = [address(x) for x in (start, torque, gains, self.limits, self.tolerance)]
        self.function(*arrays, *self.numbers, begin, end, address(results))


def _by_powers(solver: diffrax.Tsit5) -> np.ndarray:
    """Weights of the stages in the powers 1 to 4 of the dense output, one row each."""
    output, whole = dense_output(solver), solver.tableau.b_sol
    each = list(np.eye(len(whole)))  # one stage's rate alone
    return np.array(output.coefficients(output.increments(np.ones(()), each, np.array(whole))))


def tableau_header() -> str:
    """Tsit5 as jaxsat has it, as C constants."""
    solver = diffrax.Tsit5()
    tableau = solver.tableau
    stages = len(tableau.b_sol)
    lower = np.zeros((stages, stages))
    for i, row in enumerate(tableau.a_lower, 1):
        lower[i, : len(row)] = row
    numbers = {
        "A": lower,
        "B": tableau.b_sol,
        "ERROR": tableau.b_error,
        "NODES": np.concatenate([[0.0], tableau.c]),
        "DENSE": _by_powers(solver),
    }
    lines = []
    for name, values in numbers.items():
        values = np.asarray(values)
        sizes = "".join(f"[{n}]" for n in values.shape)
        inside = ", ".join(repr(float(x)) for x in values.ravel())
        lines.append(f"static const double {name}{sizes} = {{{inside}}};")
    return "\n".join(lines)
