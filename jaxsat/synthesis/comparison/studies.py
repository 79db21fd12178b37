"""The Monte-Carlo studies of a comparison."""

import enum

from jaxsat.scenario import Scenario
from jaxsat.scenario.build.study import EngineName, build_study
from jaxsat.studies import Study
from jaxsat.synthesis.comparison.acceptance import ComparisonSetting, comparison_scenario


class Start(enum.Enum):
    """Where the cases of a study begin: at random, or all in the paper's initial state."""

    RANDOM = "random"
    PAPER = "paper"


def comparison_study(
    setting: ComparisonSetting,
    start: Start,
    count: int,
    seed: int,
    *,
    engine: EngineName = "auto",
    batch_size: int = 50,
    chunk: int | None = None,
) -> Study:
    """`count` cases of one law on the acceptance set.

    With the same seed case i is the same spacecraft, start and noise for every law and limit. The
    other arguments are those of `build_study`.
    """
    scenario = comparison_scenario(setting)
    if start is Start.PAPER:
        scenario = _from_the_papers_start(scenario)
    return build_study(
        scenario, count, seed=seed, engine=engine, batch_size=batch_size, chunk=chunk
    )


def _from_the_papers_start(scenario: Scenario) -> Scenario:
    undrawn = {"attitude": None, "omega_rad_s": None}
    dispersion = scenario.dispersion
    assert dispersion is not None  # every acceptance scenario has one
    return scenario.model_copy(update={"dispersion": dispersion.model_copy(update=undrawn)})
