"""Who computes a study: threads, processes, or the workers of a scheduler."""

import os
from typing import TYPE_CHECKING

from jaxsat.cli.terminal import UserMistake

if TYPE_CHECKING:
    from jaxsat.montecarlo import AbstractExecutor


def chosen_executor(
    workers: int | None, processes: int | None, scheduler: str | None, devices: int = 1
) -> "AbstractExecutor":
    """The executor that the options of a command ask for; raises `UserMistake`."""
    from jaxsat.montecarlo import Serial, Threads

    for name, value in (("--workers", workers), ("--processes", processes)):
        if value is not None and value < 1:
            raise UserMistake(f"{name}: must be at least 1, got {value}")
    if processes is not None or scheduler is not None:
        return _cluster(workers, processes, scheduler)
    if workers is None:
        workers = 1 if devices > 1 else os.cpu_count() or 1
    return Threads(workers) if workers > 1 else Serial()


def _cluster(workers: int | None, processes: int | None, scheduler: str | None):
    try:
        from jaxsat.montecarlo.cluster import local_processes, scheduler_at
    except ImportError:
        raise UserMistake(
            "--processes and --scheduler: must have dask.distributed; install jaxsat[cluster]"
        ) from None
    if scheduler is None:
        return local_processes(processes or 1, workers or 1)
    if processes is not None or workers is not None:
        raise UserMistake("--scheduler: must be given without --processes and --workers")
    return scheduler_at(scheduler)
