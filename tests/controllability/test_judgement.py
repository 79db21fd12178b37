"""What is said of one-signed thrusters, wheels and both, alone and in the table of failures."""

import itertools

import numpy as np
import pytest
from scipy.optimize import linprog

from jaxsat.controllability.actuators import actuator_set
from jaxsat.controllability.failures import failure_csv, failure_markdown, failure_table
from jaxsat.controllability.judging import judge
from jaxsat.controllability.rank import analyse
from jaxsat.controllability.wording import both_signs_by, verdict_sentence

PAPER = [449.5, 264.6, 312.5]
X, Y, Z = np.eye(3)
TURNING_ABOUT_Z = np.array([[1, 0, 1], [-1, 0, 1], [0, 1, 1], [0, -1, 1]], float).T
SIX = np.concatenate([np.eye(3), -np.eye(3)], axis=1)


def thrusters(*columns, **options):
    return actuator_set(np.array(columns, float).reshape(-1, 3).T, **options)


def wheels(*axes, momentum=(0.0, 0.0, 0.0), **options):
    return actuator_set(
        wheel_axes=np.array(axes, float).T.reshape(3, -1), momentum=momentum, **options
    )


def test_four_thrusters_that_all_turn_about_z_lose_something():
    [case] = failure_table(PAPER, actuator_set(TURNING_ABOUT_Z), most_failed=0)
    assert case.lost == "torque along -z; reached through the drift, by no law"
    judgement = case.judgement
    assert (judgement.rank, judgement.verdict, case.directions) == (6, "by drift", 0)
    assert judgement.laws == "none"
    sentence = verdict_sentence(judgement)
    assert "none towards -z" in sentence
    assert "No law of jaxsat" in sentence
    # About the axis of largest moment the drift does not bring it back, although the rank is 6.
    other = judge([264.6, 312.5, 449.5], actuator_set(TURNING_ABOUT_Z))
    assert (other.rank, other.verdict) == (6, "uncontrollable")
    assert "half space m·Jω ≥ 0" in verdict_sentence(other)


@pytest.mark.parametrize(
    ("actuators", "verdict", "laws", "said"),
    [
        (actuator_set(SIX), "controllable", "three torques", "rank 6 of 6"),
        (thrusters(X, -X, Y, -Y), "controllable", "two torques", "rank 6 of 6"),
        (thrusters(X, -X, Y, -Y, Z), "controllable", "two torques", "towards +z alone"),
        (thrusters(X, Y, Z), "uncontrollable", "none", "(-0.577, -0.577, -0.577)"),
        (thrusters(Z, Z), "uncontrollable", "none", "none towards -z"),
        (thrusters(X + Y + Z, two_sided=True), "by drift", "none", "No law"),
        (thrusters(X + Y + Z), "uncontrollable", "none", "although the rank is 6"),
        (thrusters(), "uncontrollable", "none", "no thrusters"),
        (wheels(X, Y, Z), "controllable", "three torques", "three independent wheel axes"),
        (wheels(X, Y), "controllable", "two wheels", "rank 5 of 5"),
        (wheels(X, Y, momentum=Z), "some attitudes", "nearest attitude", "normal to n = z"),
        (wheels(X, Y, momentum=Z, target_turns=True), "some attitudes", "none", "normal to n = z"),
        (wheels(X), "uncontrollable", "none", "about +x alone"),
        (wheels(X, momentum=Z), "uncontrollable", "none", "along the wheel axis"),
        (
            thrusters(X + Y + Z, wheel_axes=np.array([X, Y]).T),
            "controllable",
            "two wheels",
            "two wheels",
        ),
        (
            thrusters(Z, -Z, wheel_axes=np.array([X, Y]).T, two_sided=False),
            "controllable",
            "three torques",
            "two wheels",
        ),
        (thrusters(Y, -Y, wheel_axes=X[:, None]), "by drift", "none", "rank 6 of 6 with one wheel"),
        (
            thrusters(X, -X, Y, -Y, wheel_axes=X[:, None]),
            "controllable",
            "two torques",
            "one wheel",
        ),
        (
            thrusters(Y, -Y, Z, -Z, wheel_axes=X[:, None]),
            "controllable",
            "three torques",
            "one wheel",
        ),
        (thrusters(X, -X, Y, -Y, wheel_axes=np.zeros((3, 1))), "controllable", "two torques", "6"),
        (thrusters(X, wheel_axes=X[:, None]), "uncontrollable", "none", "rank 2 of 6"),
        (thrusters(X + Y + Z, wheel_axes=X[:, None]), "by drift", "none", "one wheel"),
        (thrusters(X, -X + 1e-8 * Y, Y, -Y, Z), "controllable", "two torques", "+z alone"),
        (thrusters(X, -X, Y, -Y + 1e-8 * Z), "borderline", "two torques", "Borderline"),
    ],
)
def test_verdicts_in_words(actuators, verdict, laws, said):
    found = judge(PAPER, actuators)
    assert (found.verdict, found.laws) == (verdict, laws)
    assert said in verdict_sentence(found)


def test_two_signs_in_a_plane_that_brackets_do_not_leave_are_no_control():
    half = thrusters(X, -X, Y, -Y, Z)
    assert judge([5.0, 5.0, 7.0], half).verdict == "uncontrollable"
    assert judge([5.0, 5.0, 7.0], half).barrier == pytest.approx(Z)
    assert judge([5.0, 4.0, 7.0], half).verdict == "controllable"


