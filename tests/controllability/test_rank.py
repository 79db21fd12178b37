"""`analyse` against exact arithmetic: right, or called borderline."""

import itertools
import math

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxsat.controllability import analyse
from jaxsat.controllability.decision import decide
from jaxsat.controllability.layout import make_layout

from .oracles import GibbsAlgebra, fraction_rank, rotated

X, Y, Z = [1, 0, 0], [0, 1, 0], [0, 0, 1]

MOMENTS = {
    "general": (9, 5, 7),
    "J1 = J2": (5, 5, 7),
    "J2 = J3": (9, 6, 6),
    "sphere": (4, 4, 4),
    "flat plate": (3, 4, 7),
    "rod": (1, 500, 500),
    "nearly a rod": (1, 500, 501),
}
AXES = {
    "none": [],
    "dead": [[0, 0, 0]],
    "x": [X],
    "z": [Z],
    "principal plane": [[2, 3, 0]],
    "general axis": [[1, 2, 3]],
    "x and y": [X, Y],
    "y and z": [Y, Z],
    "x and xz": [X, [1, 0, 1]],
    "two general": [[1, 2, 3], [3, -1, 2]],
    "parallel pair": [[1, 2, 3], [-2, -4, -6]],
    "with a dead one": [X, [0, 0, 0], [0, 3, 0]],
    "coplanar three": [X, Y, [1, 1, 0]],
    "three": [X, Y, Z],
    "three general": [[1, 2, 3], [3, -1, 2], [1, 1, 1]],
}
QUATERNIONS = [(1, 0, 0, 0), (1, 1, 1, 1), (1, 2, 0, 0), (3, 1, -2, 4)]


def columns(axes):
    return np.array(axes, dtype=float).reshape(-1, 3).T


def invariant_planes():
    """Torque pairs spanning the plane closed under ⟨:⟩ of a general body: a separatrix plane.

    ω·n = 0 is invariant for the free body when n = (√(J1(J1−J2)), 0, ±√(J3(J2−J3))), J1 > J2 > J3;
    the moments are chosen so that the roots are integers.
    """
    found = []
    for moments in itertools.product(range(1, 30), repeat=3):
        j1, j2, j3 = moments
        if j1 > j2 > j3 and j1 <= j2 + j3:
            a, b = j1 * (j1 - j2), j3 * (j2 - j3)
            if math.isqrt(a) ** 2 == a and math.isqrt(b) ** 2 == b:
                n = (math.isqrt(a), 0, math.isqrt(b))
                # Torques J x for x in the plane.
                found.append((moments, [[0, j2, 0], [j1 * n[2], 0, -j3 * n[0]]]))
    return found


PLANES = invariant_planes()


@pytest.mark.parametrize("axes", AXES.values(), ids=AXES.keys())
@pytest.mark.parametrize("moments", MOMENTS.values(), ids=MOMENTS.keys())
def test_families_exactly(moments, axes):
    quaternions = itertools.cycle(QUATERNIONS)
    for order, quaternion in zip(itertools.permutations(range(3)), quaternions, strict=False):
        shuffled = tuple(moments[i] for i in order)
        inertia, turned = rotated(shuffled, axes, quaternion)
        expected = fraction_rank(inertia, turned)
        result = analyse(np.array(inertia, float), columns(turned))
        assert result.rank == result.exact_rank == expected, (shuffled, quaternion)
        assert not result.borderline
        assert result.controllable == (expected == 6)
        assert (result.margin > 0) == (expected == 6)
        assert expected in (0, 2, 5, 6)


def test_separatrix_planes_exactly():
    assert len(PLANES) > 5
    for moments, axes in PLANES:
        for quaternion in QUATERNIONS:
            inertia, turned = rotated(moments, axes, quaternion)
            # Any two torques of the plane, and one of them alone.
            mixed = [[2 * a + 5 * b for a, b in zip(*turned, strict=True)], turned[1]]
            for layout in (turned, mixed):
                assert fraction_rank(inertia, layout) == 5
                result = analyse(np.array(inertia, float), columns(layout))
                assert (result.rank, result.borderline) == (5, False)
            # One general torque of the plane generates it and no more.
            assert fraction_rank(inertia, mixed[:1]) == 5
            single = analyse(np.array(inertia, float), columns(mixed[:1]))
            assert (single.rank, single.borderline, single.growth) == (5, False, (1, 2, 2))


