"""What a design tells before any flight."""

from jaxsat.scenario import Scenario
from jaxsat.scenario.domain import domain_cautions
from jaxsat.scenario.flexibility import flexibility_cautions
from jaxsat.synthesis.controller_design.candidates import Candidate
from jaxsat.synthesis.controller_design.lost_holds import lost_holds
from jaxsat.synthesis.controller_design.vehicle import VehicleVerdict


def design_cautions(
    vehicle: Scenario, verdict: VehicleVerdict, candidates: tuple[Candidate, ...]
) -> tuple[str, ...]:
    """Return sentences on bodies that no law holds, on numbers of the vehicle outside the verified
    domain, and on flexible parts that laws may excite."""
    holds = None
    if verdict.judgement.laws == "two torques" and not vehicle.wheel and candidates:
        holds = lost_holds(candidates[0].scenario)
    beyond = (
        f"{'.'.join(map(str, issue.location))} {issue.message}"
        for one in candidates
        for issue in (*domain_cautions(one.scenario), *flexibility_cautions(one.scenario))
    )
    return (*filter(None, (holds,)), *beyond)
