"""The verdicts on the paper, from simulation, and that they would change if the runs did."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.report.reproduction import RUNS, ClaimVerdict, claims_document, judge
from jaxsat.report.reproduction.figures import paper_figures
from jaxsat.scenario import dump
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.store.dataset import time_to_settle, trajectory_dataset


@pytest.fixture(scope="module")
def datasets():
    made = {}
    for name, run in RUNS.items():
        scenario = load(run.scenario, run.overrides)
        trajectory = build(scenario).simulate()
        assert trajectory.code == 0, name
        made[name] = trajectory_dataset(trajectory, title=name, scenario=dump(scenario))
    return made


def verdicts(datasets):
    return {claim.statement: claim.verdict for claim in judge(datasets)}


@pytest.mark.slow
def test_verdicts_are_those_of_an_independent_study(datasets):
    found = {(claim.source, claim.verdict) for claim in judge(datasets)}
    assert found == {
        ("(11)", ClaimVerdict.FAILS),
        ("(38), Fig. 3", ClaimVerdict.HOLDS),
        ("(39), Fig. 3b", ClaimVerdict.ONLY_IF),
        ("(39), Fig. 4", ClaimVerdict.ONLY_IF),
        ("(42), Figs. 5-7", ClaimVerdict.ONLY_IF),
        ("(42), Fig. 5b", ClaimVerdict.ONLY_IF),
        ("(43), proof of (42)", ClaimVerdict.HOLDS),
        ("(42), section 5", ClaimVerdict.ONLY_IF),
        ("note in section 5", ClaimVerdict.ONLY_IF),
    }
    (table,) = claims_document(judge(datasets)).blocks
    assert [row[-1].text for row in table.rows] == [one.verdict_text for one in judge(datasets)]


@pytest.mark.slow
def test_every_verdict_depends_on_the_runs(datasets):
    """Runs exchanged for others must turn each verdict round: none is typed in."""
    usual = verdicts(datasets)
    held, free = datasets["three-axis"], datasets["free"]
    still = held.copy()
    still["quaternion"] = held["quaternion"] * 0 + np.array([1.0, 0, 0, 0])
    rising = held.copy()
    rising["lyapunov"] = held["lyapunov"][::-1].copy(data=held["lyapunov"].values[::-1])
    wrong_rate = datasets["rate-without-d3"].copy()
    wrong_rate["omega"] = wrong_rate["omega"] ** 3
    exchanged = {
        "three-axis": [still, rising, free],
        "rate-without-d3": [wrong_rate],
        "rate": [datasets["rate-without-d3"]],
        "rate-fine": [datasets["rate"]],
        "free": [held],
        "three-axis-no-internal-model": [free],
        "switching": [datasets["switching-rounded"]],
    }
    changed = set()
    for name, others in exchanged.items():
        for other in others:
            now = verdicts({**datasets, name: other})
            changed |= {statement for statement in usual if now[statement] is not usual[statement]}
    assert changed == set(usual)


@pytest.mark.slow
def test_figures_are_drawn_with_units(datasets):
    figures = paper_figures(datasets)
    assert {"fig3-rates", "fig4-torque", "fig5-rates", "fig6-attitude", "fig7-torque"} <= set(
        figures
    )
    for name, figure in figures.items():
        labels = [axes.get_ylabel() for axes in figure.axes]
        assert all("(" in label for label in labels), name
        assert figure.axes[-1].get_xlabel() == "time (s)"


@pytest.mark.slow
def test_reproduce_and_simulate_say_the_same(datasets):
    """From 570.24 s the held run stays settled, whatever is saved; the free run never does."""
    changes = ["simulation.duration_s=1000", "simulation.save_every_s=1.0"]
    coarse = build(load("paper-three-axis", changes)).simulate()
    settled = time_to_settle(datasets["three-axis"])
    assert settled == time_to_settle(trajectory_dataset(coarse))
    assert settled == pytest.approx(570.2424, abs=1e-3)
    assert time_to_settle(datasets["free"]) == jnp.inf


@pytest.mark.slow
def test_what_the_verdicts_say_of_the_switching_run(datasets):
    """Two transitions and one law ever after; the row names what the run was made with."""
    (row,) = (claim for claim in judge(datasets) if "Switching" in claim.statement)
    assert "2 transitions (at 1.3, 22.1 s), from 22.1 s on (42) alone" in row.finding
    for setting in ("5 N m", "0.1 s", "clipped", "without internal model", "tuned"):
        assert setting in row.finding
