"""`analyse` against exact arithmetic."""

import itertools

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from jaxsat.controllability.decision import decide_rank
from jaxsat.controllability.layout import make_layout
from jaxsat.controllability.rank import analyse

from .layouts import AXES, MOMENTS, PLANES, QUATERNIONS, X, Y, columns
from .oracles import GibbsAlgebra, fraction_rank, rotated


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


@pytest.mark.slow
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
    rank = GibbsAlgebra(inertia, turned).closure_rank()
    assert rank == fraction_rank(inertia, turned)
    assert rank == analyse(np.array(inertia, float), columns(turned)).rank


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


@pytest.mark.slow
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


def test_order_sign_length_and_duplicates_of_thrusters():
    rng = np.random.default_rng(3)
    inertia = np.diag([9.0, 5.0, 7.0])
    axes = rng.normal(size=(3, 2))
    plain = analyse(inertia, axes)
    for changed in (axes[:, ::-1], -axes, axes * [1e-7, 1e5], np.c_[axes, -2 * axes, 0 * axes]):
        other = analyse(inertia, changed)
        assert other.rank == plain.rank
        assert other.margin == pytest.approx(plain.margin, rel=1e-12)


def test_verdicts_name_what_is_missing():
    assert "(0.000, 0.000, 1.000)" in analyse([5, 5, 7], columns([X, Y])).verdict
    assert "principal axis (1.000, 0.000, 0.000)" in analyse([9, 5, 7], columns([X])).verdict
    assert "no thrusters" in analyse([9, 5, 7], np.zeros((3, 0))).verdict
    assert "zero" in analyse([9, 5, 7], np.zeros((3, 2))).verdict
    assert analyse([9, 5, 7], columns([X, Y])).generators == ("g1", "g2", "[[f,g1],g2]")


@pytest.mark.slow
def test_ranks_away_from_rest():
    """Rises with motion and T_d: the rank does depend on T_d, unlike the paper's 3.4."""
    single = analyse([9.0, 5.0, 7.0], columns([X])).away_from_rest
    assert single == {
        "at rest": 2,
        "moving": 5,
        "moving, drift counted": 5,
        "at rest, disturbed": 6,
        "moving, disturbed": 6,
        "moving, disturbed, drift counted": 6,
    }
    pair = analyse([5.0, 5.0, 7.0], columns([X, Y])).away_from_rest
    assert (pair["moving"], pair["moving, disturbed"]) == (5, 5)
    assert pair["moving, disturbed, drift counted"] == 6
    # Without torque about the third axis the third rate stays constant, disturbed or not.
    flat = analyse([5.0, 5.0, 7.0], columns([X, Y]), disturbance=[0.1, 0.2, 0.0]).away_from_rest
    assert flat["moving, disturbed, drift counted"] == 5


def test_subsets_share_one_layout():
    rng = np.random.default_rng(5)
    axes = np.c_[np.eye(3), rng.normal(size=(3, 2)), [2.0, 0.0, 0.0]]
    layout = make_layout([9.0, 5.0, 7.0], axes)
    for size in range(7):
        for subset in itertools.combinations(range(6), size):
            whole = analyse([9.0, 5.0, 7.0], axes[:, list(subset)])
            part = decide_rank(layout, subset)
            assert (part.rank, part.borderline) == (whole.rank, whole.borderline)
            assert part.margin == pytest.approx(whole.margin, rel=1e-12)
