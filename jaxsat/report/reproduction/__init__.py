"""The paper's section 5 computed again, and a judgement of each of its claims.

Wang, Jia, Jin, Xu, Control analysis of an underactuated spacecraft under disturbance, Acta
Astronautica 83 (2013) 44-53.
"""

from jaxsat.report.reproduction.claim import RUNS, Claim, ClaimVerdict, PaperRun
from jaxsat.report.reproduction.claims import claims_document, judge

__all__ = ["RUNS", "Claim", "ClaimVerdict", "PaperRun", "claims_document", "judge"]
