"""What actuators use and store is told of every case of a study: propellant, openings, momentum."""

import csv

import jax.numpy as jnp
import numpy as np
import pytest
import xarray as xr

from jaxsat.report.study_document import study_document
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.held_torque import Unmade
from jaxsat.store.files import OutputError
from jaxsat.store.tables import open_study, save_case_table
from jaxsat.studies.columns import COLUMNS
from jaxsat.studies.executors import AbstractExecutor
from jaxsat.studies.run import run_study
from jaxsat.studies.summary import summarise
from studies.studies import tumbling

pytestmark = pytest.mark.filterwarnings("ignore:.*never used:jaxsat.scenario.ScenarioWarning")
"""The wheel about z keeps its momentum: the law commands torques about x and y."""

PULSES = [
    "simulation.duration_s=2",
    'dispersion.torque_gain={distribution="normal",mean=0,sigma=0.1}',
]
WHEEL = "[{axis=[0,0,1],torque_limit_N_m=0.4,momentum_limit_N_m_s=20,momentum_N_m_s=1.5}]"
MORE = {
    "propellant": ("kg", ("case",)),
    "valve_openings": ("1", ("case", "thruster")),
    "peak_wheel_momentum": ("N m s", ("case", "wheel")),
    "peak_torque_unmade": ("N m", ("case",)),
    "unmade_fraction": ("1", ("case",)),
}


def study(*overrides, engine="native", **options):
    scenario = load("pulsed-two-torque", [*PULSES, *overrides])
    return build_study(scenario, 3, engine=engine, **options)


class Nobody(AbstractExecutor):
    """Computes nothing."""

    def run(self, work, chunks):
        return iter(())


@pytest.mark.slow
def test_store_table_and_summary_have_them_with_units(tmp_path):
    made = study(f"wheel={WHEEL}")
    run_study(made, tmp_path / "s.zarr")
    found = open_study(tmp_path / "s.zarr")
    outside = xr.open_zarr(tmp_path / "s.zarr")
    outputs = made.evaluate(np.arange(3))
    for name, (units, dims) in MORE.items():
        np.testing.assert_array_equal(found[name], outputs.parts[name])
        np.testing.assert_array_equal(outside[name], found[name])
        assert (found[name].attrs["units"], found[name].dims) == (units, dims)
    assert np.all(found["propellant"] > 0)
    assert found.sizes["thruster"] == 4
    assert np.all(found["valve_openings"].sum("thruster") >= 3)
    np.testing.assert_allclose(found["peak_wheel_momentum"], 1.5, rtol=1e-2)
    history = made.engine.histories(made.program, made.cases(np.arange(3)))
    sizes = np.linalg.norm(history.torque_unmade[:, :-1], axis=-1)
    np.testing.assert_allclose(found["peak_torque_unmade"], sizes.max(axis=1), rtol=1e-12)
    np.testing.assert_allclose(found["unmade_fraction"], (sizes > 1e-9).mean(axis=1), rtol=1e-12)
    table = study_document(summarise(found), {}).blocks[0]
    for title in ("propellant (kg)", "openings of all valves", "largest momentum of any wheel"):
        assert sum(row[0].startswith(title) for row in table.rows) == 1
    save_case_table(tmp_path / "s.zarr", tmp_path / "s.csv")
    with (tmp_path / "s.csv").open() as file:
        rows = list(csv.DictReader(file))
    assert [float(row["propellant_kg"]) for row in rows] == found["propellant"].values.tolist()
    assert float(rows[1]["valve_openings_y-"]) == found["valve_openings"][1, 3]
    assert float(rows[2]["peak_wheel_momentum_1_N_m_s"]) == found["peak_wheel_momentum"][2, 0]


def test_loops_without_have_no_column_for_them():
    assert {name for name in tumbling(4).columns() if "drawn" not in name} == set(COLUMNS)


@pytest.mark.slow
def test_a_store_from_before_is_read_and_not_continued(tmp_path, monkeypatch):
    """It lacks what the study now has of every case, which the refusal names."""
    with monkeypatch.context() as before:
        before.setattr("jaxsat.studies.ensemble.columns_of", lambda loop: dict(COLUMNS))
        run_study(study(), tmp_path / "s.zarr", executor=Nobody())
    assert set(MORE).isdisjoint(open_study(tmp_path / "s.zarr"))
    told = r"columns\.propellant: null there, .* here; columns\.\w+: null"
    with pytest.raises(OutputError, match=told):
        run_study(study(), tmp_path / "s.zarr")


def test_torque_that_is_not_made_is_counted_by_sample_and_rounding_is_none():
    rng = np.random.default_rng(3)
    torque = rng.normal(size=(40, 3))
    unmade = np.where(rng.random((40, 1)) < 0.3, rng.normal(size=(40, 3)), 1e-17)
    record = Unmade.none(jnp.zeros(()))
    for sample in zip(jnp.asarray(torque), jnp.asarray(unmade), strict=True):
        record = record.with_sample(*sample)
    sizes = np.linalg.norm(unmade, axis=1)
    assert float(record.samples) == 40
    assert float(record.lacking) == np.sum(sizes > 1e-12)
    np.testing.assert_allclose(np.sqrt(record.square), sizes.max())


def test_axes_of_parts_have_the_names_of_the_scenario():
    named = WHEEL.replace("[{", "[{name='rw',")
    made = study(f"wheel={named}", engine="scan")
    assert made.coordinates()["thruster"].values == ("x+", "x-", "y+", "y-")
    assert made.coordinates()["wheel"].values == ("rw",)
