"""Formats of others, read back by programs that are not ours."""

import numpy as np
import pytest
from ccsds_ndm.ndm_io import NdmIo
from scipy.spatial.transform import Rotation

from helpers.pages import SCENARIO, run_dataset
from jaxsat.cli.conversion import ConversionError, attitude_ephemeris

RATE, INCLINATION, NODE, LATITUDE = 0.0011, 0.9, -0.4, 2.0
ORBIT = f"""
[orbit]
rate_rad_s = {RATE}
inclination_rad = {INCLINATION}
ascending_node_rad = {NODE}
argument_of_latitude_rad = {LATITUDE}
"""
EPOCH = np.datetime64("2026-12-31T23:59:58.5")


def read_back(text):
    """Metadata, times and quaternions (scalar last) as the package ccsds-ndm has them."""
    segment = NdmIo().from_string(text).body.segment[0]
    states = [one.quaternion_state for one in segment.data.attitude_state]
    times = np.array([one.epoch for one in states], "datetime64[ns]")
    parts = [[float(getattr(one.quaternion, f"q{k}")) for k in "123c"] for one in states]
    return segment.metadata, times, np.array(parts)


def orbit_axes(time):
    """Axes of the orbit frame as columns: position and velocity on a circle, turned by angles."""
    along = LATITUDE + RATE * time
    plane = Rotation.from_euler("ZX", [NODE, INCLINATION]).as_matrix()
    outwards = plane @ [np.cos(along), np.sin(along), 0]
    velocity = plane @ [-np.sin(along), np.cos(along), 0]
    return np.stack([velocity, -np.cross(outwards, velocity), -outwards], axis=1)


def test_an_attitude_ephemeris_relates_body_to_inertial_axes():
    run = run_dataset(scenario=SCENARIO + ORBIT)
    found, times, quaternions = read_back(attitude_ephemeris(run, EPOCH, object_id="2026-001A"))
    assert (found.ref_frame_a, found.ref_frame_b) == ("EME2000", "SC_BODY_1")
    assert (found.object_name, found.object_id) == ("A run", "2026-001A")
    seconds = (times - EPOCH) / np.timedelta64(1, "s")
    np.testing.assert_allclose(seconds, run["time"], atol=1e-9)
    for number in (0, 37, 100):
        body = orbit_axes(seconds[number]) @ body_in_orbit(run["quaternion"].values[number])
        matrix = Rotation.from_quat(quaternions[number]).as_matrix()
        np.testing.assert_allclose(matrix, body, atol=1e-12)
    assert (np.sum(quaternions[1:] * quaternions[:-1], axis=1) > 0).all()


def body_in_orbit(quaternion):
    """Body axes as columns in the orbit frame: orbit axes turned about the quaternion's axis."""
    angle = 2 * np.arctan2(np.linalg.norm(quaternion[1:]), quaternion[0])
    x, y, z = quaternion[1:] / np.linalg.norm(quaternion[1:])
    skew = np.array([[0, -z, y], [z, 0, -x], [-y, x, 0]])
    return np.eye(3) + np.sin(angle) * skew + (1 - np.cos(angle)) * skew @ skew


def test_an_attitude_ephemeris_in_the_orbit_frame_has_the_saved_quaternions():
    run = run_dataset()
    run["quaternion"][60:] = np.nan  # the run failed
    found, times, quaternions = read_back(attitude_ephemeris(run, EPOCH, frame="orbit"))
    assert found.ref_frame_a == "LVLH"
    assert len(times) == 60
    saved = np.roll(run["quaternion"].values[:60], -1, axis=1)
    np.testing.assert_allclose(quaternions, saved, atol=1e-12)


def test_an_attitude_ephemeris_without_an_orbit_needs_the_orbit_frame():
    with pytest.raises(ConversionError, match="take the frame orbit"):
        attitude_ephemeris(run_dataset(), EPOCH)


@pytest.mark.parametrize(
    ("epoch", "begin", "end"),
    [
        ("2300-01-01T00:00:00", "2300-01-01T00:00:00.000000000", "2300-01-01T00:00:"),
        ("9998-12-31T23:59:59.75", "9998-12-31T23:59:59.750000000", "9999-01-01T00:00:"),
        ("1972-01-01T00:00:00", "1972-01-01T00:00:00.000000000", "1972-01-01T00:00:"),
    ],
)
def test_epochs_beyond_64_bits_of_nanoseconds(epoch, begin, end):
    text = attitude_ephemeris(run_dataset(), np.datetime64(epoch, "us"), frame="orbit")
    assert f"START_TIME = {begin}\n" in text
    assert f"STOP_TIME = {end}" in text
    first, *_ = text.partition("DATA_START\n")[2].split()
    assert first == begin


@pytest.mark.parametrize(
    ("epoch", "message"),
    [
        ("1971-12-31T23:59:59", "must lie in 1972 to 9999"),
        ("9999-12-31T23:59:59", "must lie in 1972 to 9999"),
        ("2016-12-31T23:59:58", "leap second, got that at the end of 2016-12-31"),
        ("1972-06-30T23:59:59", "leap second, got that at the end of 1972-06-30"),
    ],
)
def test_times_that_utc_cannot_tell_are_refused(epoch, message):
    with pytest.raises(ConversionError, match=message):
        attitude_ephemeris(run_dataset(), np.datetime64(epoch, "us"), frame="orbit")


def test_leap_seconds_are_no_matter_of_other_times():
    epoch = np.datetime64("2017-01-01T00:00:00", "s")
    text = attitude_ephemeris(run_dataset(), epoch, frame="orbit")
    assert "START_TIME = 2017-01-01T00:00:00" in text


def test_the_text_is_printable_ascii():
    run = run_dataset()
    run.attrs["title"] = "Größe ω²\u202e" + "x" * 200
    text = attitude_ephemeris(run, EPOCH, frame="orbit")
    assert text.isascii()
    assert "OBJECT_NAME = Grosse" in text or "OBJECT_NAME = Gro" in text
    with pytest.raises(ConversionError, match="printable ASCII"):
        attitude_ephemeris(run, EPOCH, frame="orbit", object_name="Größe")
    with pytest.raises(ConversionError, match="printable ASCII"):
        attitude_ephemeris(run, EPOCH, frame="orbit", object_id="1\nSTART")
