"""jaxsat's engines, as a study uses them."""

import importlib.util
from collections.abc import Callable

import diffrax
import numpy as np

from contenders.contender import TOLERANCES, Contender, Run
from jaxsat.core.process import processors
from jaxsat.simulation.engine.adaptive import AdaptiveStepper, Tolerance
from jaxsat.simulation.engine.interface import AbstractEngine
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.simulation.engine.progress import Outputs
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.methods import adaptive
from jaxsat.studies.ensemble import Study
from jaxsat.studies.executors import Threads

LANES = 256


def with_engine(study: Study, count: int, engine: AbstractEngine) -> Run:
    """A run of the engine, its blocks shared out to threads as by the command line."""
    size = engine.batch_size
    blocks = [np.arange(at, min(at + size, count)) for at in range(0, count, size)]

    def one(block: int) -> np.ndarray:
        return final(engine.evaluate(study.program, study.cases(blocks[block])))

    def run():
        found = dict(Threads(processors()).run(one, range(len(blocks))))
        return np.concatenate([found[block] for block in range(len(blocks))])

    return run


def final(found: Outputs) -> np.ndarray:
    """What `work.final_state` gives."""
    rates = found.omega[:, :2]
    return np.concatenate([found.w, found.z[:, None], rates, found.cost[:, None]], axis=1)


def batch_size(count: int) -> int:
    """Cases in a block: the engine's usual number, or a share for every processor."""
    return min(LANES, -(-count // processors()))


def scan(solver: diffrax.AbstractSolver) -> Callable[[Study, int, float], Run]:
    """The scan engine, adaptive."""

    def prepare(study: Study, count: int, tolerance: float) -> Run:
        judged = Tolerance(tolerance, tolerance)
        return with_engine(
            study, count, ScanEngine(AdaptiveStepper(solver, judged), batch_size(count))
        )

    return prepare


def reference(study: Study, count: int, tolerance: float) -> Run:
    """diffrax through jaxsat: error coordinates, Dopri8, steps chosen by diffrax."""
    method = adaptive(tolerance, tolerance, diffrax.Dopri8())
    return with_engine(study, count, ReferenceEngine(method, batch_size(count)))


def native(solver: diffrax.AbstractSolver) -> Callable[[Study, int, float], Run]:
    """The native engine, which shares all cases out to threads of its own."""

    def prepare(study: Study, count: int, tolerance: float) -> Run:
        engine = NativeEngine(AdaptiveStepper(solver, Tolerance(tolerance, tolerance)))
        cases = study.cases(np.arange(count))
        return lambda: final(engine.evaluate(study.program, cases))

    return prepare


def contenders() -> list[Contender]:
    """All engines, the native one where there is llvmlite."""
    found = [
        Contender("jaxsat scan, Dopri8 adaptive", TOLERANCES, scan(diffrax.Dopri8())),
        Contender("jaxsat scan, Tsit5 adaptive", TOLERANCES, scan(diffrax.Tsit5())),
        Contender("jaxsat diffrax, Dopri8 adaptive", TOLERANCES, reference, most=1024),
    ]
    if importlib.util.find_spec("llvmlite") is not None:
        found[2:2] = [
            Contender("jaxsat native, Dopri8 adaptive", TOLERANCES, native(diffrax.Dopri8())),
            Contender("jaxsat native, Tsit5 adaptive", TOLERANCES, native(diffrax.Tsit5())),
        ]
    return found
