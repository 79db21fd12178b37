"""Results of long commands as values of a notebook's cell: their document in Markdown."""

from jaxsat.studies.statistics import Interval
from jaxsat.synthesis.rare_events.result import EstimateSettings, RareEvent
from jaxsat.synthesis.verification.result import Criterion, Verification


def test_an_estimate_shows_its_probability():
    result = RareEvent(
        title="A rate that dies out",
        requirement="SLOW",
        sentence="It is slow in the end.",
        settings=EstimateSettings(),
        probability=Interval(2e-6, 1e-6, 4e-6),
        estimates=[1e-6, 2e-6, 3e-6],
        flights=9000,
        violating=10,
        independent=8,
        doubts=[],
        levels=[],
        differences=[],
        worst=None,
        margin=float("nan"),
        unit="rad/s",
        again="",
    )
    text = result._repr_markdown_()
    assert text.startswith("#### Rare event: A rate that dies out, SLOW\n")
    assert "**SLOW is violated with probability 2e-06 (1e-06 to 4e-06).**" in text


def test_a_verification_shows_its_verdict():
    result = Verification("A tumbling body", Criterion(), {}, [], [], [])
    assert result._repr_markdown_().startswith("#### Verification: A tumbling body\n\n**")
