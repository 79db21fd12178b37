"""The verdict table as Markdown."""

from collections.abc import Sequence

from jaxsat.report.reproduction.claim import Claim


def markdown_table(claims: Sequence[Claim]) -> str:
    """One row a claim: where the paper says it, what, the number found, the verdict."""
    rows = ["| where | claim | found | verdict |", "|---|---|---|---|"]
    for claim in claims:
        cells = (claim.source, claim.statement, claim.found, claim.verdict_text)
        rows.append("| " + " | ".join(cell.replace("|", "\\|") for cell in cells) + " |")
    return "\n".join(rows) + "\n"
