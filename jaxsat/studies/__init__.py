"""Monte-Carlo studies: dispersions, designs, ensembles.

Modules that compute and store studies are imported at first use: the check of a `[dispersion]`
table does not need them.
"""

import importlib
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from jaxsat.studies.executors import Threads as Threads
    from jaxsat.studies.recovery_summary import reason_words as reason_words
    from jaxsat.studies.run import run_study as run_study
    from jaxsat.studies.statistics import StopRule as StopRule
    from jaxsat.studies.statistics import wilson as wilson
    from jaxsat.studies.summary import summarise as summarise

_LATER = {
    "run_study": "run",
    "Threads": "executors",
    "reason_words": "recovery_summary",
    "StopRule": "statistics",
    "wilson": "statistics",
    "summarise": "summary",
}


def __getattr__(name: str) -> Any:
    if name not in _LATER:
        raise AttributeError(f"module 'jaxsat.studies' has no attribute {name!r}")
    return getattr(importlib.import_module(f"jaxsat.studies.{_LATER[name]}"), name)
