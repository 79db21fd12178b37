"""Results of a design, as objects and as plain data."""

from dataclasses import dataclass
from typing import Any, Literal, NamedTuple

import numpy as np

from jaxsat.report.design_document import design_document
from jaxsat.report.document import Document
from jaxsat.report.printers import notebook_text
from jaxsat.scenario import Scenario
from jaxsat.studies.statistics import Interval, fraction_text
from jaxsat.studies.summary import Summary
from jaxsat.synthesis.comparison.verdict import ComparisonRow, ComparisonVerdict
from jaxsat.synthesis.controller_design.candidates import Candidate
from jaxsat.synthesis.controller_design.explanation import Remedy, Separation
from jaxsat.synthesis.controller_design.request import ALL, QUICK, DesignSettings
from jaxsat.synthesis.controller_design.tuning import Tuned
from jaxsat.synthesis.controller_design.vehicle import VehicleVerdict
from jaxsat.synthesis.execution import plain_data

DesignOutcome = Literal["reached", "not reached", "nothing to design"]


class Step(NamedTuple):
    """Candidates of a step on the same cases, and the choice among them."""

    rows: tuple[ComparisonRow, ...]
    verdict: ComparisonVerdict

    def as_data(self) -> dict[str, Any]:
        """Return the data of a record, see `plain_data`."""
        return {"rows": self.rows, "taken": self.verdict.law, "reason": self.verdict.reason}


@dataclass(frozen=True)
class DesignVerification:
    """The chosen controller on cases that no earlier step has seen.

    `columns` are those of its study.
    """

    summary: Summary
    columns: dict[str, np.ndarray]
    separations: tuple[Separation, ...] = ()
    remedies: tuple[Remedy, ...] = ()

    @property
    def settled(self) -> Interval:
        """Fraction that settles, with Wilson's interval."""
        return self.summary.settled

    @property
    def failing(self) -> list[int]:
        """Indices of the cases that do not settle, by which each can be flown again."""
        return np.flatnonzero(~np.isfinite(self.columns["settling_time"])).tolist()

    @property
    def limit(self) -> Remedy | None:
        """The change with which most failing cases settle: what limits the controller.

        None where no change lets half of them settle, or chance alone nearly as many. A tenth of an
        error is named where half of it does much less.
        """
        if not self.remedies:
            return None
        chance, *others = self.remedies
        best = max(others, key=lambda one: one.settled / one.cost, default=chance)
        more = best.settled - chance.settled
        return best if 2 * best.settled >= best.flown and 4 * more >= best.flown else None