def test_a_wheel_makes_no_momentum_so_its_brackets_are_its_own():
    # With J1 = J2 two thrusters never leave the plane; a wheel in place of one does.
    pair = thrusters(X, -X, Y, -Y)
    mixed = thrusters(Y, -Y, wheel_axes=X[:, None])
    assert (judge([5.0, 5.0, 7.0], pair).rank, judge([5.0, 5.0, 7.0], mixed).rank) == (5, 6)
    assert judge([5.0, 5.0, 7.0], mixed).verdict == "by drift"
    # The other way round: one general thruster has rank 6, a wheel along it only turns about J⁻¹a.
    axis = X + 2 * Y + 3 * Z
    assert judge(PAPER, thrusters(axis, two_sided=True)).rank == 6
    assert judge(PAPER, wheels(axis)).rank == 2


def test_torques_of_both_signs_are_judged_as_before():
    rng = np.random.default_rng(3)
    for count in (0, 1, 2, 3, 4):
        axes = rng.integers(-2, 3, size=(3, count)).astype(float)
        found = judge(PAPER, actuator_set(axes, two_sided=True))
        alone = analyse(PAPER, axes)
        assert (found.rank, found.margin, found.turn_time) == (
            alone.rank,
            alone.margin,
            alone.turn_time,
        )
        assert found.controllable == alone.controllable
        # One-signed pairs are the same torques.
        pairs = judge(PAPER, actuator_set(np.concatenate([axes, -axes], axis=1)))
        assert (pairs.verdict, pairs.laws) == (found.verdict, found.laws)


def test_no_actuator_lost_is_ever_a_gain():
    rng = np.random.default_rng(5)
    actuators = actuator_set(
        np.concatenate([TURNING_ABOUT_Z, rng.normal(size=(3, 1))], axis=1),
        wheel_axes=np.array([X]).T,
    )
    order = ("uncontrollable", "not decided", "by drift", "controllable")
    cases = failure_table(PAPER, actuators)
    assert len({case.failed for case in cases}) == 64
    for a, b in itertools.permutations(cases, 2):
        if set(a.failed) < set(b.failed) and ("w1" in a.failed) == ("w1" in b.failed):
            assert order.index(b.judgement.verdict) <= order.index(a.judgement.verdict)
            assert b.directions <= a.directions


def test_single_and_double_failures_of_many():
    rng = np.random.default_rng(6)
    many = actuator_set(rng.normal(size=(3, 12)), wheel_axes=np.eye(3), momentum=[0, 0, 0.1])
    cases = failure_table(PAPER, many, most_failed=2)
    assert len(cases) == 1 + 15 + 15 * 14 // 2
    assert {case.judgement.verdict for case in cases} == {"controllable"}
    with pytest.raises(ValueError, match="at most 14"):
        failure_table(PAPER, many)


def test_who_makes_torques_of_both_signs_is_what_linear_programmes_say():
    """Of two wheels and four thrusters, after every failure: either, one kind, or both together."""
    jets = np.array([[1, -1, 0, 0], [0, 0, 0, 0], [0, 0, 1, -1]], float)
    mixed = actuator_set(jets, wheel_axes=np.eye(3)[:, :2])
    seen = set()
    for case in failure_table(PAPER, mixed):
        kept = [mixed.names.index(name) for name in case.working]
        left = mixed.only(kept)
        columns = {
            "thrusters": left.torques,
            "wheels": np.concatenate([left.wheel_axes, -left.wheel_axes], axis=1),
        }
        ways = case.judgement.cone.both_signs.T
        ways = [*ways, *-ways]
        alone = [kind for kind, one in columns.items() if all(reachable(one, way) for way in ways)]
        expected = " or ".join(alone) or " and ".join(columns) if ways else ""
        assert both_signs_by(case.judgement) == expected, case.failed
        seen.add(expected)
    assert seen == {"", "thrusters", "wheels", "thrusters or wheels", "thrusters and wheels"}


def reachable(columns, torque):
    """Whether columns with weights of at least zero add up to a torque."""
    if not columns.size:
        return False
    return linprog(np.zeros(columns.shape[1]), A_eq=columns, b_eq=torque).status == 0


def test_exports_of_wheels_have_their_own_dimension():
    cases = failure_table(PAPER, wheels(X, Y, Z, momentum=[0, 0, 0.3]))
    assert [case.judgement.dimension for case in cases] == [6, 5, 5, 5, 4, 4, 4, 6]
    assert [case.judgement.verdict for case in cases[:5]] == [
        "controllable",
        *["some attitudes"] * 3,
        "uncontrollable",
    ]
    assert "some attitudes" in failure_markdown(cases)
    assert failure_csv(cases).splitlines()[2].startswith("w1,w2 w3,5,5,some attitudes,1.0,nan,2,")


@pytest.mark.parametrize(
    ("options", "message"),
    [
        ({"torques": np.eye(2)}, "shape"),
        ({"torques": np.full((3, 1), np.nan)}, "finite"),
        ({"torques": np.eye(3), "forces": np.ones((3, 2))}, "forces"),
        ({"torques": np.eye(3), "names": ["a", "b"]}, "hold 3 names"),
        ({"torques": np.eye(3), "names": ["a", "b", "b"]}, "different names"),
        ({"wheel_axes": np.eye(3), "momentum": [1.0]}, "momentum"),
    ],
)
def test_bad_actuators_are_refused(options, message):
    with pytest.raises(ValueError, match=message):
        actuator_set(**options)
