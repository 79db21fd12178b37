"""How a tuning, a comparison or a design runs, and who is told of it."""

import warnings
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

from jaxsat.scenario.build.study import EngineName
from jaxsat.studies import AbstractExecutor, Work


@dataclass(frozen=True)
class Execution:
    """How studies are run: `engine` as in `build_study`, `executor` and `elsewhere` as in
    `run_study`.
    """

    engine: EngineName = "auto"
    executor: AbstractExecutor | None = None
    elsewhere: bool = False


@dataclass(frozen=True)
class Listener:
    """What is called while something long runs.

    `progress` gets what runs and how far it is: a `StudyProgress`, a `DescentProgress` or None.
    `remark` gets what there is to be told besides, such as why an engine is not taken, and `warn`
    what is likely a mistake, repairs of stores among it. `approve` gets the work of all that is to
    be done, about, before anything is computed or written; what it raises ends the call.
    """

    progress: Callable[[str, Any], None] = lambda what, at: None
    remark: Callable[[str], None] = lambda text: None
    warn: Callable[[str], None] = warnings.warn
    approve: Callable[[Sequence[Work]], None] = lambda works: None
