"""The page of a run: what it says, what it holds, and that nothing of it is taken for code."""

import re

import numpy as np
import pytest

from helpers.pages import SCENARIO, array, json_of, run_dataset
from jaxsat.report.facts import scenario_facts, settled_meaning
from jaxsat.report.page import html, report_page
from jaxsat.report.page.replay import body_box, craft
from jaxsat.report.plot import kept_samples
from jaxsat.report.run_document import run_document, run_verdict
from jaxsat.store.files import OutputError

NASTY = '</script><script>alert("1")</script><b>&amp; $$x$$ \\[y\\]'


def craft_of(page):
    (craft,) = json_of(page, "r0-2")
    return craft


def test_the_verdict_says_when_it_settled_within_what_and_by_which_law(run_file, page):
    first = re.search(r'<p class="first">(.*?)</p>', page).group(1)
    assert first == "Settled at 6.25 s, and stays settled to 10 s."
    told = "|w| &lt; 0.05, |z| &lt; 0.05 rad, relative rate |ω_r| &lt; 0.001 rad/s to the end"
    assert f"Settled means {told}; control law: three-axis." in page
    assert "Thruster up dead at 3.5 s." in page
    never = report_page([run_file(run_dataset(settled=np.inf))])
    assert 'class="verdict bad"' in never
    assert "Not settled within 10 s." in never


def test_parts_keep_the_names_that_they_were_given():
    failure = {"of": "wheel RW-A", "at_s": 3.0, "kind": "dead"}
    more = run_verdict(run_dataset(), {"failure": [failure]}).more
    assert more[0] == "Wheel RW-A dead at 3 s."


def test_a_torque_that_is_not_made_is_counted():
    run = run_dataset()
    unmade = np.zeros((len(run["time"]), 3))
    run["torque_unmade"] = (("time", "body_axis"), unmade)
    assert "unmet torque" not in str(run_document(run))
    count = len(unmade) // 4
    unmade[:count] = [0.0, 0.3, 0.4]
    run["torque_unmade"] = (("time", "body_axis"), unmade)
    told = f"at most 0.5 N m beyond what the actuators make, at {100 * count / len(unmade):.3g} %"
    assert told in str(run_document(run))
    assert "along the field" not in str(run_document(run))
    rods = "\n[[magnetorquer]]\naxis = [1, 0, 0]\ndipole_limit_A_m2 = 1.0\n"
    run.attrs["scenario"] += rods
    assert "along the field, which none makes, does not count" in str(run_document(run))


def test_rates_that_are_the_round_off_of_the_run_are_zero():
    """That of a sum of many terms grows with the root of their number."""
    run = run_dataset()
    run.attrs["steps"], largest = 10_000, np.abs(run["omega"].values[:-1]).max()
    for part, shown in ((9e-13, "(0, 0, 0)"), (2e-12, f"({2e-12 * largest:.4g}, 0, 0)")):
        omega = run["omega"].copy()
        omega[-1] = [part * largest, 0, -1e-13 * largest]
        run["omega"] = omega
        assert run_document(run).blocks[0].rows["rates at the end"] == f"ω = {shown} rad/s"
    assert "|ω| = 0 rad/s" not in str(run_document(run))


def test_the_momentum_that_wheels_moved_is_the_sum_of_its_changes():
    run = run_dataset()
    values = run["wheel_momentum"].values
    values[:] = 1.0
    values[5:9], values[9:] = 3.0, -1.0
    run["wheel_momentum"] = (run["wheel_momentum"].dims, values, {"units": "N m s"})
    row = run_document(run).blocks[0].rows["momentum moved"]
    assert row == "(6) N m s by each wheel, taken up and given back"


def test_how_full_wheels_were_and_how_long_thrusters_fired():
    run = run_dataset()
    spans, level = np.diff(run["time"].values), run["thrust_level"].values
    facts = run_document(run).blocks[0].rows
    assert facts["wheels"] == "at most (2) N m s, 50 % of a limit"
    fired = (spans[:, None] * level[:-1]).sum(axis=0)
    assert facts["thrusters"] == f"at full thrust for ({fired[0]:.4g}, {fired[1]:.4g}) s"
    run["wheel_momentum"] = (run["wheel_momentum"] * 4).clip(-4, 4).assign_attrs(units="N m s")
    at_limit = np.mean(np.abs(run["wheel_momentum"].values) >= 4)
    told = f"100 % of a limit, at one for {100 * at_limit:.3g} % of the saved times"
    assert told in run_document(run).blocks[0].rows["wheels"]


