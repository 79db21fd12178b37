"""What every contender is: a name, a ladder of settings, and a run for one of them."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from jaxsat.studies.ensemble import Study

Run = Callable[[], np.ndarray | None]
"""Does the whole work again; gives what `work.final_state` gives, or None where it does another."""


TOLERANCES = tuple(10 ** (-6 - quarter / 4) for quarter in range(29))
"""The settings of all whose steps are adaptive, relative and absolute: 1e-6 to 1e-13."""

LAWS = ("sharp", "smooth")
"""The printed sat of the work's law, and a tanh in its place."""


@dataclass(frozen=True)
class Contender:
    """One way to do the work.

    `prepare` makes a run for a study's first cases with one of the `settings`, which go from loose
    to tight: the loosest that is accurate enough takes part. `most` is the largest number of cases
    that it is asked to do, `why` the reason; `note` says in what its work differs. It takes part
    under its `laws`.
    """

    name: str
    settings: tuple[float, ...]
    prepare: Callable[[Study, int, float], Run]
    most: int = 10**9
    why: str = "where a turn would take minutes"
    note: str = ""
    laws: tuple[str, ...] = LAWS
