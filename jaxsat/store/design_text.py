"""The wording of a design's results, shared by its Markdown page and the HTML report."""

from collections.abc import Mapping
from typing import Any

DESIGNED = "designed.toml"
"""File of the designed scenario."""

ASSUMPTIONS = "Assumptions, where the file gives no value"
LAWS_NOT_FITTING = "Laws that do not fit"
UNSETTLED_CASES = "Cases that do not settle"
IN_COMMON = "What they have in common"
REMEDIES = "What would help"
REMEDIES_NOTE = "The failing cases simulated again, each time with one change."


def tuning_text(tuning: Mapping[str, Any]) -> str:
    """What tuning gave, or why it was skipped; from `tuning` of the record of a design."""
    if "left_out" in tuning:
        return f"Tuning was skipped: {tuning['left_out']}."
    before, after = tuning["loss_before"], tuning["loss_after"]
    better = "" if after < before else "; no better gains were found"
    return (
        f"Tuning: {tuning['steps']} steps give {tuning['candidate']}; its loss on the validation "
        f"cases of the tuner changes from {before:.4g} to {after:.4g}{better}."
    )
