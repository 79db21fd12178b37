"""What is printed of a study, from columns made by hand."""

import numpy as np

from jaxsat.cli.study_text import summary_lines
from jaxsat.montecarlo import summarise


def lines(cost, settling_time=None, **drawn):
    count = len(cost)
    times = np.linspace(10.0, 20.0, count) if settling_time is None else settling_time
    columns = {
        "code": np.zeros(count, np.int8),
        "settling_time": times,
        "effort": np.linspace(1.0, 2.0, count),
        "cost": cost,
        **{f"drawn_{name}": values for name, values in drawn.items()},
    }
    return summary_lines(summarise(columns))


def test_percentiles_that_need_more_cases_have_an_open_end():
    (found,) = (line for line in lines(np.ones(25)) if line.startswith("settling time"))
    assert "99 %: 19.9 (over 19.17) s, of those that settle" in found
    assert "50 %: 15 (12.92 to 17.08)" in found


def test_only_what_matters_is_listed_and_noise_is_said_to_be():
    rng = np.random.default_rng(0)
    x, q = rng.random((200, 3)), rng.normal(size=(200, 4))
    q /= np.linalg.norm(q, axis=1)[:, None]
    angle = 2 * np.arccos(np.abs(q[:, 0]))
    text = lines(angle + 0.1 * rng.random(200), omega=x, attitude=q)
    start = text.index(
        "what the cost depends on: first-order index and rank correlation (95 % intervals)"
    )
    assert text[start + 1].startswith("  attitude[angle] ")
    assert len(text) == start + 2  # nothing about settling, as all cases settle
    text = lines(rng.random(200), omega=x)
    assert text[-1].endswith("depends on: nothing that so many cases can tell from chance")
