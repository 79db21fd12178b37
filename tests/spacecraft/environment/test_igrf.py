"""The IGRF-14: against ppigrf, and values that it gave; the table of it along an orbit."""

import datetime

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxsat.core.earth import circular_orbit_rate, epoch_of, sidereal_angle
from jaxsat.scenario import ScenarioError
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.spacecraft.environment.igrf import IgrfField, igrf_coefficients, igrf_field
from jaxsat.spacecraft.environment.orbit import CircularOrbit, DipoleField
from oracle import orbital_torques as oracle

EPOCH = np.datetime64("2026-03-20T12:00:00")
PLACE = (1.7, 0.4, -0.7, 2.1)
"""Inclination, node, argument of latitude and sidereal angle, rad."""

# date, radius (km), colatitude and longitude (degrees), and radial, southward and eastward
# components (nT) by ppigrf 2.1.0 (https://pypi.org/project/ppigrf)
KNOWN = [
    ("1900-01-01T00:00:00", 6371.2, 90, 0, (5630.6548144, -28119.3630485, -8589.1568033)),
    ("1903-07-02T06:00:00", 6800, 30, 100, (-47434.2082086, -12206.0410524, 1165.6107480)),
    ("1925-01-01T00:00:00", 7000, 120, -60, (8945.5243017, -19304.3152638, 874.3082837)),
    ("1944-02-29T12:00:00", 6500, 1, 15, (-52424.8594539, -2820.8199089, -1153.8970498)),
    ("1965-05-05T05:05:05", 6378.137, 75.5, -179.5, (-13331.2168304, -30367.9166807, 5520.2255192)),
    ("1980-01-01T00:00:00", 12000, 60, 45, (-3914.4940285, -4349.9742853, -270.3730126)),
    ("1999-12-31T23:59:59", 6921, 97.6, 200, (7270.3535394, -25294.5770783, 4719.2820897)),
    ("2005-01-01T00:00:00", 6471, 179, 300, (49641.1591135, -13625.9844238, 7826.5781385)),
    ("2012-08-06T05:17:57", 6671, 45, -110, (-44320.5258412, -15818.4024700, 3163.1316893)),
    ("2020-01-01T00:00:00", 6371.2, 40, 10, (-44653.4000664, -19767.1258402, 1102.2986116)),
    ("2026-03-20T12:00:00", 6928, 14, 77, (-45742.5636165, -3596.8275042, 1626.7123677)),
    ("2029-12-31T00:00:00", 42164, 90, 120, (33.0559775, -105.2092781, 2.1440892)),
]


def axes_of(colatitude, longitude):
    """Rows: radial, southward and eastward, for angles in degrees."""
    turn = Rotation.from_euler("ZY", np.stack([longitude, colatitude], axis=-1), degrees=True)
    return turn.as_matrix()[..., [2, 0, 1]].swapaxes(-1, -2)


@pytest.mark.parametrize(("date", "radius", "colatitude", "longitude", "components"), KNOWN)
def test_known_values(date, radius, colatitude, longitude, components):
    rows = axes_of(colatitude, longitude)
    field = igrf_field(1e3 * radius * rows[0], igrf_coefficients(epoch_of(date)))
    size = float(np.linalg.norm(components))
    np.testing.assert_allclose(1e9 * rows @ field, components, rtol=0, atol=1e-9 * size)


def test_fields_are_those_of_ppigrf():
    ppigrf = pytest.importorskip("ppigrf")
    draw = np.random.default_rng(1)
    for _ in range(20):
        seconds = int(draw.integers(0, 130 * 365 * 86400))
        date = datetime.datetime(1900, 1, 1) + datetime.timedelta(seconds=seconds)
        radius, longitude = draw.uniform(6371, 50000, 500), draw.uniform(-180, 180, 500)
        colatitude = np.degrees(np.arccos(draw.uniform(-1, 1, 500)))
        there = [part[0] for part in ppigrf.igrf_gc(radius, colatitude, longitude, date)]
        rows = axes_of(colatitude, longitude)
        position = 1e3 * radius[:, None] * rows[:, 0]
        field = igrf_field(position, igrf_coefficients(np.datetime64(date)))
        components = 1e9 * np.einsum("nij,nj->in", rows, field)
        error = np.linalg.norm(components - there, axis=0) / np.linalg.norm(there, axis=0)
        assert error.max() < 1e-9


def test_a_field_at_the_pole_has_derivatives():
    coefficients = igrf_coefficients(EPOCH)
    pole, step = jnp.array([0.0, 0.0, 6.8e6]), 100.0
    slope = jax.jit(jax.jacfwd(lambda place: igrf_field(place, coefficients)))(pole)
    near = [np.asarray(pole) + sign * step * np.eye(3) for sign in (1, -1)]
    above, below = (igrf_field(places, coefficients) for places in near)
    size = np.abs(slope).max()
    np.testing.assert_allclose(slope, (above - below).T / (2 * step), atol=1e-6 * size)
    assert abs(np.trace(slope)) < 1e-12 * size  # no source
    np.testing.assert_allclose(slope, slope.T, atol=1e-12 * size)  # no current


