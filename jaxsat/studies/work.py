"""What a study will take, known before any of it is done."""

import math
from typing import NamedTuple

import numpy as np

from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.studies.designs import LatinHypercube
from jaxsat.studies.ensemble import Study
from jaxsat.studies.statistics import StopRule

SUMMARISED = 120
"""Bytes a case takes while a summary is made: columns held at once, and their order."""

COMPUTED = 4
"""How many times a chunk's results are in memory while it is computed and written."""

LANE = 4000
"""Bytes that a case takes in the compiled loop, about."""


BLOCK = 4096
"""Bytes of disk that the smallest file or folder takes, and by which they grow."""

RECORD = 80
"""Bytes of the record of a chunk for each of its files."""

OWN_COLUMNS = 2
"""Of small whole numbers, which a store has beside those of the study."""


class Work(NamedTuple):
    """Trajectories, the steps of all of them, bytes of memory and of disk, and files; all about.

    Adaptive steps count as one an interval, so that there are at least so many.
    """

    trajectories: int
    steps: int
    memory: int
    disk: int
    files: int = 0


def study_work(study: Study, until: StopRule | None = None, workers: int = 1) -> Work:
    """What the whole study takes at most; with a stop rule, up to where it must be met."""
    cases = study.count
    if until is not None:
        chunks = math.ceil(most_cases(until, cases) / study.chunk) + workers
        cases = min(cases, chunks * study.chunk)
    shapes = [(one.shape, np.dtype(one.dtype).itemsize) for one in study.columns().values()]
    shapes += OWN_COLUMNS * [((), 8)]
    case = sum(math.prod(shape) * size for shape, size in shapes)
    together = min(study.chunk, study.count)
    memory = cases * SUMMARISED + workers * together * case * COMPUTED
    memory += workers * study.engine.batch_size * LANE
    if isinstance(study.design, LatinHypercube):
        memory += 8 * cases * sum(study.case_factory.dimensions().values())
    steps = cases * study.program.intervals * _substeps(study)
    sizes = [study.chunk * math.prod(shape) * size for shape, size in shapes]
    folders = sum(len(shape) for shape, _ in shapes)
    sizes.append(len(sizes) * RECORD)  # the chunk's record in the ledger
    blocks = folders + sum(-(-size // BLOCK) for size in sizes)
    chunks = -(-cases // study.chunk)
    return Work(cases, steps, memory, chunks * blocks * BLOCK, chunks * (len(sizes) + folders))


def _substeps(study: Study) -> int:
    """Steps in an interval where they are fixed."""
    if isinstance(study.case_factory.loop, SampledLoop):
        return study.case_factory.loop.substeps
    stepper = getattr(study.engine, "stepper", None)
    return stepper.substeps if isinstance(stepper, FixedStepper) else 1


def most_cases(rule: StopRule, count: int) -> int:
    """The cases after which the rule is met whatever they show, at most `count`."""
    least, most = 1, count
    while least < most:
        middle = (least + most) // 2
        if rule.met(middle // 2, middle):  # half of them settled is the widest interval
            most = middle
        else:
            least = middle + 1
    return most
