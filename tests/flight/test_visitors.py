"""Laws of several kinds that the exporter has not seen before: their C is covered by the tests that
it comes with, and recovers from faults of its measurements."""

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from helpers.tools import needs
from jaxsat.flight import vectors
from jaxsat.flight.files import export
from jaxsat.flight.flight import flight_loop
from jaxsat.flight.request import Request
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.simulation.sampled_loop import SampledLoop
from tests.flight.folders import write_files
from tests.flight.guarded import Guarded, check_status, faulty_flights, pointing_errors
from tests.flight.sizes import too_large
from tests.flight.test_strangers import PROVENANCE, SCENARIO

LAWS = {
    "visitors:ScheduledPD": "kp = 0.3\nkd = 2.0",
    "visitors:SlidingMode": "slope = 0.05\ngain = 0.3",
    "visitors:Notched": "kp = 0.2\nkd = 1.5",
    "guests:BangBang": "level = 0.02\ndead_band_rad = 0.015",
    "guests:Observing": "kp = 0.3\nkd = 2.0",
    "newcomers:Tabled": "slope = 0.05\ngain = 0.3",
}
"""Laws with tables, a bounded search, filters, switches with hysteresis, a Kalman filter, and a
bisection."""


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """Where the laws are: a module is imported once."""
    place = tmp_path_factory.mktemp("visitors")
    for name in ("visitors.py", "guests.py", "newcomers.py"):
        shutil.copy(Path(__file__).with_name(name), place)
    return place


def _run(folder: Path, law: str):
    place = folder / f"{law.split(':')[1]}.toml"
    place.write_text(SCENARIO.replace("@LAW@", law).replace("@KEYS@", LAWS[law]))
    scenario = load(place)
    return scenario, build(scenario)


@needs("gcc")
@needs("gcov")
@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_calls_cover_the_branches_of_new_laws(tmp_path, folder, monkeypatch, law):
    """To the bit, at least 98 % of the branches and MC/DC of 97 % of the conditions."""
    monkeypatch.setattr(vectors, "SAMPLES", 640)
    monkeypatch.setattr("jaxsat.flight.files.measured", lambda files: {})
    scenario, run = _run(folder, law)
    keys = scenario.law.declaration.keys
    made = export(Request(run.loop, run.start, 100.0, "", "", PROVENANCE, keys=keys))
    assert too_large(made.files) == {}
    write_files(tmp_path, made.files)
    done = subprocess.run(["make", "coverage"], cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    assert re.findall(r"\d+ (?:samples|calls), (\d+) numbers differ", done.stdout) == ["0", "0"]
    found = re.search(r"File 'controller\.c'\n.*?Taken at least once:([\d.]+)%", done.stdout, re.S)
    assert found is not None
    assert float(found[1]) >= 98.0
    effect = re.search(r"^Conditions, independent effect \(MC/DC\): ([\d.]+)%", done.stdout, re.M)
    assert effect is not None
    assert float(effect[1]) >= 97.0


@needs("gcc")
@pytest.mark.slow
@pytest.mark.parametrize("law", LAWS)
def test_new_laws_recover_from_invalid_measurements(tmp_path, folder, law):
    _, run = _run(folder, law)
    loop = flight_loop(run.loop, run.start)
    assert isinstance(loop, SampledLoop)
    guarded = Guarded(tmp_path, loop, run.start)
    flown = faulty_flights(loop, run.start, guarded, 200.0)
    check_status(flown, guarded, 0.25)
    errors = pointing_errors(flown.plant)
    assert (errors < 2.0).all(), errors