@pytest.mark.slow
def test_a_run_that_failed_says_how_far_it_came_and_shows_that_part(run_file):
    run = run_dataset()
    run.attrs |= {"outcome_code": 1, "outcome_explanation": "a state passed its limit"}
    run["quaternion"][61:] = np.nan
    page = report_page([run_file(run)])
    assert "The run ended early, at 6 s: a state passed its limit." in page
    assert len(array(craft_of(page)["time"])) == 61


def test_the_replay_has_every_saved_attitude_to_the_last_bit(page):
    run, craft = run_dataset(), craft_of(page)
    np.testing.assert_array_equal(array(craft["time"]), run["time"])
    quaternion = array(craft["quaternion"]).reshape(-1, 4)
    np.testing.assert_array_equal(quaternion, run["quaternion"])
    assert [one["name"] for one in craft["phases"]] == ["slew", "hold still"]
    assert craft["phases"][0]["end"] == craft["phases"][1]["start"] == pytest.approx(5.1)


def test_the_replay_draws_the_actuators_of_the_scenario_and_when_they_fail(page):
    craft = craft_of(page)
    up, down, gone = craft["thrusters"]
    assert up["failures"] == down["failures"] == [{"at": 3.5, "kind": "dead"}]
    np.testing.assert_allclose(up["force"], np.array([-1, 1, -2]) / np.sqrt(6))
    np.testing.assert_allclose(down["force"], -np.array(up["force"]))
    assert (up["column"], down["column"], gone["column"]) == (0, 1, None)
    assert gone["failures"] == [{"at": 0.0, "kind": "failed"}]
    np.testing.assert_allclose(gone["axis"], [0, 0, 1])
    (wheels,) = craft["devices"]
    (wheel,) = wheels["parts"]
    assert (wheels["kind"], wheels["shape"], wheel["failures"]) == ("wheel", "disc", [])
    momentum = array(wheels["levels"], "<f4")
    np.testing.assert_allclose(momentum, run_dataset()["wheel_momentum"][:, 0] / 4, atol=1e-6)
    largest = max(abs(np.array(up["position"])) / np.array(craft["half"]))
    assert largest == pytest.approx(1), "the thrusters sit on the box"


def test_the_replay_draws_magnetorquers_and_when_they_fail():
    told = {
        "spacecraft": {"inertia_kg_m2": [1.0, 2.0, 3.0]},
        "magnetorquer": [
            {"name": "rod", "axis": [0, 0, 2], "dipole_limit_A_m2": 0.5},
            {"axis": [1, 0, 0], "dipole_limit_A_m2": 0.2, "failed": True},
        ],
        "failure": [
            {"of": "magnetorquer rod", "at_s": at, "kind": kind}
            for at, kind in ((2.0, "dead"), (1.0, "reversed"), (11.0, "stuck-on"))
        ],
    }
    run = run_dataset()
    dipole = np.stack([np.linspace(-0.5, 0.5, len(run["time"])), 0 * run["time"].values], axis=1)
    made = craft(run.assign(dipole=(("time", "magnetorquer"), dipole)), told, "rods")
    (rods,) = made["devices"]
    rod, gone = rods["parts"]
    assert (rods["kind"], rods["shape"]) == ("magnetorquer", "rod")
    assert (rod["name"], rod["axis"]) == ("rod", [0, 0, 1])
    assert [one["kind"] for one in rod["failures"]] == ["reversed", "dead", "stuck-on"]
    told = [
        {"what": f"magnetorquer rod {rod['failures'][k]['kind']}", "at": k + 1.0} for k in (0, 1)
    ]
    assert made["failures"] == told, "the third failure is after the end"
    assert (gone["name"], gone["failures"]) == ("2", [{"at": 0.0, "kind": "failed"}])
    np.testing.assert_allclose(array(rods["levels"], "<f4").reshape(-1, 2), dipole / [0.5, 0.2])


def test_a_box_of_the_inertia_has_this_inertia():
    sides = np.array([0.4, 0.7, 1.0])
    moments = [(sides**2).sum() - side**2 for side in sides]
    turn, _ = np.linalg.qr(np.arange(9.0).reshape(3, 3) + np.eye(3))
    matrix = turn @ np.diag(moments) @ turn.T
    axes, half = body_box({"spacecraft": {"inertia_kg_m2": matrix.tolist()}})
    np.testing.assert_allclose(sorted(half), sides)
    made = sum(((half**2).sum() - h**2) * np.outer(a, a) for h, a in zip(half, axes, strict=True))
    np.testing.assert_allclose(made, matrix, atol=1e-12)
    slab = body_box({"spacecraft": {"inertia_kg_m2": [1.0, 1.0, 5.0]}})[1]
    assert np.isfinite(slab).all(), "an inertia that no body has"
    assert (slab > 0).all()


