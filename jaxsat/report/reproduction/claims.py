"""All claims of the paper's section 5, judged from trajectory datasets alone.

Nothing here knows how the numbers come out.
"""

from collections.abc import Callable

from jaxsat.report.reproduction.claim import Claim, Datasets
from jaxsat.report.reproduction.note_claims import switching_settles, third_rate_converges
from jaxsat.report.reproduction.rate_claims import burr, rates_reach_zero, third_rate_decays
from jaxsat.report.reproduction.three_axis_claims import (
    attitude_changes_little,
    attitude_settles,
    disturbance_is_cancelled,
    final_rate,
    lyapunov_decreases,
)

_CLAIMS: tuple[Callable[[Datasets], Claim], ...] = (
    attitude_changes_little,
    third_rate_decays,
    rates_reach_zero,
    burr,
    attitude_settles,
    final_rate,
    lyapunov_decreases,
    disturbance_is_cancelled,
    third_rate_converges,
    switching_settles,
)


def judge(datasets: Datasets) -> list[Claim]:
    """All claims, in the order of the paper, from the runs named in `RUNS` of this package."""
    return [claim(datasets) for claim in _CLAIMS]
