"""Estimate of the resources of a study."""

import math
from typing import NamedTuple

import numpy as np

from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.studies.designs import LatinHypercube
from jaxsat.studies.ensemble import Study
from jaxsat.studies.statistics import StopRule

SUMMARISED = 120
"""Bytes per case during a summary: columns held at once, and their order."""

COMPUTED = 4
"""Copies of a chunk's results in memory during computation and writing."""

LANE = 4000
"""Approximate bytes per case in the compiled loop."""


BLOCK = 4096
"""Allocation unit of files and folders on disk, bytes."""

RECORD = 80
"""Bytes per file in the record of a chunk."""

OWN_COLUMNS = 2
"""Number of columns of small integers that a store adds to those of the study."""


class Work(NamedTuple):
    """Trajectories, total steps, bytes of memory and of disk, and files; all approximate.

    Adaptive steps count as one per interval, a lower bound.
    """

    trajectories: int
    steps: int
    memory: int
    disk: int
    files: int = 0


def study_work(study: Study, until: StopRule | None = None, workers: int = 1) -> Work:
    """Return the largest work of the whole study, of which `workers` chunks are in memory at once.

    With a stop rule it lasts until the rule must be met.
    """
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
    sizes.append(len(sizes) * RECORD)  # record of the chunk in the ledger
    blocks = folders + sum(-(-size // BLOCK) for size in sizes)
    chunks = -(-cases // study.chunk)
    return Work(cases, steps, memory, chunks * blocks * BLOCK, chunks * (len(sizes) + folders))


def _substeps(study: Study) -> int:
    """Steps in an interval if they are fixed."""
    if isinstance(study.case_factory.loop, SampledLoop):
        return study.case_factory.loop.substeps
    stepper = getattr(study.engine, "stepper", None)
    return stepper.substeps if isinstance(stepper, FixedStepper) else 1


def most_cases(rule: StopRule, count: int) -> int:
    """Return the number of cases after which any result meets the rule, at most `count`."""
    least, most = 1, count
    while least < most:
        middle = (least + most) // 2
        if rule.met(middle // 2, middle):  # half of them settled: the widest interval
            most = middle
        else:
            least = middle + 1
    return most
