"""`analyse` close to a change of rank, and under rounding: right, or called borderline."""

import numpy as np
import pytest

from jaxsat.controllability.actuators import actuator_set
from jaxsat.controllability.judging import judge
from jaxsat.controllability.layout import TOLERANCE
from jaxsat.controllability.rank import analyse

from .layouts import AXES, PLANES, X, Y, Z, columns, random_rotation
from .oracles import fraction_rank

DEGENERATE = [
    ((5.0, 5.0, 7.0), [X, Y], 5),
    ((5.0, 5.0, 7.0), [[1, 0, 0], [1, 1, 0]], 5),
    ((5.0, 5.0, 7.0), [[1, 1, 0]], 2),
    ((5.0, 5.0, 7.0), [[1, 1, 1]], 6),
    ((4.0, 4.0, 4.0), [[1, 2, 3]], 2),
    ((4.0, 4.0, 4.0), [[1, 2, 3], [0, 1, 1]], 5),
    ((9.0, 5.0, 7.0), [X], 2),
    ((9.0, 5.0, 7.0), [], 0),
    ((9.0, 5.0, 7.0), [X, [2, 0, 0]], 2),
    ((9.0, 5.0, 7.0), [X, Y], 6),
    ((9.0, 5.0, 7.0), [[1, 2, 3]], 6),
    *((tuple(map(float, moments)), axes, 5) for moments, axes in PLANES[:4]),
]


@pytest.mark.parametrize(("moments", "axes", "expected"), DEGENERATE)
def test_rounding_by_rotation_and_scale_does_not_change_the_rank(moments, axes, expected):
    """A true rotation rounds every number; the rank to rounding stays what it was."""
    rng = np.random.default_rng(7)
    plain = analyse(np.array(moments), columns(axes))
    assert (
        plain.rank == fraction_rank(np.diag([int(m) for m in moments]).tolist(), axes) == expected
    )
    for _ in range(20):
        r = random_rotation(rng)
        lengths = 10.0 ** rng.uniform(-6, 6, size=len(axes))
        scale = 10.0 ** rng.uniform(-6, 6)
        inertia = scale * r @ np.diag(moments) @ r.T
        result = analyse(0.5 * (inertia + inertia.T), (r @ columns(axes)) * lengths)
        assert result.rank == expected
        # The largest differs where a parallel pair is no longer exactly parallel.
        np.testing.assert_allclose(
            result.singular_values[1:], plain.singular_values[1:], atol=2e-13
        )
        if expected < 6:
            assert result.margin < 1e-12


@pytest.mark.parametrize("power", range(-16, -2))
def test_nearly_equal_moments(power):
    """J1 = J2 (1 + δ): controllable for every δ that the numbers hold."""
    for size in (1e-3, 1.0, 449.5, 1e6):
        for factor in (1.0, 3.7, -2.2):
            first = size * (1.0 + factor * 10.0**power)
            result = analyse([first, size, 1.3 * size], columns([X, Y]))
            expected = 5 if first == size else 6
            assert result.exact_rank == expected
            assert result.rank == expected or result.borderline
            if expected == 6:
                difference = abs(first - size) / (first + size)
                assert result.margin == pytest.approx(difference, rel=1e-9)
                assert result.borderline == (difference <= TOLERANCE)


@pytest.mark.slow
@pytest.mark.parametrize("power", range(-15, -2))
def test_nearly_degenerate_layouts_are_right_or_borderline(power):
    rng = np.random.default_rng(100 - power)
    for moments, axes, expected in DEGENERATE:
        for _ in range(5):
            inertia = np.diag(moments)
            noise = rng.normal(size=(3, 3))
            inertia = inertia * (1 + 10.0**power * 0.1 * (noise + noise.T))
            moved = columns(axes) + 10.0**power * rng.normal(size=(3, len(axes)))
            result = analyse(inertia, moved)
            rational = [[int(v) for v in row] for row in np.ldexp(inertia, 60).tolist()]
            exact_axes = [[int(v) for v in column] for column in np.ldexp(moved, 100).T.tolist()]
            truth = fraction_rank(rational, exact_axes)
            assert result.exact_rank == truth
            assert result.rank == truth or result.borderline
            assert result.rank >= expected


def test_axis_close_to_an_uncontrollable_plane():
    moments, axes = PLANES[0]
    axes = columns(axes)
    normal = np.cross(axes[:, 0], axes[:, 1])
    normal /= np.linalg.norm(normal)
    inside = axes[:, 0] / np.linalg.norm(axes[:, 0]) + axes[:, 1] / np.linalg.norm(axes[:, 1])
    for off in (1e-3, 1e-5, 1e-8, 1e-11, 1e-14):
        result = analyse(np.array(moments, float), (inside + off * normal)[:, None])
        assert result.exact_rank == 6
        assert result.controllable or result.borderline
        assert result.borderline == (result.margin <= TOLERANCE)
        assert 1e-3 * off < result.margin < 10 * off