def test_the_table_along_an_orbit_is_the_field():
    rate = circular_orbit_rate(200e3)
    field = IgrfField(CircularOrbit(rate, *PLACE), EPOCH)
    times = np.random.default_rng(2).uniform(0, 3 * 86400, 500)
    table = field.sampled(times, oracle.EARTH_ROTATION * times)
    found = np.asarray(jax.jit(jax.vmap(field))(jnp.asarray(times)))
    np.testing.assert_allclose(found, table, atol=1e-12 * np.abs(table).max())
    coefficients, error = igrf_coefficients(EPOCH), []
    for t, here in zip(times, table, strict=True):
        position, velocity = oracle.place(t, rate, *PLACE[:3])
        earth = Rotation.from_euler("Z", PLACE[3] + oracle.EARTH_ROTATION * t)
        there = earth.apply(igrf_field(earth.inv().apply(position), coefficients))
        exact = oracle.orbit_axes(position, velocity) @ there
        error.append(np.linalg.norm(here - exact) / np.linalg.norm(exact))
    assert max(error) < 1e-6


def test_another_orbit_or_date_compiles_nothing_anew():
    traces = []

    @eqx.filter_jit
    def there(field):
        traces.append(field)
        return field(jnp.array(60.0))

    first, *rest = (
        there(IgrfField(CircularOrbit(circular_orbit_rate(height), tilt), np.datetime64(date)))
        for height, tilt, date in [
            (300e3, 1.0, "1960-05-05"),
            (900e3, 1.0, "1960-05-05"),
            (300e3, 1.7, "1960-05-05"),
            (300e3, 1.0, "2025-05-05"),
        ]
    )
    assert len(traces) == 1
    assert min(np.linalg.norm(other - first) for other in rest) > 1e-3 * np.linalg.norm(first)


@pytest.mark.slow
def test_a_study_flies_in_the_igrf():
    def study(*changes):
        changes = ["orbit.sidereal_angle_rad=0.0", 'orbit.field="igrf"', *changes]
        return build_study(load("rods-only", changes, purpose="study"), 8)

    def kernel(one):
        return one.engine.kernel(one.program, one.cases(np.arange(8)))

    flown, other = (study(f"orbit.epoch={day}T12:00:00") for day in ("2026-03-20", "1961-04-12"))
    assert np.isfinite(flown.evaluate(np.arange(8)).settling_time).all()
    assert kernel(other) is kernel(flown)


def test_far_away_the_field_is_a_dipole():
    orbit = CircularOrbit(circular_orbit_rate(1e9), *PLACE)
    field, dipole = IgrfField(orbit, np.datetime64("2020-01-01")), DipoleField(orbit)
    found, expected = (one.sampled(np.array([0.0]), np.array([0.0])) for one in (field, dipole))
    np.testing.assert_allclose(found, expected, atol=2e-2 * np.abs(expected).max())
    np.testing.assert_allclose(field.dipole, dipole.dipole, atol=2e-3 * np.abs(dipole.dipole).max())


@pytest.mark.parametrize(
    ("epoch", "hours"),
    [  # Meeus, Astronomical Algorithms, 1998, examples 12.a and 12.b
        ("1987-04-10T00:00:00", 13 + 10 / 60 + 46.3668 / 3600),
        ("1987-04-10T19:21:00", 8 + 34 / 60 + 57.0896 / 3600),
    ],
)
def test_sidereal_time(epoch, hours):
    assert abs(sidereal_angle(epoch_of(epoch)) * 12 / np.pi - hours) < 1e-4 / 3600


def test_the_epoch_of_a_scenario_tells_where_greenwich_is():
    given = ('"2026-03-20T12:00:00"', "2026-03-20T12:00:00", "2026-03-20 12:00:00.000Z")
    for epoch in given:  # text, and dates and times of TOML
        changes = [f"orbit.epoch={epoch}", 'orbit.field="igrf"']
        run = load("rods-only", changes, purpose="text")
        assert (run.orbit.field, run.orbit.greenwich()) == ("igrf", sidereal_angle(EPOCH))


@pytest.mark.parametrize(
    ("changes", "said"),
    [
        (['orbit.field="igrf"'], r"orbit\.epoch.*must be given"),
        (['orbit.epoch="noon"'], "a date and time in UTC"),
        (["orbit.epoch=2026-03-20"], "a date and time in UTC .* got 2026-03-20"),
        (["orbit.epoch=2026-03-20T12:00:00+02:00"], "a date and time in UTC"),
        (
            ["orbit.sidereal_angle_rad=1.0", 'orbit.epoch="2026-03-20T12:00"'],
            "sidereal_angle_rad.*must not be given with epoch",
        ),
        (
            ['orbit.field="igrf"', 'orbit.epoch="2031-01-01T00:00:00"'],
            "from 1900-01-01 to 2030-01-01",
        ),
    ],
)
def test_epochs_that_cannot_be_are_told(changes, said):
    with pytest.raises(ScenarioError, match=said):
        load("rods-only", changes)
