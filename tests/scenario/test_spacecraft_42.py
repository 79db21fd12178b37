"""Spacecraft files of 42 as scenarios, against what 42 makes of the same numbers."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from jaxsat.scenario import read
from jaxsat.scenario.spacecraft_42 import SpacecraftFileError, scenario_of_42
from jaxsat.synthesis.controller_design.request import read_vehicle

FILE = """\
<<<<<<<<<<<<<<<<<  42: Spacecraft Description File   >>>>>>>>>>>>>>>>>
Test "craft"                !  Description
"S/C"                       !  Label
************************* Orbit Parameters ****************************
FIXED                       !  Orbit Prop FIXED, EULER_HILL, ENCKE, or COWELL
*************************** Initial Attitude ***************************
NAL                         ! Ang Vel wrt [NL], Att [QA] wrt [NLEF]
0.3    0.4    0.5           ! Ang Vel (deg/sec)
0.5   -0.5    0.5    0.5    ! Quaternion
20.0    30.0    40.0    213    ! Angles (deg) & Euler Sequence
***************************  Dynamics Flags  ***************************
REFPT_CM                    ! Mass Props referenced to REFPT_CM or REFPT_JOINT
2.0                         ! Drag Coefficient
************************************************************************
************************* Body Parameters ******************************
************************************************************************
1                           ! Number of Bodies
================================ Body 0 ================================
10.0                        ! Mass
4.0  3.0  5.0               ! Moments of Inertia (kg-m^2)
0.1  -0.2  0.3              ! Products of Inertia (xy,xz,yz)
0.1  0.0  0.2               ! Location of mass center, m
0.0  0.0  0.0               ! Constant Embedded Momentum (Nms)
0.0  0.1  0.0               ! Constant Embedded Magnetic Dipole (A-m^2)
Craft.obj                   ! Geometry Input File Name
Nodes.txt                   ! Node File Name
NONE                        ! Flex File Name
************************************************************************
*************************** Joint Parameters ***************************
************************************************************************
         (Number of Joints is Number of Bodies minus one)
============================== Joint 0 ================================
PASSIVE                     ! Type of joint (PASSIVE, ACTUATED, others)
*************************** Wheel Parameters ***************************
FALSE                       ! Wheel Drag Active
1                           ! Number of wheels
=============================  Wheel 0  ================================
0.5                         ! Initial Momentum, N-m-sec
1.0   0.0   1.0             ! Wheel Axis Components, [X, Y, Z]
0.14   50.0                 ! Max Torque (N-m), Momentum (N-m-sec)
0.012                       ! Wheel Rotor Inertia, kg-m^2
0                           ! Body
0                           ! Node
**************************** MTB Parameters ****************************
1                           ! Number of MTBs
==============================  MTB 0  =================================
180.0                       ! Saturation (A-m^2)
0.0   1.0   0.0             ! MTB Axis Components, [X, Y, Z]
0                           ! Node
************************* Thruster Parameters **************************
1                           ! Number of Thrusters
==============================  Thr 0  =================================
PROPORTIONAL                ! Mode (PULSED or PROPORTIONAL)
 2.0                        ! Thrust Force (N)
-1.0  0.0  0.0              ! Thrust Axis
0                           ! Body
1                           ! Node
==============================  Thr 1  =================================
PULSED                      ! Mode (PULSED or PROPORTIONAL)
******************************* Gyro ************************************
3                           ! Number of Gyro Axes
============================== Axis 0 ===================================
============================== Axis 1 ===================================
============================== Axis 2 ===================================
"""
NODES = """\
<<<<<<<<<<<<<<<<  Body Node Inputs for 42  >>>>>>>>>>>>>>>>>>>>>
Simple Nodes                    ! Description
2                               ! Number of Nodes
******************* Node Location, Comment *********************
-1.0  0.0  2.5        "Wheels"
 0.1 -1.0  1.2        "Thrusters"
"""
WHOLE = """
[orbit]
altitude_km = 500
[initial]
quaternion = [1, 0, 0, 0]
omega_rad_s = [0, 0, 0]
[control]
law = "quaternion-feedback"
period_s = 0.5
natural_frequency_rad_s = 0.1
[simulation]
duration_s = 10.0
"""


def converted(text=FILE, nodes=NODES):
    def read_beside(name):
        assert name == "Nodes.txt"
        return nodes

    return scenario_of_42(text, read_beside)


@pytest.fixture
def checked(tmp_path):
    """The scenario of a text, checked without a law; one wheel and one thruster suit none."""

    def check(text, whole=WHOLE):
        path = tmp_path / "craft.toml"
        path.write_text(text + whole)
        return read(path, law=False)

    return check


def test_a_vehicle_has_what_42_makes_of_the_file(checked):
    """42 negates products of inertia, pushes along the axis of a thruster at its node from the
    body's origin, and has its torque about the centre of mass."""
    scenario = checked(converted().text)
    assert scenario.title == 'Test "craft"'
    inertia = [[4.0, -0.1, 0.2], [-0.1, 3.0, -0.3], [0.2, -0.3, 5.0]]
    np.testing.assert_array_equal(scenario.spacecraft.inertia_kg_m2, inertia)
    (wheel,), (rod,), (thruster,) = scenario.wheel, scenario.magnetorquer, scenario.thruster
    assert (wheel.torque_limit_N_m, wheel.momentum_limit_N_m_s) == (0.14, 50.0)
    assert (wheel.momentum_N_m_s, wheel.axis) == (0.5, (1.0, 0.0, 1.0))
    assert (rod.dipole_limit_A_m2, rod.axis) == (180.0, (0.0, 1.0, 0.0))
    torque = np.cross([0.0, -1.0, 1.0], [-2.0, 0.0, 0.0])
    np.testing.assert_allclose(thruster.torque(), torque, atol=1e-15)
    assert scenario.modulation.kind == "ideal"