@pytest.mark.parametrize("axes", AXES.values(), ids=AXES.keys())
@pytest.mark.parametrize("moments", [(9, 5, 7), (5, 5, 7), (4, 4, 4)], ids=str)
def test_lie_brackets_in_local_coordinates_agree(moments, axes):
    inertia, turned = rotated(moments, axes, (1, 2, 0, 1))
    algebra = GibbsAlgebra(inertia, turned)
    assert algebra.closure_rank() == fraction_rank(inertia, turned)
    assert analyse(np.array(inertia, float), columns(turned)).rank == algebra.closure_rank()


def test_separatrix_plane_in_local_coordinates():
    for moments, axes in PLANES[:3]:
        inertia = [[moments[i] * (i == j) for j in range(3)] for i in range(3)]
        assert GibbsAlgebra(inertia, axes).closure_rank() == 5


def test_rank_by_depth_can_stall_and_then_grow():
    inertia = [[5, 0, 0], [0, 5, 0], [0, 0, 7]]
    assert GibbsAlgebra(inertia, [X, Y]).depth_ranks(6) == [2, 4, 4, 5, 5, 5]
    result = analyse([5.0, 5.0, 7.0], columns([X, Y]))
    assert (result.rank, result.growth) == (5, (2, 2))


small = st.integers(-4, 4)
vector = st.tuples(small, small, small).map(list)
moment = st.integers(1, 6)


@given(
    moments=st.tuples(moment, moment, moment),
    axes=st.lists(vector, max_size=4),
    quaternion=st.tuples(small, small, small, small).filter(any),
)
@settings(max_examples=300, deadline=None)
def test_random_integer_layouts_exactly(moments, axes, quaternion):
    inertia, turned = rotated(moments, axes, quaternion)
    result = analyse(np.array(inertia, float), columns(turned))
    assert result.exact_rank == fraction_rank(inertia, turned)
    if not result.borderline:
        assert result.rank == result.exact_rank


def random_rotation(rng):
    q, r = np.linalg.qr(rng.normal(size=(3, 3)))
    q = q * np.sign(np.diag(r))
    return q * np.linalg.det(q)


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
                assert result.borderline == (difference <= 1e-6)


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
        assert result.borderline == (result.margin <= 1e-6)
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


def test_order_sign_length_and_duplicates_of_thrusters():
    rng = np.random.default_rng(3)
    inertia = np.diag([9.0, 5.0, 7.0])
    axes = rng.normal(size=(3, 2))
    plain = analyse(inertia, axes)
    for changed in (axes[:, ::-1], -axes, axes * [1e-7, 1e5], np.c_[axes, -2 * axes, 0 * axes]):
        other = analyse(inertia, changed)
        assert other.rank == plain.rank
        assert other.margin == pytest.approx(plain.margin, rel=1e-12)


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
    for tolerance, borderline in ((1e-6, False), (1e-2, True)):
        result = analyse([5.0, 5.01, 7.0], columns([X, Y]), tolerance=tolerance)
        assert result.rank == 6
        assert result.borderline is borderline
        assert result.verdict.startswith("Borderline" if borderline else "Controllable")


def test_verdicts_name_what_is_missing():
    assert "(0.000, 0.000, 1.000)" in analyse([5, 5, 7], columns([X, Y])).verdict
    assert "principal axis (1.000, 0.000, 0.000)" in analyse([9, 5, 7], columns([X])).verdict
    assert "no thrusters" in analyse([9, 5, 7], np.zeros((3, 0))).verdict
    assert "zero" in analyse([9, 5, 7], np.zeros((3, 2))).verdict
    assert analyse([9, 5, 7], columns([X, Y])).generators == ("g1", "g2", "[[f,g1],g2]")


def test_ranks_away_from_rest():
    """Rises with motion and T_d: the rank does depend on T_d, unlike the paper's 3.4."""
    single = analyse([9.0, 5.0, 7.0], columns([X])).elsewhere
    assert single == {
        "at rest": 2,
        "moving": 5,
        "moving, drift counted": 5,
        "at rest, disturbed": 6,
        "moving, disturbed": 6,
        "moving, disturbed, drift counted": 6,
    }
    pair = analyse([5.0, 5.0, 7.0], columns([X, Y])).elsewhere
    assert (pair["moving"], pair["moving, disturbed"]) == (5, 5)
    assert pair["moving, disturbed, drift counted"] == 6
    # Without torque about the third axis the third rate stays constant, disturbed or not.
    flat = analyse([5.0, 5.0, 7.0], columns([X, Y]), disturbance=[0.1, 0.2, 0.0]).elsewhere
    assert flat["moving, disturbed, drift counted"] == 5


