"""`jaxsat report` as a user meets it."""

import pytest

from helpers.pages import run_dataset
from jaxsat.report.page import html
from jaxsat.scenario import library
from jaxsat.store.folder import OutputFolder
from jaxsat.store.netcdf import dataset_bytes


@pytest.fixture
def run(tmp_path):
    with OutputFolder(tmp_path / "run") as folder:
        folder.write("trajectory.nc", dataset_bytes(run_dataset()))


def test_a_page_is_written_and_not_replaced_unasked(command_line, run, tmp_path):
    status, out, err = command_line("report", "run", "--out", "run.html")
    assert (status, out, err) == (0, "written to run.html\n", "")
    written = (tmp_path / "run.html").read_text(encoding="utf-8")
    assert "Settled at 6.25 s" in written
    status, _, err = command_line("report", "run", "--out", "run.html")
    assert status == 2
    assert "run.html already exists; give --overwrite" in err
    (tmp_path / "run.html").write_text("old")
    assert command_line("report", "run", "--out", "run.html", "--overwrite", "--quiet")[:2] == (
        0,
        "",
    )
    assert (tmp_path / "run.html").stat().st_size > 1e6


@pytest.mark.parametrize(
    ("paths", "message"),
    [
        ([], "must be given at least one path, got none"),
        (["no-such-folder"], "no-such-folder does not exist"),
        (["x" * 300], "PATH: must be a path"),
        ([""], "PATH: must be a path, got nothing"),
        (["."], "is no result of jaxsat"),
    ],
)
def test_mistakes_are_told_and_nothing_is_written(command_line, tmp_path, paths, message):
    status, out, err = command_line("report", *paths)
    assert (status, out) == (2, "")
    assert message in err
    assert list(tmp_path.iterdir()) == []


def test_without_the_packages_the_message_says_what_to_install(command_line, run, monkeypatch):
    monkeypatch.setattr(html, "PACKAGES", ("no_such_package",))
    status, _, err = command_line("report", "run")
    assert status == 2
    assert "a report needs no_such_package: pip install 'jaxsat[report]'" in err


SHORT = ("--set", "simulation.duration_s=2")


@pytest.mark.slow
def test_a_command_writes_its_report_into_its_folder_and_can_replace_both(command_line, tmp_path):
    run = ("simulate", "paper-rate", *SHORT, "--out", "mine", "--report")
    status, out, err = command_line(*run)
    assert (status, err) == (0, "")
    assert "report written to mine/report.html" in out
    assert "Not settled within 2 s." in (tmp_path / "mine" / "report.html").read_text()
    assert command_line(*run)[0] == 2
    assert command_line(*run, "--overwrite")[0] == 0, "the report is known as jaxsat's own"
    elsewhere = (*run, "there.html", "--overwrite", "--quiet")
    assert command_line(*elsewhere) == (0, "", "")
    assert (tmp_path / "there.html").exists()
    assert not (tmp_path / "mine" / "report.html").exists()


@pytest.mark.slow
def test_the_report_of_a_study_is_beside_its_store(command_line, tmp_path):
    table = '\n[dispersion.omega_rad_s]\ndistribution = "uniform"\nlow = -0.05\nhigh = 0.05\n'
    text = library()["paper-rate"].read_text(encoding="utf-8")
    (tmp_path / "mine.toml").write_text(text + table)
    study = ("montecarlo", "mine.toml", *SHORT, "-n", "4", "--report")
    assert command_line(*study, "--quiet") == (0, "", "")
    assert "of 4 cases settle" in (tmp_path / "jaxsat-mine.html").read_text()
    status, _, err = command_line(*study)
    assert status == 2
    assert "jaxsat-mine.html already exists; give --overwrite to replace it" in err
    assert command_line(*study, "--case", "2")[0] == 0
    assert (tmp_path / "jaxsat-mine-2" / "report.html").exists()


@pytest.mark.slow
def test_a_design_and_an_analysis_have_pages(command_line, tmp_path):
    tokens = ("--set", "spacecraft.failed_thrusters=[2, 3]", "--law", "all", "--out", "d")
    status, out, _ = command_line("design", "two-torque-free", *tokens, "--report")
    assert status == 1
    assert "report written to d/report.html" in out
    page = (tmp_path / "d" / "report.html").read_text()
    assert "Nothing to design. No law of jaxsat fits the remaining actuators." in page
    tokens = ("--set", "spacecraft.failed_thrusters=[3]", "--out", "c", "--report", "--quiet")
    assert command_line("controllability", "two-torque-free", *tokens) == (0, "", "")
    page = (tmp_path / "c" / "report.html").read_text()
    assert "Controllable: rank 6 of 6" in page
    assert "Survives 3 of 3 single, " in page
    assert "Spacecraft" in page
    assert "control law" not in page


WRITERS = {
    "simulate": ("simulate", "paper-rate"),
    "montecarlo": ("montecarlo", "benchmark-three-axis"),
    "compare": ("compare", "--seed", "1"),
    "tune": ("tune", "benchmark-three-axis"),
    "design": ("design", "two-torque-free"),
    "reproduce": ("reproduce",),
    "controllability": ("controllability", "paper-rate", "--out", "there"),
}


@pytest.mark.parametrize("tokens", WRITERS.values(), ids=WRITERS)
def test_what_stands_in_the_way_of_a_report_is_told_before_the_work(
    command_line, tmp_path, monkeypatch, tokens
):
    (tmp_path / "kept.html").write_text("mine")
    status, out, err = command_line(*tokens, "--report", "kept.html")
    assert (status, out) == (2, "")
    assert "kept.html already exists; give --overwrite" in err
    assert "another file with --report" in err
    monkeypatch.setattr(html, "PACKAGES", ("no_such_package",))
    status, out, err = command_line(*tokens, "--report")
    assert (status, out) == (2, "")
    assert "a report needs no_such_package: pip install 'jaxsat[report]'" in err
    assert [path.name for path in tmp_path.iterdir()] == ["kept.html"]
