"""`jaxsat report` as a user meets it."""

import pytest

from helpers.pages import run_dataset
from jaxsat.page import document
from jaxsat.results import dataset_bytes


@pytest.fixture
def run(tmp_path):
    (tmp_path / "run").mkdir()
    (tmp_path / "run" / "trajectory.nc").write_bytes(dataset_bytes(run_dataset()))


def test_a_page_is_written_and_not_replaced_unasked(command_line, run, tmp_path):
    status, out, err = command_line("report", "run", "--out", "run.html")
    assert (status, out, err) == (0, "written to run.html\n", "")
    written = (tmp_path / "run.html").read_text(encoding="utf-8")
    assert "Settled from 6.25 s" in written
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
    monkeypatch.setattr(document, "PACKAGES", ("no_such_package",))
    status, _, err = command_line("report", "run")
    assert status == 2
    assert "a report needs no_such_package: pip install 'jaxsat[report]'" in err
