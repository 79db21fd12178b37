"""The verdicts on the paper, from simulation, and that they would change if the runs did."""

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.reproduction import RUNS, Verdict, judge, markdown_table, paper_figures
from jaxsat.results import time_to_settle, trajectory_dataset
from jaxsat.scenario import build, dump, load

pytestmark = pytest.mark.xdist_group("reproduction")  # one worker, so that all runs are made once


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
        ("(11)", Verdict.FAILS),
        ("(38), Fig. 3", Verdict.HOLDS),
        ("(39), Fig. 3b", Verdict.ONLY_IF),
        ("(39), Fig. 4", Verdict.ONLY_IF),
        ("(42), Figs. 5-7", Verdict.ONLY_IF),
        ("(42), Fig. 5b", Verdict.HOLDS),
        ("(43), proof of (42)", Verdict.HOLDS),
        ("(42), section 5", Verdict.ONLY_IF),
        ("note in section 5", Verdict.FAILS),
    }
    table = markdown_table(judge(datasets))
    assert table.count("\n") == 2 + len(judge(datasets))


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
        "switching": [held],
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
def test_settling_time_of_a_dataset(datasets):
    """The held run settles; its z, turned by 2π, is the same attitude; the free run never."""
    held = datasets["three-axis"]
    turned = held.assign(z=held["z"] + 2 * np.pi)
    assert 400 < time_to_settle(held) == time_to_settle(turned) < 600
    assert time_to_settle(datasets["free"]) == jnp.inf