@dataclass(frozen=True)
class ControllerDesign:
    """A controller for a vehicle with its verification, or the reason why there is none.

    `outcome` is "reached" where at least the required fraction of the verification settles,
    `proven` whether the whole interval is above it. `scenario` is the designed one, None where
    there is nothing to design; `left_out` has the laws that do not fit, with reasons, and
    `cautions` the `design_cautions`.
    """

    original: Scenario
    settings: DesignSettings
    verdict: VehicleVerdict
    assumed: tuple[str, ...]
    candidates: tuple[Candidate, ...]
    left_out: tuple[str, ...]
    cautions: tuple[str, ...] = ()
    chosen: Candidate | None = None
    screening: Step | None = None
    tuned: Tuned | None = None
    not_tuned: str | None = None
    validation: Step | None = None
    verification: DesignVerification | None = None

    _repr_markdown_ = notebook_text

    @property
    def record(self) -> dict[str, Any]:
        """The record of the design, from which its document is made."""
        return {"title": self.original.title, "headline": self.headline, **plain_data(self)}

    @property
    def document(self) -> Document:
        """The document that `jaxsat design` prints."""
        return design_document(self.record)

    @property
    def misses_attitude(self) -> str | None:
        """A sentence where the target attitude cannot be held, with the remedy."""
        if self.verdict.holds or self.verdict.judgement.laws == "none":
            return None
        if self.verdict.turn is None:
            return "No attitude can be held without torque about the unactuated axis; cases drift."
        if self.settings.attitude == "nearest":
            return None
        turn = float(np.linalg.norm(self.verdict.turn))
        return (
            "The target attitude cannot be held, so cases drift away from it under any law. "
            "`jaxsat design --attitude nearest` takes the nearest attitude that can be held, "
            f"{turn:.3g} rad away."
        )

    @property
    def scenario(self) -> Scenario | None:
        """The designed scenario, its gains written out."""
        return None if self.chosen is None else self.chosen.scenario

    @property
    def outcome(self) -> DesignOutcome:
        """Whether the required fraction settles."""
        if self.verification is None:
            return "nothing to design"
        enough = self.verification.settled.value >= self.settings.settled
        return "reached" if enough else "not reached"

    @property
    def proven(self) -> bool:
        """Whether the 95 % interval of the fraction is above the required one."""
        verification = self.verification
        return verification is not None and verification.settled.low >= self.settings.settled

    @property
    def headline(self) -> str:
        """The verdict in one sentence or two."""
        verification, requirement = self.verification, f"{100 * self.settings.settled:.8g}"
        if verification is None or self.chosen is None:
            why = "No law of jaxsat fits the remaining actuators."
            if self.settings.law not in (ALL, QUICK):
                why = f"The law {self.settings.law} does not fit the vehicle."
            return f"Nothing to design. {why}"
        fraction = verification.settled
        first = (
            f"{self.chosen.name} settles {fraction_text(fraction)} of "
            f"{verification.summary.cases} unseen cases; {requirement} % were required"
        )
        if self.proven:
            return f"Reached: {first}. The whole 95 % interval is above the requirement."
        if self.outcome == "reached":
            return (
                f"Reached: {first}. This number of cases does not prove it: the 95 % interval "
                "begins below the requirement."
            )
        is_excluded = fraction.high < self.settings.settled
        unsure = "" if is_excluded else ", which the 95 % interval does not exclude"
        return f"Not reached: {first}{unsure}."

    @property
    def gains(self) -> dict[str, Any]:
        """The tunable gains by key, each in its unit."""
        if self.chosen is None:
            return {}
        return {key: getattr(self.chosen.scenario.control, key) for key in self.chosen.tunable}

    def as_data(self) -> dict[str, Any]:
        """Return the data of a record, see `plain_data`, without single cases."""
        return {
            "outcome": self.outcome,
            "proven": self.proven,
            "wanted": self.settings.settled,
            "settings": self.settings.identity() | {"cases": self.settings.cases},
            "seeds": self.settings.seeds,
            "controllability": {
                "verdict": self.verdict.judgement.verdict,
                "laws": self.verdict.judgement.laws,
                "lost": self.verdict.lost,
                "holds_wanted_attitude": self.verdict.holds,
                "nearest_attitude_rad": self.verdict.turn,
                "misses_attitude": self.misses_attitude,
                "lines": self.verdict.lines(),
            },
            "assumed": self.assumed,
            "candidates": [one.name for one in self.candidates],
            "left_out": self.left_out,
            "cautions": self.cautions,
            "screening": self.screening,
            "tuning": self.tuning_data(),
            "validation": self.validation,
            "chosen": self.chosen and self.chosen.name,
            "gains": self.gains,
            "verification": self.verification and self._verification_data(self.verification),
        }

    def tuning_data(self) -> dict[str, Any] | None:
        """Convert tuning, or the reason why it was skipped, to plain data; or None."""
        if self.tuned is None:
            return {"left_out": self.not_tuned} if self.not_tuned else None
        state = self.tuned.state
        return {
            "candidate": self.tuned.candidate.name,
            "steps": state.step,
            "loss_before": self.tuned.loss_before,
            "loss_after": float(state.best_loss),
        }

    def _verification_data(self, verification: DesignVerification) -> dict[str, Any]:
        limit = verification.limit
        times = [
            {f"{percent:g}": one for percent, one in of_percents.items()}
            for of_percents in (verification.summary.settling_time, verification.summary.effort)
        ]
        return {
            "cases": verification.summary.cases,
            "settled": verification.settled,
            "settling_time_s": times[0],
            "effort_N_m_s": times[1],
            "outcomes": verification.summary.outcomes,
            "failing_cases": verification.failing,
            "separations": verification.separations,
            "remedies": verification.remedies,
            "limit": limit and {**limit._asdict(), "cause": self._cause(limit.change)},
        }

    def _cause(self, change: str) -> str | None:
        if "error of the axes" not in change or not self.original.thruster:
            return None
        return (
            "Every thruster has its own misalignment, so the torques of a thruster and of its "
            "opposite leave the plane by different amounts. This gives a torque about the "
            "unactuated axis in proportion to the magnitude of the command, which the laws for two "
            "torques do not model. Measure the thruster axes, or reduce the misalignment of the "
            "thrusters in use."
        )
