"""The verdicts on the paper's claims as a document."""

from collections.abc import Sequence

from jaxsat.report.document import Document, Shown, Table, Verdict
from jaxsat.report.reproduction.claim import Claim, ClaimVerdict

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
