"""`jaxsat montecarlo`."""

import signal

import numpy as np
import pytest

from jaxsat.cli import main
from jaxsat.results import open_study, open_trajectory

SHORT = [
    "switching",
    *("--set", "simulation.duration_s=3"),
    *("--set", "dispersion.omega_rad_s={distribution='uniform', low=-0.1, high=0.1}"),
    *("--set", "dispersion.inertia={distribution='uniform', low=-0.1, high=0.1}"),
    *("--width", "4", "--workers", "1"),
]


@pytest.fixture(autouse=True)
def _elsewhere(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    handler = signal.getsignal(signal.SIGTERM)
    yield
    signal.signal(signal.SIGTERM, handler)


@pytest.fixture
def jaxsat(capsys):
    def run(*tokens):
        with pytest.raises(SystemExit) as caught:
            main(["montecarlo", *tokens])
        output = capsys.readouterr()
        return caught.value.code, output.out, output.err

    return run


def test_a_study_is_written_gone_on_with_and_replayed(jaxsat, tmp_path):
    status, out, _ = jaxsat(*SHORT, "-n", "6", "--seed", "3", "--out", "s", "--figures", "f")
    assert status == 0
    assert "cases            6: 0 settled, 6 unsettled" in out
    dataset = open_study(tmp_path / "s")
    assert np.all(dataset["status"] == 1)
    assert np.ptp(dataset["drawn_omega"].values, axis=0).min() > 0
    names = {path.name for path in (tmp_path / "f").glob("*.png")}
    assert "rates-fan.png" in names
    assert len(names) == 5

    status, out, _ = jaxsat(*SHORT, "-n", "9", "--seed", "3", "--out", "s")
    assert status == 0
    larger = open_study(tmp_path / "s")
    np.testing.assert_array_equal(larger["omega"][:6], dataset["omega"])

    status, out, _ = jaxsat(*SHORT, "--seed", "3", "--case", "5", "--out", "case")
    assert status == 0
    assert "inertia" in out
    run = open_trajectory(tmp_path / "case")
    np.testing.assert_array_equal(run["omega"][-1], larger["omega"][5])
    assert run.attrs["case"] == 5
    np.testing.assert_array_equal(run["omega"][0], larger["drawn_omega"][5])

    status, _, err = jaxsat(*SHORT, "-n", "9", "--seed", "4", "--out", "s")
    assert status == 2
    assert "another study (design" in err or "seed: 3 there, 4 here" in err


@pytest.mark.parametrize(
    ("tokens", "message"),
    [
        (["switching"], "[dispersion] table"),
        ([*SHORT, "--until-ci", "half"], "--until-ci: must be a half width"),
        ([*SHORT, "-n", "0"], "`count` must be at least 1"),
        ([*SHORT, "--seed", "-1"], "`seed` must be"),
    ],
)
def test_mistakes_exit_with_two(jaxsat, tokens, message):
    status, _, err = jaxsat(*tokens)
    assert status == 2
    assert message in err
