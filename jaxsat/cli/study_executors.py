"""Executors of a study, from the options of the commands."""

from dataclasses import dataclass
from typing import TYPE_CHECKING

from cyclopts import Parameter

from jaxsat.cli.options import BatchSize, OptionalBatchSize, Text, Workers
from jaxsat.cli.terminal import UserMistake, print_stderr, print_warning
from jaxsat.core.errors import ArgumentError
from jaxsat.core.process import processors

if TYPE_CHECKING:
    from jaxsat.studies.executors import AbstractExecutor


@Parameter(name="*")
@dataclass(frozen=True, kw_only=True)
class Sharing:
    """Distribution of the cases.

    Parameters
    ----------
    processes
        Processes on this machine that share the chunks, at most as many as processors; a process
        that dies is replaced.
    scheduler
        Distribute the chunks to the workers of this dask scheduler: an address such as
        tcp://host:8786, or the scheduler's JSON file.
    devices
        Devices (accelerators) of this machine that share the chunks.
    batch_size
        Cases per pass of the compiled loop; the last bits of results may depend on it.
    chunk
        Cases that are computed and written together; by default a number that suits the engine.
    """

    processes: Workers = None
    scheduler: Text = None
    devices: Workers = None
    batch_size: BatchSize = 64
    chunk: OptionalBatchSize = None


def chosen_executor(
    workers: int | None,
    processes: int | None = None,
    scheduler: str | None = None,
    devices: int | None = None,
) -> "AbstractExecutor":
    """Return the executor that the options of a command request; raises `UserMistake`.

    At most as many threads as processors compute on this machine, whatever the options.
    """
    from jaxsat.studies.executors import Devices, Serial, Threads
    from jaxsat.studies.processes import Processes

    executors = {
        "--devices": devices,
        "--scheduler": scheduler,
        "--workers or --processes": workers or processes,
    }
    names = [name for name, value in executors.items() if value is not None]
    if len(names) > 1:
        raise UserMistake(f"{names[0]}: must be given without {names[1]}")
    if devices is not None:
        try:
            return Devices(devices)
        except ArgumentError as error:
            raise UserMistake(f"--devices: {error.rule}, got {error.got}") from None
    if scheduler is not None:
        return _cluster(scheduler)
    if processes is not None:
        count = min(processes, processors())
        share = processors() // count
        return Processes(count, min(workers or share, share), tell=print_warning)
    workers = min(workers or processors(), processors())
    return Threads(workers) if workers > 1 else Serial()


def _cluster(place: str) -> "AbstractExecutor":
    try:
        from jaxsat.studies.cluster import Scheduler
    except ImportError:
        raise UserMistake(
            "--scheduler: must have dask.distributed; install jaxsat[cluster]"
        ) from None
    try:
        return Scheduler(place, tell=print_stderr)
    except ValueError as error:
        raise UserMistake(f"--scheduler: {error}") from None