def test_bad_scaling():
    for moments in [(1e-3, 1.0, 1.0005), (1e-3, 1e6, 1e6), (1e6, 1e6, 1e-3), (1e-3, 1.0, 1e6)]:
        integers = [int(m * 2**80) for m in moments]
        inertia = [[integers[i] * (i == j) for j in range(3)] for i in range(3)]
        for axes in AXES.values():
            lengths = [10 ** (4 * i) for i in range(len(axes))]
            scaled = [[n * a for a in axis] for n, axis in zip(lengths, axes, strict=True)]
            result = analyse(np.array(moments), columns(scaled))
            truth = fraction_rank(inertia, scaled)
            assert result.exact_rank == truth
            assert result.rank == truth or result.borderline


def test_extreme_magnitudes():
    for scale in (1e-300, 1e-150, 1e150, 1e300):
        result = analyse(np.array([0.9, 0.5, 0.7]) * scale, columns([X, Y]) / scale)
        assert result.rank == 6
        assert result.margin == pytest.approx(0.4 / 1.4, rel=1e-14)


def test_single_precision_data_is_judged_by_its_own_rounding():
    rng = np.random.default_rng(11)
    for _ in range(20):
        r = random_rotation(rng)
        inertia = (r @ np.diag([5.0, 5.0, 7.0]) @ r.T).astype(np.float32)
        result = analyse(0.5 * (inertia + inertia.T), r[:, :2].astype(np.float32))
        assert result.rank == 5
        assert result.borderline


def test_rounding_dust_is_no_thruster():
    axes = np.array([[1.0, 0.0], [0.0, 1e-17], [0.0, 0.0]])
    result = analyse([9.0, 5.0, 7.0], axes)
    assert (result.rank, result.borderline, result.exact_rank) == (2, True, 6)
    # Also where the dust, taken at its word, would leave a borderline layout of the same rank.
    tilted = np.array([[1.0, 0.0, 1e-17], [0.0, 1.0, 1e-17], [0.0, 0.0, 1e-32]])
    result = analyse([5.0, 5.0, 7.0], tilted)
    assert (result.rank, result.borderline, result.exact_rank) == (5, True, 6)


def test_tolerance_moves_the_borderline_not_the_rank():
    for tolerance, borderline in ((TOLERANCE, False), (1e-2, True)):
        result = analyse([5.0, 5.01, 7.0], columns([X, Y]), tolerance=tolerance)
        assert result.rank == 6
        assert result.borderline is borderline
        assert result.verdict.startswith("Borderline" if borderline else "Controllable")


def test_products_that_disagree_widen_the_rounding():
    inertia = np.diag([5.0, 5.0, 7.0])
    inertia[0, 1] = 1e-8
    result = analyse(inertia, columns([X, [1, 1, 0]]))
    assert result.rank == 5
    r = random_rotation(np.random.default_rng(1))
    rounded = r @ np.diag([5.0, 5.0, 7.0]) @ r.T
    rounded[0, 2] *= 1 + 1e-8
    result = analyse(rounded, r[:, :2])
    assert (result.rank, result.borderline, result.exact_rank) == (5, True, 6)


@pytest.mark.parametrize("moments", [(1e-300, 1.0, 1.0), (1e-20, 1.0, 2.0), (1.0, 1e18, 1e18)])
def test_condition_beyond_doubles_is_borderline_at_worst(moments):
    for axes in ([X, Y], [Y, Z], [[1, 2, 3]], [X]):
        result = analyse(moments, columns(axes))
        integers = [int(m * 2.0**1020) if max(moments) < 8 else int(m) for m in moments]
        whole = [[integers[i] * (i == j) for j in range(3)] for i in range(3)]
        assert result.exact_rank == fraction_rank(whole, axes)
        assert result.borderline or result.rank == result.exact_rank
        assert np.all(np.isfinite(result.singular_values))


@pytest.mark.parametrize("degrees", [1e-5, 1e-4])
@pytest.mark.parametrize("length", [1e-3, 1.0, 4e5])
def test_torques_of_nearly_one_direction_are_borderline_whatever_their_lengths(degrees, length):
    """Six printed digits of their direction cosines may be all that sets them apart."""
    angle = np.radians(degrees)
    axes = length * np.array([[1.0, np.cos(angle)], [0.0, np.sin(angle)], [0.0, 0.0]])
    axes[:, 1] *= 0.3
    for moments in ([449.5, 264.6, 312.5], [0.05, 0.04, 0.02]):
        assert analyse(moments, axes).borderline
        judgement = judge(moments, actuator_set(axes, two_sided=True))
        assert (judgement.verdict, judgement.laws) == ("borderline", "none")
    apart = np.array([[1.0, 0.0], [1.0, 0.1], [0.0, 0.0]])
    assert judge([449.5, 264.6, 312.5], actuator_set(apart, two_sided=True)).verdict != "borderline"
