"""`jaxsat convert` as a user meets it."""

import pytest

from helpers.pages import SCENARIO, run_dataset
from jaxsat.store.folder import OutputFolder
from jaxsat.store.marker import MARKER
from jaxsat.store.netcdf import dataset_bytes


@pytest.fixture
def run(tmp_path):
    with OutputFolder(tmp_path / "mine") as folder:
        folder.write("trajectory.nc", dataset_bytes(run_dataset()))


def test_a_run_becomes_a_file_of_its_name(command_line, run, tmp_path):
    aem = ("convert", "mine", "--to", "aem", "--epoch", "2026-03-20T12:00:00Z", "--frame", "orbit")
    assert command_line(*aem) == (0, "written to mine.aem\n", "")
    assert "START_TIME = 2026-03-20T12:00:00.000000000" in (tmp_path / "mine.aem").read_text()
    assert "mine.aem already exists; give --overwrite" in command_line(*aem)[2]
    assert command_line("convert", "mine/trajectory.nc", "--to", "csv", "--out", "a.csv")[0] == 0
    assert (tmp_path / "a.csv").read_text().startswith("time_s,w_0,w_1,z_rad,quaternion_0")


@pytest.mark.parametrize(
    ("tokens", "message"),
    [
        (("--to", "aem"), "--epoch: must be given with --to aem"),
        (("--to", "aem", "--epoch", "noon"), "--epoch: must be a date and time in UTC such as"),
        (("--to", "aem", "--epoch", "2026-03-20"), "--epoch: must be a date and time"),
        (("--to", "aem", "--epoch", "2026-03-20T12:00:00+02:00"), "without another zone"),
        (("--to", "aem", "--epoch", "2016-12-31T23:59:60"), "and no leap second, got 2016-12-31T"),
        (("--to", "aem", "--epoch", "2026-02-30T00:00:00"), "--epoch: must be a date and time"),
        (("--to", "aem", "--epoch", "2300-01-01T00:00:00.123456789"), "at most six decimals"),
        (("--to", "csv", "--epoch", "2026-03-20T12:00:00"), "must be given with --to aem"),
        (("--to", "aem", "--epoch", "2026-03-20T12:00:00"), "its scenario has no [orbit]"),
    ],
)
def test_mistakes_are_told_and_nothing_is_written(command_line, run, tmp_path, tokens, message):
    status, out, err = command_line("convert", "mine", *tokens)
    assert (status, out) == (2, "")
    assert message in err
    assert [path.name for path in tmp_path.iterdir()] == ["mine"]


@pytest.mark.filterwarnings("ignore::jaxsat.store.marker.UnverifiedWarning")
def test_it_is_written_beside_the_run(command_line, run, tmp_path, monkeypatch):
    (tmp_path / "elsewhere").mkdir()
    monkeypatch.chdir(tmp_path / "elsewhere")
    assert command_line("convert", "../mine", "--to", "csv")[0] == 0
    assert (tmp_path / "mine.csv").exists()
    (tmp_path / "lone").mkdir()
    (tmp_path / "lone" / "trajectory.nc").write_bytes(dataset_bytes(run_dataset()))
    assert command_line("convert", "../lone/trajectory.nc", "--to", "csv")[0] == 0
    assert (tmp_path / "lone" / "trajectory.csv").exists()  # in jaxsat's it would be foreign
    status, _, err = command_line("convert", "../mine/trajectory.nc", "--to", "csv")
    assert (status, "mine.csv already exists" in err) == (2, True)
    monkeypatch.chdir(tmp_path / "mine")
    assert "mine.csv already exists" in command_line("convert", ".", "--to", "csv")[2]


@pytest.mark.filterwarnings("default::jaxsat.store.marker.UnverifiedWarning")
def test_a_run_whose_marker_is_gone_is_converted_and_that_is_told(command_line, run, tmp_path):
    (tmp_path / "mine" / MARKER).unlink()
    status, _, err = command_line("convert", "mine", "--to", "csv")
    assert (status, err.count("\n")) == (0, 1)
    assert err.startswith("warning: files in mine are not verified: it has no .jaxsat")


@pytest.mark.filterwarnings("ignore::jaxsat.store.marker.UnverifiedWarning")
def test_the_epoch_is_that_of_the_scenario_unless_given(command_line, tmp_path):
    scenario = SCENARIO + '\n[orbit]\nrate_rad_s = 0.001\nepoch = "2025-01-02T03:04:05"\n'
    (tmp_path / "mine.nc").write_bytes(dataset_bytes(run_dataset(scenario=scenario)))
    aem = ("convert", "mine.nc", "--to", "aem", "--overwrite")
    for epoch in ("2025-01-02T03:04:05", "2026-03-20T12:00:00"):
        assert command_line(*aem)[0] == 0
        assert f"START_TIME = {epoch}.000000000" in (tmp_path / "mine.aem").read_text()
        aem = (*aem, "--epoch", "2026-03-20T12:00:00")


def test_an_epoch_beyond_64_bits_is_right(command_line, run, tmp_path):
    aem = ("convert", "mine", "--to", "aem", "--frame", "orbit", "--epoch", "2300-01-01T00:00:00.5")
    assert command_line(*aem)[0] == 0
    assert "START_TIME = 2300-01-01T00:00:00.500000000" in (tmp_path / "mine.aem").read_text()


def test_a_spacecraft_of_42_becomes_a_scenario(command_line, tmp_path):
    from scenario.test_spacecraft_42 import FILE, NODES

    (tmp_path / "SC_X.txt").write_text(FILE)
    convert = ("convert", "SC_X.txt", "--to", "scenario")
    assert (
        "Nodes.txt: must be a file that can be read, got: No such file" in command_line(*convert)[2]
    )
    (tmp_path / "Nodes.txt").write_text(NODES)
    status, out, _ = command_line(*convert)
    assert status == 0
    assert out.startswith("not in it: mass 10.0 kg, which only translation needs\n")
    assert out.endswith("written to SC_X.toml\n")
    (tmp_path / "SC_Y.txt").write_text("no such thing")
    assert "SC_Y.txt: must begin with" in command_line("convert", "SC_Y.txt", "--to", "scenario")[2]
    status, _, err = command_line(*convert, "--epoch", "2026-03-20T12:00:00")
    assert (status, "must be given with --to aem, got --to scenario" in err) == (2, True)