def test_what_is_left_out_is_told_with_keys_to_copy():
    text, left_out = converted()
    assert [f"# Not in this file: {line}" for line in left_out] == text.splitlines()[
        : len(left_out)
    ]
    said = "\n".join(left_out)
    for part in (
        "mass 10.0 kg",
        "residual_dipole_A_m2 = [0.0, 0.1, 0.0]",
        "Craft.obj",
        "3 of Gyro",
    ):
        assert part in said
    assert '[initial] euler_deg = [20.0, 30.0, 40.0], euler_sequence = "yxz"' in left_out
    assert "[initial] omega_deg_s = [0.3, 0.4, 0.5]" in left_out
    (line,) = [one for one in converted(FILE.replace("NAL ", "LQL ")).left_out if "quater" in one]
    assert line == "[initial] quaternion = [0.5, 0.5, -0.5, 0.5]"
    inertial = "\n".join(converted(FILE.replace("NAL ", "LAN ")).left_out)
    assert "[initial]" not in inertial
    assert "the attitude at the start, which is not relative to the orbit frame" in inertial


def test_euler_angles_are_turned_as_42_turns_them(checked):
    """Its direction cosines of the sequence 213 are C3(a3) C1(a2) C2(a1)."""
    one, two, three = np.radians([20.0, 30.0, 40.0])
    (c1, s1), (c2, s2), (c3, s3) = ((np.cos(a), np.sin(a)) for a in (one, two, three))
    about_y = np.array([[c1, 0, -s1], [0, 1, 0], [s1, 0, c1]])
    about_x = np.array([[1, 0, 0], [0, c2, s2], [0, -s2, c2]])
    about_z = np.array([[c3, s3, 0], [-s3, c3, 0], [0, 0, 1]])
    angles = 'euler_deg = [20.0, 30.0, 40.0]\neuler_sequence = "yxz"'
    whole = WHOLE.replace("quaternion = [1, 0, 0, 0]", angles)
    quaternion = checked(converted().text, whole).initial.quaternion
    matrix = Rotation.from_quat(quaternion, scalar_first=True).as_matrix().T
    np.testing.assert_allclose(matrix, about_z @ about_x @ about_y, atol=1e-15)


def test_inertia_about_a_joint_becomes_that_about_the_centre_of_mass(checked):
    text = converted(FILE.replace("REFPT_CM   ", "REFPT_JOINT")).text
    moved = np.array(checked(text).spacecraft.inertia_kg_m2)
    r = np.array([0.1, 0.0, 0.2])
    steiner = 10.0 * np.array([[r @ r - r[0] ** 2, 0, -r[0] * r[2]], [0, r @ r, 0],
                               [-r[0] * r[2], 0, r @ r - r[2] ** 2]])  # fmt: skip
    inertia = [[4.0, -0.1, 0.2], [-0.1, 3.0, -0.3], [0.2, -0.3, 5.0]]
    np.testing.assert_allclose(moved + steiner, inertia, atol=1e-15)


def test_files_of_older_versions_tell_where_a_thruster_is(checked):
    older = FILE.replace("PROPORTIONAL                ! Mode (PULSED or PROPORTIONAL)\n", "")
    older = older.replace(
        "-1.0  0.0  0.0              ! Thrust Axis\n",
        "-1.0  0.0  0.0              ! Thrust Axis\n 1.0  1.0  1.0    ! Location in B0, m\n",
    )
    older = older.replace("Nodes.txt                   ! Node File Name\n", "")
    torque = np.cross([0.9, 1.0, 0.8], [-2.0, 0.0, 0.0])
    (thruster,) = checked(converted(older).text).thruster
    np.testing.assert_allclose(thruster.torque(), torque, atol=1e-15)


@pytest.mark.parametrize(
    ("old", "new", "message"),
    [
        ("42: Spacecraft", "43: Spacecraft", "must begin with"),
        ("1                           ! Number of Bodies", "2 ! Number of Bodies", "got 1"),
        ("Body Parameters", "Other", "must have a section Body Parameters, got none"),
        ("180.0        ", "much", "line 47: must have a number, got much"),
        ("4.0  3.0  5.0", "4.0  3.0    ", "line 20: must have 3 numbers, got 4.0 3.0"),
        ("Moments of", "Moment of", 'must have a line "! Moments of Inertia" in Body 0, got none'),
        ("1                           ! Node\n===", "7 ! Node\n===", "a node from 0 to 1 in Thr 0"),
        ("Nodes.txt", "NONE     ", "must have a node file for node 1 of Thr 0"),
        ("1                           ! Number of wh", "x ! Number of wh", "a number, got x"),
    ],
)
def test_mistakes_are_told(old, new, message):
    assert FILE.count(old) == 1
    with pytest.raises(SpacecraftFileError) as caught:
        converted(FILE.replace(old, new))
    assert message in str(caught.value)


def test_several_bodies_are_refused():
    two = FILE.replace("1                           ! Number of Bodies", "2 ! Number of Bodies")
    body = two[two.index("======") :]
    body = body[: body.index("****")]
    with pytest.raises(SpacecraftFileError, match="one rigid body, got 2 with joints"):
        converted(two.replace(body, body + body))


def test_a_vehicle_needs_no_more(tmp_path):
    """Without magnetorquers, which need an orbit, what was converted is checked as it is."""
    path = tmp_path / "craft.toml"
    rods = "1                           ! Number of MTBs"
    path.write_text(converted(FILE.replace(rods, "0 ! Number of MTBs")).text)
    assert read_vehicle(path).scenario.wheel[0].torque_limit_N_m == 0.14
