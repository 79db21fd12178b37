"""What every contender is: a name, a ladder of settings, and a run for one of them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from jaxsat.montecarlo import Study

Run = Callable[[], np.ndarray | None]
"""Does the whole work again; gives what `work.final_state` gives, or None where it does another."""


TOLERANCES = (1e-6, 3e-7, 1e-7, 3e-8, 1e-8, 3e-9, 1e-9, 1e-10)
"""The settings of all whose steps are adaptive, relative and absolute."""


@dataclass(frozen=True)
class Contender:
    """One way to do the work.

    `prepare` makes a run for a study's first cases with one of the `settings`, which go from loose
    to tight: the loosest that is accurate enough takes part. `most` is the largest number of cases
    that it is asked to do, `why` the reason; `note` says in what its work differs.
    """

    name: str
    settings: tuple[float, ...]
    prepare: Callable[[Study, int, float], Run]
    most: int = 10**9
    why: str = "where a turn would take minutes"
    note: str = ""
