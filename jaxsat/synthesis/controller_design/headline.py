"""The verdict of a design in words, and the head of the scenario that it writes."""

import numpy as np

from jaxsat.core.numerals import number_text
from jaxsat.report.design_document import DESIGNED, LINES
from jaxsat.studies import fraction_text, percentile, wilson
from jaxsat.synthesis.controller_design.candidates import Candidate
from jaxsat.synthesis.controller_design.reading import ALL, QUICK
from jaxsat.synthesis.controller_design.result import ControllerDesign
from jaxsat.synthesis.controller_design.studies import Columns


def first_answer(candidate: Candidate, columns: Columns) -> str:
    """What the first law does in the screening, in one sentence, while the design goes on."""
    times = np.asarray(columns["settling_time"])
    fraction = wilson(int(np.isfinite(times).sum()), len(times))
    half = percentile(times, 50.0).value
    within = f", half within {number_text(half)} s" if np.isfinite(half) else ""
    return (
        f"first answer: {candidate.name} settles {fraction_text(fraction)} of {len(times)} unseen "
        f"cases{within}; the design goes on"
    )


def headline(found: ControllerDesign) -> str:
    """The verdict in one sentence or two."""
    verification, wanted = found.verification, f"{100 * found.settings.settled:.8g}"
    if verification is None or found.chosen is None:
        why = "No law of jaxsat fits what is left."
        if found.settings.law not in (ALL, QUICK):
            why = f"The law {found.settings.law} does not fit the vehicle."
        return f"Nothing to design. {why}"
    fraction = verification.settled
    first = (
        f"{found.chosen.name} settles {fraction_text(fraction)} of "
        f"{verification.summary.cases} unseen cases; wanted were {wanted} %"
    )
    if found.proven:
        return f"Reached: {first}. The whole interval is above."
    if found.outcome == "reached":
        return f"Reached: {first}. So many cases do not prove it: the interval begins below."
    unsure = (
        "" if fraction.high < found.settings.settled else ", which the interval does not exclude"
    )
    return f"Not reached: {first}{unsure}."


def design_comment(found: ControllerDesign, version: str) -> str:
    """Lines for the head of the designed scenario: where it comes from and what it is proven on."""
    verification = found.verification
    assert verification is not None
    lines = [
        f"Designed by jaxsat {version} for: {found.original.title}",
        *[f"  {line}" for line in found.verdict.lines()],
        headline(found),
        f"Verification: seed {found.settings.seeds.verification}, by "
        f"`jaxsat montecarlo {DESIGNED} --seed {found.settings.seeds.verification} "
        f"-n {found.settings.cases}`.",
    ]
    if found.assumed:
        lines += [f"{LINES['assumed']}:"]
        lines += [f"  {line}" for line in found.assumed]
    if found.misses_attitude is not None:
        lines.append(found.misses_attitude)
    elif found.settings.attitude == "nearest" and not found.verdict.holds:
        lines.append(
            "Body axes are turned so that the nearest attitude that can be held is the target."
        )
    if not found.gains:
        lines.append("The gains are functions of inertia, torque limit and control period.")
    return "".join(f"# {line}\n" for line in lines)
