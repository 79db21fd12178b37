"""A flight in Python is that of the command line, in what it tells and in its files."""

import pytest

import jaxsat

SHORT = ["simulation.duration_s=20", "simulation.save_every_s=0.5"]


def test_a_flight_is_what_the_command_line_writes_and_prints(command_line, tmp_path):
    flight = jaxsat.fly(jaxsat.load("paper-rate", SHORT))
    status, printed, told = command_line(
        "simulate",
        "paper-rate",
        *(token for one in SHORT for token in ("--set", one)),
        "--out",
        str(tmp_path / "run"),
    )
    assert status == 0, told
    assert printed.startswith(str(flight))
    saved = jaxsat.open_trajectory(tmp_path / "run")
    assert saved.drop_attrs().identical(flight.dataset.drop_attrs())
    flight.save(tmp_path / "saved")
    files = {one.name: one.read_bytes() for one in (tmp_path / "run").iterdir()}
    assert {one.name for one in (tmp_path / "saved").iterdir()} == files.keys()
    for name in ("scenario.toml", "attitude.png", "rates.svg"):
        assert (tmp_path / "saved" / name).read_bytes() == files[name]
    with pytest.raises(jaxsat.OutputError, match="exists"):
        flight.save(tmp_path / "saved")
    flight.save(tmp_path / "saved", overwrite=True)
