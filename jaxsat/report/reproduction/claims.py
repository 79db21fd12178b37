"""All claims of the paper's section 5, judged from trajectory datasets alone.

Nothing here knows how the numbers come out.
"""

from collections.abc import Callable, Sequence

from jaxsat.report.document import Document, Shown, Table, Verdict
from jaxsat.report.reproduction.claim import Claim, ClaimVerdict, Datasets
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


GOOD = {ClaimVerdict.HOLDS: True, ClaimVerdict.ONLY_IF: None, ClaimVerdict.FAILS: False}


def claims_document(claims: Sequence[Claim]) -> Document:
    """One row a claim: where the paper says it, what, the number found, the verdict."""
    counts = {verdict: sum(one.verdict is verdict for one in claims) for verdict in ClaimVerdict}
    told = "; ".join(f"{verdict.value}: {count}" for verdict, count in counts.items() if count)
    text = f"{len(claims)} claims of the paper's section 5. {told.capitalize()}."
    more = [
        "Wang, Jia, Jin, Xu, Acta Astronautica 83 (2013) 44-53. Every number comes from the runs "
        "in this folder."
    ]
    rows = [
        [one.source, one.statement, one.found, Shown(one.verdict_text, good=GOOD[one.verdict])]
        for one in claims
    ]
    table = Table("Claims", ["where", "claim", "found", "verdict"], rows)
    return Document("The paper's section 5", Verdict(None, text, more), [table])
