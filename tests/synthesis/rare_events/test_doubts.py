"""What is told of estimates that may be wrong."""

import numpy as np
import pytest
from scipy.special import ndtri

from jaxsat.studies.splitting import Level, Population, Replications, Space, Splitting
from jaxsat.synthesis.rare_events.violations import Violations, doubts_of

COUNT = 100
NOISELESS, NOISY = (Space(np.zeros(1, bool), noisy) for noisy in (False, True))
WHEEL, ALIKE = np.zeros(COUNT), np.full(10, 1e-6)
NUMBERS = np.arange(COUNT)


def doubts(estimates=ALIKE, levels=(), space=NOISELESS, **changed):
    """Those of 100 violating cases, 10 in each of 10 replications, with something changed."""
    codes, roots, wheel = (
        changed.get(name, one)
        for name, one in (("codes", np.zeros(COUNT, int)), ("roots", NUMBERS), ("wheel", WHEEL))
    )
    nobody = Population(np.zeros((0, 1)), *(np.zeros(0, t) for t in ("u4", float, int, int)))
    found = Replications(estimates[:, None], nobody, np.arange(10), list(levels), NUMBERS)
    violations = Violations(NUMBERS, np.full(COUNT, 1 / COUNT), NUMBERS // 10, roots)
    flights = {"code": codes, "drawn_failed_wheel": wheel}
    return doubts_of(found, list(levels), True, space, flights, violations)


def test_an_estimate_of_which_all_is_well_has_no_doubts():
    assert doubts(levels=[Level(1.0, 0.5, 0.4, 0.3)], space=NOISY) == []


@pytest.mark.parametrize(
    ("changed", "told"),
    [
        ({"estimates": np.array([9e-6] + [0.5e-6] * 9)}, "has 67% of the sum of all"),
        ({"estimates": np.array([5e-6] * 2 + [0.0] * 8)}, "scatters by 2.1 times the mean"),
        ({"estimates": np.zeros(10)}, "No case violates the requirement"),
        ({"roots": NUMBERS % 7}, "descend from 7 independent draws"),
        ({"levels": [Level(1.0, 0.5, 0.05, np.nan)]}, "5.0% of the moves were accepted"),
        (
            {"levels": [Level(1.0, 0.5, 0.4, 0.01)], "space": NOISY},
            "A new draw of sensor noise was accepted in 1.0%",
        ),
        (
            {"wheel": np.where(NUMBERS < 20, 2.2, 0.0)},
            "failed_wheel = 2 has 20% of the probability, but 2 of 10 replications",
        ),
        ({"codes": np.where(NUMBERS % 10, 0, 4)}, "10% of the probability is of cases that ended"),
    ],
)
def test_what_may_be_wrong_is_told(changed, told):
    assert any(told in one for one in doubts(**changed))


def test_noise_that_decides_alone_is_found_out():
    """The margin is a function of the noise, which is drawn again and again in vain."""

    def margins(points, noise):
        return 3.7 - ndtri((noise.astype(float) + 0.5) / 2**32)  # 1e-4

    splitting = Splitting(NOISY, margins, 500, 1)
    levels, _ = splitting.pilot(1e-9)
    found = splitting.replicate(levels, 10)
    flights = {"code": np.zeros(found.last.number.max() + 1, int)}
    told = doubts_of(found, levels, True, NOISY, flights, Violations.of(found))
    assert any("A new draw of sensor noise was accepted" in one for one in told)


@pytest.mark.parametrize("numbers", [NUMBERS[:0], NUMBERS[[7, 3]]])
def test_the_table_of_violating_cases_has_a_row_for_each_also_where_there_is_none(numbers):
    ones = np.ones(len(numbers), int)
    flights = {"margin": -NUMBERS / 10, "time": WHEEL, "drawn_omega": np.ones((COUNT, 3))}
    rows = Violations(numbers, ones / 2, 0 * ones, numbers).table(flights).splitlines()
    assert rows[0].endswith("margin_SI,decided_at_s,drawn_omega_1,drawn_omega_2,drawn_omega_3")
    expected = [str(n) for n in sorted(numbers, reverse=True)]
    assert [row.split(",")[0] for row in rows[1:]] == expected
