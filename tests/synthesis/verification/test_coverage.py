"""The confidence that `verify` states, over 2,000 repetitions on a system with a closed form."""

from dataclasses import replace

import numpy as np
import pytest

from jaxsat.scenario.build.load import load
from jaxsat.studies.designs import Independent
from jaxsat.studies.statistics import WhenAllDecided
from jaxsat.synthesis.execution import Execution, Listener
from jaxsat.synthesis.verification.conditions import conditions_of
from jaxsat.synthesis.verification.result import Criterion
from jaxsat.synthesis.verification.run import CHUNK, _Study
from tests.helpers.decaying_rate import DECAY, decaying_rate

DEMAND, REPETITIONS = Criterion(fraction=0.9, confidence=0.95, cases=4 * CHUNK), 2000

SIGMA = 0.005
TRUE = {"UNDER": 0.8999, "OVER": 0.9001, "GOOD": 0.95}
"""Fractions that meet each requirement: two at the edge of what is demanded, and one above."""


def limit(met: float) -> float:
    """The rate (rad/s) below which this fraction of the cases is after 6 s; |η| is Rayleigh's."""
    return SIGMA * np.sqrt(-2 * np.log1p(-met)) * np.exp(-DECAY * 6)


@pytest.fixture(scope="module")
def study(tmp_path_factory):
    file = tmp_path_factory.mktemp("coverage") / "s.toml"
    formula = "eventually[6 s, 6 s] rate < {:.17g} rad/s"
    tables = [
        f'[[requirement]]\nid = "{name}"\nformula = "{formula.format(limit(met))}"\n'
        for name, met in TRUE.items()
    ]
    file.write_text(decaying_rate(0, SIGMA, "".join(tables)))
    scenario = load(str(file), ["simulation.duration_s=6"], purpose="study")
    (condition,), _ = conditions_of(scenario, failures=False)
    return _Study.of(condition, DEMAND.cases, Execution(), Listener())


def shown(study, rule, seed):
    """What a verification with this seed shows, by requirement; chunks follow as in a study."""
    repetition, until = replace(study.study, design=Independent(seed)), WhenAllDecided(rule)
    columns, count = {}, 0
    while count < DEMAND.cases:
        chunk = repetition.values(np.arange(count, count + CHUNK))
        columns = {
            name: np.concatenate([columns[name], values]) if columns else values
            for name, values in chunk.items()
        }
        count += CHUNK
        if until.met(until.successes(columns[until.column]), count):
            break
    return {one.requirement: one for one in study.shown(columns, rule, "")}


@pytest.mark.slow
def test_verdicts_are_wrong_and_intervals_miss_no_more_often_than_stated(study):
    rule = DEMAND.rule(len(TRUE))
    results = [shown(study, rule, seed) for seed in range(REPETITIONS)]
    verdicts = {name: np.array([one[name].verdict for one in results]) for name in TRUE}
    fractions = {name: np.array([one[name].fraction for one in results]) for name in TRUE}
    for name, true in TRUE.items():
        assert fractions[name][:, 0].mean() == pytest.approx(true, abs=1e-3)
    assert (fractions["UNDER"][:, 0] >= DEMAND.fraction).mean() > 0.4  # the counts alone mislead
    wrongly_met = verdicts["UNDER"] == "met"
    wrongly_violated = (verdicts["OVER"] == "violated") | (verdicts["GOOD"] == "violated")
    below = np.any([fractions[name][:, 2] < true for name, true in TRUE.items()], axis=0)
    above = np.any([fractions[name][:, 1] > true for name, true in TRUE.items()], axis=0)
    for errors in (wrongly_met, wrongly_violated, below, above):
        assert errors.mean() <= 1 - DEMAND.confidence
    assert (verdicts["GOOD"] == "met").mean() > 0.95