@pytest.mark.parametrize("columns", [1, 3, 8])
def test_decimation_keeps_first_last_and_all_extremes_of_every_part(columns):
    samples = 50_000
    values = np.random.default_rng(1).normal(size=(samples, columns))
    values[777, 0] = 1e3
    values[-400:, 0] = np.nan
    kept = kept_samples(values, 2000)
    assert len(kept) < 2500
    assert kept[0] == 0
    assert kept[-1] == samples - 1
    assert samples - 401 in kept, "the last before the signal ends"
    parts = np.array_split(np.arange(samples), 20)
    for part in parts[1:-1]:
        some = np.intersect1d(part, kept)
        inside = part[1000:-1000]
        for column in values.T:
            extremes = column[inside][np.isfinite(column[inside])]
            if len(extremes):
                assert np.nanmin(column[some]) <= extremes.min()
                assert np.nanmax(column[some]) >= extremes.max()


def test_few_samples_are_all_kept():
    assert len(kept_samples(np.zeros((4000, 5)))) == 4000


def test_nothing_from_outside_is_taken_for_markup_code_or_mathematics(run_file):
    scenario = SCENARIO.replace('name = "up"', f"name = '''{NASTY}'''").replace("A run", "x")
    run = run_dataset(title=NASTY, scenario=scenario)
    run["propellant"] = run["z"] * 2
    run["propellant"].attrs = {"units": NASTY, "long_name": NASTY}
    page = report_page([run_file(run)])
    assert "<script>alert" not in page
    assert "<b>&amp;" not in page
    assert page.count("</script>") == page.count("<script")
    plots = page[page.rindex("docs_json") - 10 :]
    assert "$$x$$" not in plots.split("const render_items")[0].split("docs_json = ")[-1]


def test_the_page_names_no_address_to_load_from(page):
    own = re.sub(r"<script.*?</script>", "", page, flags=re.S)
    assert not re.search(r"""(src|href)=["'](https?:)?//""", own)
    assert "default-src 'none'" in page
    assert len(page.encode()) < 6e6


@pytest.mark.slow
def test_a_long_run_stays_small(run_file):
    run = run_dataset(200_001)
    page = report_page([run_file(run)])
    assert len(page.encode()) < 6e6
    craft = craft_of(page)
    assert craft["thinned"] == 11
    kept = array(craft["time"])
    assert kept[-1] == 10.0
    at = np.searchsorted(run["time"].values, kept)
    quaternion = array(craft["quaternion"]).reshape(-1, 4)
    np.testing.assert_array_equal(quaternion, run["quaternion"].values[at])


@pytest.mark.slow
def test_several_runs_are_replayed_side_by_side(run_file):
    paths = [run_file(run_dataset(title=title), f"{title}.nc") for title in ("one", "two")]
    page = report_page(paths)
    assert [craft["title"] for craft in json_of(page, "r0-0")] == ["one", "two"]
    assert page.count('class="replay"') == 3


@pytest.mark.filterwarnings("ignore::jaxsat.store.marker.UnverifiedWarning")
def test_what_is_no_result_is_refused(tmp_path):
    with pytest.raises(OutputError, match="does not exist"):
        report_page([tmp_path / "nothing"])
    with pytest.raises(OutputError, match="no result"):
        report_page([tmp_path])
    file = tmp_path / "trajectory.nc"
    file.write_bytes(b"no netCDF")
    with pytest.raises(OutputError, match="cannot be read"):
        report_page([file])


def test_without_bokeh_the_message_says_what_to_install(run_file, monkeypatch):
    monkeypatch.setattr(html, "PACKAGES", ("bokeh", "no_such_package"))
    with pytest.raises(html.MissingPackages, match=r"no_such_package: pip install 'jaxsat\["):
        report_page([run_file(run_dataset())])


def test_settled_is_told_as_a_study_judges_it():
    """A law that only stops a rotation is judged by the relative rate, with that of the orbit."""
    tables = {"control": {"law": "one-torque"}, "settled": {"rate_rad_s": 2e-3, "dwell_s": 30.0}}
    tables |= {"orbit": {"rate_rad_s": 0.0011, "altitude_km": None}}
    assert settled_meaning(tables) == "|ω| < 0.002 rad/s to the end, 30 s at least"
    told = settled_meaning(tables, of_study=True)
    assert told == "relative rate |ω_r| < 0.0031 rad/s to the end, 30 s at least"


def test_actuators_are_counted_in_words():
    tables = {"control": {"law": "three-slew"}, "simulation": {"duration_s": 10.0}}
    parts = {"wheel": [{}, {"failed": True}], "flexible_mode": [{}], "gimbal": [{}, {}]}
    facts = scenario_facts(tables | parts)
    assert facts["actuators"] == "2 wheels, 1 failed; 2 control moment gyros; 1 flexible mode"
