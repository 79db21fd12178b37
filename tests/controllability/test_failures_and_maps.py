"""Failure tables and margin maps against `analyse`, case by case."""

import csv
import io
import itertools
import time

import jax
import numpy as np
import pytest

from jaxsat.controllability.failures import (
    failure_arrays,
    failure_csv,
    failure_markdown,
    failure_records,
    failure_table,
)
from jaxsat.controllability.maps import (
    angle_grid,
    margins_over_angles,
    margins_over_inertias,
    physical_inertias,
    uncontrollable_single_directions,
)
from jaxsat.controllability.rank import analyse

PAPER = np.array([449.5, 264.6, 312.5])


def test_every_subset_once_and_as_analysed():
    rng = np.random.default_rng(0)
    axes = np.c_[np.eye(3), rng.normal(size=3)]
    names = ("A1", "A2", "A3", "skew")
    cases = failure_table(PAPER, axes, names=names)
    failed = {case.failed for case in cases}
    assert len(cases) == len(failed) == 16
    for case in cases:
        kept = [i for i, name in enumerate(names) if name not in case.failed]
        assert case.working == tuple(names[i] for i in kept)
        alone = analyse(PAPER, axes[:, kept])
        assert (case.judgement.rank, case.judgement.borderline) == (alone.rank, alone.borderline)
        assert case.judgement.margin == pytest.approx(alone.margin, rel=1e-12)
        assert case.directions == (np.linalg.matrix_rank(axes[:, kept]) if kept else 0)
    # Losing a thruster never raises the margin.
    for a, b in itertools.permutations(cases, 2):
        if set(a.failed) < set(b.failed):
            assert b.judgement.margin <= a.judgement.margin + 1e-12


def test_what_the_papers_failures_lose():
    cases = {case.failed: case for case in failure_table(PAPER, np.eye(3))}
    assert cases[()].lost == "nothing"
    assert cases[("g3",)].judgement.verdict == "controllable"
    assert "one axis" in cases[("g3",)].lost
    assert cases[("g2", "g3")].lost == "all but rotation about x"
    assert cases[("g1", "g2", "g3")].lost == "all control"
    symmetric = {case.failed: case for case in failure_table([5.0, 5.0, 7.0], np.eye(3))}
    assert symmetric[("g3",)].lost == "angular acceleration along torque z"
    assert symmetric[("g3",)].judgement.verdict == "uncontrollable"
    near = {case.failed: case for case in failure_table([5.0, 5.0 + 1e-8, 7.0], np.eye(3))}
    assert near[("g3",)].judgement.verdict == "borderline"


def test_exports_hold_the_same_numbers():
    cases = failure_table(PAPER, np.eye(3), names=("x", "y", "z"))
    rows = list(csv.DictReader(io.StringIO(failure_csv(cases))))
    arrays = failure_arrays(cases, ("x", "y", "z"))
    lines = failure_markdown(cases).splitlines()
    assert len(rows) == len(failure_records(cases)) == len(lines) - 2 == len(cases) == 8
    for k, (row, case) in enumerate(zip(rows, cases, strict=True)):
        assert float(row["margin"]) == case.judgement.margin == arrays["margin"][k]
        assert row["failed"].split() == (list(case.failed) or ["none"])
        assert int(row["rank"]) == arrays["rank"][k]
        assert arrays["failed"][k].sum() == len(case.failed)
    with pytest.raises(ValueError, match="at most 14"):
        failure_table(PAPER, np.ones((3, 15)))


def test_a_table_of_no_case_has_its_header_alone():
    header = failure_csv(failure_table(PAPER, np.eye(3))).splitlines()[0]
    assert failure_csv([]).splitlines() == [header]
    assert len(failure_markdown([]).splitlines()) == 2
    assert failure_arrays([], "xyz")["margin"].shape == (0,)


def test_inertia_grid_is_the_physical_triangle():
    points, moments = physical_inertias(40)
    assert len(points) == 41 * 42 // 2 - 3
    twice = 2 * moments.max(axis=1)
    assert np.all(twice <= moments.sum(axis=1) * (1 + 1e-15))
    assert np.all(moments.min(axis=1) > 0)
    plates = np.isclose(twice, moments.sum(axis=1))
    assert plates.sum() == 3 * 39
    with pytest.raises(ValueError, match="steps"):
        physical_inertias(1)


@pytest.mark.slow
def test_inertia_map_equals_analysis_and_is_zero_where_moments_agree():
    points, moments = physical_inertias(24)
    margins = np.asarray(margins_over_inertias(moments, np.eye(3)[:, :2]))
    for row, margin in zip(moments[::7], margins[::7], strict=True):
        assert margin == pytest.approx(analyse(row, np.eye(3)[:, :2]).margin, abs=1e-14)
    equal = np.isclose(moments[:, 0], moments[:, 1])
    assert np.all(margins[equal] < 1e-14)
    assert np.all(margins[~equal] > 1e-3)
    assert len(points) == len(margins)


@pytest.mark.slow
def test_angle_map_equals_analysis():
    azimuths, elevations = angle_grid(13, 7)
    inertia = np.diag(PAPER)
    single = np.asarray(margins_over_angles(inertia, azimuths, elevations))
    pair = np.asarray(margins_over_angles(inertia, azimuths, elevations, np.eye(3)[:, :1]))
    for (i, e), (j, a) in itertools.product(enumerate(elevations), enumerate(azimuths)):
        axis = np.array([np.cos(e) * np.cos(a), np.cos(e) * np.sin(a), np.sin(e)])
        alone = analyse(inertia, axis[:, None])
        assert single[i, j] == pytest.approx(alone.margin, abs=1e-13)
        both = analyse(inertia, np.stack([axis, [1.0, 0.0, 0.0]], axis=1))
        assert pair[i, j] == pytest.approx(both.margin, abs=1e-13)


@pytest.mark.slow
def test_a_hundred_thousand_points_in_seconds():
    _, moments = physical_inertias(450)
    assert len(moments) > 100_000
    axes = np.array([[1.0, 0.2], [0.1, 1.0], [0.3, -0.2]])
    jax.block_until_ready(margins_over_inertias(moments, axes))
    start = time.perf_counter()
    jax.block_until_ready(margins_over_inertias(moments[::-1], axes))
    assert time.perf_counter() - start < 5.0


@pytest.mark.slow
@pytest.mark.parametrize("moments", [(449.5, 264.6, 312.5), (5.0, 5.0, 7.0), (9.0, 6.0, 6.0)])
def test_drawn_curves_are_uncontrollable_and_their_neighbours_are_not(moments):
    rng = np.random.default_rng(2)
    q, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    inertia = q @ np.diag(moments) @ q.T
    inertia = 0.5 * (inertia + inertia.T)

    def margin(azimuth, elevation):
        c = np.cos(elevation)
        axis = [[c * np.cos(azimuth)], [c * np.sin(azimuth)], [np.sin(elevation)]]
        return analyse(inertia, np.array(axis)).margin

    curves = uncontrollable_single_directions(inertia, 25)
    assert len(curves) == 8
    for curve in curves:
        for azimuth, elevation in curve:
            assert margin(azimuth, elevation) < 1e-12
            # Off the curve in at least one direction; if two moments agree it grows slowly.
            steps = itertools.product((0.123, -0.123), (0.171, -0.171))
            assert max(margin(azimuth + a, elevation + b) for a, b in steps) > 1e-8
    assert not [c for c in uncontrollable_single_directions(np.eye(3), 25) if len(c) > 1]
