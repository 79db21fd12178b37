"""Kernels of scenarios as programs for other processors: the results of this one's.

A program is the kernel's object file and `linked_kernel.c`, linked by that processor's compiler.
"""

import subprocess
from dataclasses import dataclass
from functools import cache
from pathlib import Path

import jax
import numpy as np
import pytest

from helpers.tools import needs
from jaxsat.compiler.llvm import target
from jaxsat.compiler.llvm.threads import in_own_thread
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.engine.adaptive import AdaptiveStepper
from jaxsat.simulation.engine.native import NativeEngine, kernel
from jaxsat.simulation.engine.progress import Outputs
from jaxsat.studies.ensemble import Study

pytestmark = pytest.mark.slow

CASES = 5
DRIVER = Path(__file__).with_name("linked_kernel.c")
TILTED = [
    "dispersion.tilt={distribution='uniform', low=0.5, high=1.2}",
    "dispersion.tilt_direction_rad={distribution='uniform', low=0.0, high=6.283}",
]
SCENARIOS = {
    "paper-three-axis": TILTED,
    "two-torque-free": TILTED,
    "pulsed-two-torque": TILTED,
    "two-wheel-telescope": TILTED,
    "failures-12u": ["dispersion.failure_time_s={distribution='uniform', low=2, high=15}"],
    "benchmark-three-axis": [],
}
"""Scenarios, and what disperses them or lets them fail within the time that is flown."""

FLOWN = {
    "x86-64": ("paper-three-axis", "two-wheel-telescope", "benchmark-three-axis"),
    "cortex-a53": ("two-torque-free", "pulsed-two-torque", "two-wheel-telescope", "failures-12u"),
}
"""Each scenario on a processor, one with adaptive steps on both."""

PROCESSORS = {
    "x86-64": (["gcc"], []),
    "cortex-a53": (["aarch64-linux-gnu-gcc", "-static"], ["qemu-aarch64"]),
}
"""LLVM's name of a processor; the command that links, and the one that runs."""


@dataclass(frozen=True)
class Flight:
    """A study, its engine with the fewest lanes, and the results of this processor."""

    study: Study
    engine: NativeEngine
    expected: Outputs


@cache
def flight(name: str) -> Flight:
    scenario = load(name, ["simulation.duration_s=20", *SCENARIOS[name]])
    study = build_study(scenario, CASES, seed=3, engine="scan")
    engine = NativeEngine(study.engine.stepper, simd_lanes=2, workers=1)
    expected = engine.evaluate(study.program, study.cases(np.arange(CASES)), study.gains)
    return Flight(study, engine, expected)


def written(path: Path, head: list[int], arrays: list[np.ndarray]) -> None:
    """The file that the driver reads."""
    parts = [np.array([*head, len(arrays)], np.int64).tobytes()]
    for array in arrays:
        parts += [np.int64(array.nbytes).tobytes(), array.tobytes()]
    path.write_bytes(b"".join(parts))


def computed(found: Flight, processor: str, folder: Path) -> Outputs:
    """The outputs that the program for a processor computes."""
    link, run = PROCESSORS[processor]
    cpu, study, cases = target.named(processor), found.study, found.study.cases(np.arange(CASES))
    made = found.engine.kernel(study.program, cases, study.gains)
    module = kernel.module_of(made.trajectory, 2, cpu)
    text = module.text(cpu.attributes())
    code = in_own_thread(lambda stopped: target.object_code(text, cpu))
    (folder / "kernel.o").write_bytes(code)
    subprocess.run([*link, "-o", "program", DRIVER, "kernel.o", "-lm"], cwd=folder, check=True)
    trees = found.engine.trees(cases, study.program, study.gains)
    inputs, _ = made.trajectory.arguments.taken(trees)
    room = [np.zeros((CASES, *x.shape), x.dtype) for x in jax.tree.leaves(made.trajectory.outputs)]
    head = [module.arena, made.trajectory.state_size, CASES, study.program.intervals]
    written(folder / "in", head, [*inputs, *room])
    subprocess.run([*run, "./program", "in", "out"], cwd=folder, check=True)
    content, begin = (folder / "out").read_bytes(), sum(array.nbytes for array in inputs)
    for array in room:
        array[...] = np.frombuffer(content, array.dtype, array.size, begin).reshape(array.shape)
        begin += array.nbytes
    return jax.tree.unflatten(jax.tree.structure(made.trajectory.outputs), room)


NEEDED = {
    "x86-64": [needs("gcc")],
    "cortex-a53": [needs("aarch64-linux-gnu-gcc"), needs("qemu-aarch64")],
}


@pytest.mark.parametrize(
    ("name", "processor"),
    [
        pytest.param(name, processor, marks=NEEDED[processor])
        for name in SCENARIOS
        for processor, names in FLOWN.items()
        if name in names
    ],
)
def test_another_processor_computes_the_same(name, processor, tmp_path):
    """Fixed steps differ by rounding, adaptive ones in their lengths, too.

    Estimated errors are differences of states, so their rounding is that of the states.
    """
    wanted = flight(name)
    equal = 1e-9 if isinstance(wanted.engine.stepper, AdaptiveStepper) else 1e-12
    found = jax.tree_util.tree_leaves_with_path(computed(wanted, processor, tmp_path))
    for (path, x), y in zip(found, jax.tree.leaves(wanted.expected), strict=True):
        place = jax.tree_util.keystr(path)
        least = 1.0 if ".integration_error" in place else 0.0
        size = np.abs(y[np.isfinite(y)]).max(initial=least)
        tolerance = equal * size if y.dtype.kind == "f" else 0
        np.testing.assert_allclose(x, y, 0, tolerance, err_msg=place)