def test_subsets_share_one_layout():
    rng = np.random.default_rng(5)
    axes = np.c_[np.eye(3), rng.normal(size=(3, 2)), [2.0, 0.0, 0.0]]
    layout = make_layout([9.0, 5.0, 7.0], axes)
    for size in range(7):
        for subset in itertools.combinations(range(6), size):
            whole = analyse([9.0, 5.0, 7.0], axes[:, list(subset)])
            part = decide(layout, subset)
            assert (part.rank, part.borderline) == (whole.rank, whole.borderline)
            assert part.margin == pytest.approx(whole.margin, rel=1e-12)


@pytest.mark.parametrize(
    ("inertia", "axes", "message"),
    [
        ([1.0, 2.0], np.eye(3), "shape"),
        ([1.0, 2.0, -3.0], np.eye(3), "positive definite"),
        (np.ones((3, 3)), np.eye(3), "positive definite"),
        ([[1, 0.5, 0], [0, 1, 0], [0, 0, 1]], np.eye(3), "symmetric"),
        ([1.0, 2.0, np.nan], np.eye(3), "finite"),
        ([1.0, 2.0, 2.5], np.eye(3)[:2], "shape"),
        ([1.0, 2.0, 2.5], [1.0, 0.0, 0.0], "shape"),
        ([1.0, 2.0, 2.5], np.full((3, 1), np.inf), "finite"),
    ],
)
def test_bad_arguments_are_refused(inertia, axes, message):
    with pytest.raises(ValueError, match=message):
        analyse(inertia, axes)


def test_bad_options_are_refused():
    with pytest.raises(ValueError, match="tolerance"):
        analyse([1, 2, 2.5], np.eye(3), tolerance=0.0)
    with pytest.raises(ValueError, match="disturbance"):
        analyse([1, 2, 2.5], np.eye(3), disturbance=[0.0, 0.0, 0.0])
    with pytest.raises(ValueError, match="labels"):
        analyse([1, 2, 2.5], np.eye(3), labels=("a",))
    with pytest.raises(TypeError, match="real numbers"):
        analyse([1, 2, 2.5], np.eye(3) * 1j)


def test_unphysical_moments_are_flagged_not_refused():
    assert not analyse([1.0, 2.0, 9.0], np.eye(3)).physical
    assert analyse([3.0, 4.0, 7.0], np.eye(3)).physical


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


def test_arrays_of_jax_and_small_floats_are_accepted():
    for dtype in (jnp.float64, jnp.float32, jnp.bfloat16):
        result = analyse(jnp.asarray([9, 5, 7], dtype), jnp.eye(3, dtype=dtype)[:, :2])
        assert (result.exact_rank, result.margin > 0.2) == (6, True)
        assert result.rank == 6 or (result.borderline and dtype == jnp.bfloat16)
        assert result.rounding >= 128 * float(jnp.finfo(dtype).eps)
    with pytest.raises(jax.errors.TracerArrayConversionError):
        jax.jit(lambda axes: analyse([9, 5, 7], axes).rank)(jnp.eye(3))


def test_tuples_lists_and_integers_are_accepted():
    for make in (tuple, list, np.array):
        result = analyse(
            make([9, 5, 7]), make([(1, 0), (0, 1), (0, 0)]), orbit_rate=0, labels=["a", "b"]
        )
        assert result.generators == ("a", "b", "[[f,a],b]")


@pytest.mark.parametrize("moments", [(1e-300, 1.0, 1.0), (1e-20, 1.0, 2.0), (1.0, 1e18, 1e18)])
def test_condition_beyond_doubles_is_borderline_at_worst(moments):
    for axes in ([X, Y], [Y, Z], [[1, 2, 3]], [X]):
        result = analyse(moments, columns(axes))
        integers = [int(m * 2.0**1020) if max(moments) < 8 else int(m) for m in moments]
        whole = [[integers[i] * (i == j) for j in range(3)] for i in range(3)]
        assert result.exact_rank == fraction_rank(whole, axes)
        assert result.borderline or result.rank == result.exact_rank
        assert np.all(np.isfinite(result.singular_values))
