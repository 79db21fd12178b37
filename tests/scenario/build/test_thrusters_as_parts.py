"""`[[thruster]]`, `[modulation]` and `[[failure]]`: built, flown, dispersed, and their mistakes."""

import jax
import numpy as np
import pytest

from jaxsat.core.declaration.failures import FailureKind
from jaxsat.scenario import ScenarioError, dump
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.spacecraft.modulation import IdealThrottle
from jaxsat.spacecraft.pulsed_thrusters import PulsedThrusters
from jaxsat.studies.ensemble import Study

HEAD = """\
title = "Test"
[spacecraft]
inertia_kg_m2 = [449.5, 264.6, 312.5]
"""
IDEAL = "thruster_torque_axes = [[1, 0, 0], [0, 1, 0]]\ntorque_limit_N_m = 5\n"
PAIRS = """\
[[thruster]]
position_m = [0, 0, 2]
direction = [0, -3, 0]
force_N = 2.5
two_sided = true
specific_impulse_s = 220
[[thruster]]
name = "pitch"
torque_axis = [0, 2, 0]
torque_N_m = 5
two_sided = true
"""
REST = """\
[orbit]
rate_rad_s = 0.0011
[initial]
w = [-1.0, 1.0]
z_rad = 1.27
omega_rad_s = [0.1, -0.11, 0.0]
[control]
law = "three-slew"
[simulation]
duration_s = 20
save_every_s = 0.5
"""
FAILURE = """\
[[failure]]
of = "thruster pitch"
at_s = 8.05
kind = "stuck-on"
"""


def written(tmp_path, *parts):
    file = tmp_path / "scenario.toml"
    file.write_text("".join(parts), encoding="utf-8")
    return file


def pushing(tmp_path, more="", kind="ideal"):
    return load(written(tmp_path, HEAD, PAIRS, f'[modulation]\nkind = "{kind}"\n', more, REST))


@pytest.mark.slow
def test_pairs_of_throttled_thrusters_are_the_ideal_torques(tmp_path):
    made = build(pushing(tmp_path)).simulate()
    ideal = build(load(written(tmp_path, HEAD, IDEAL, REST), ["simulation.solver.substeps=1"]))
    expected = ideal.simulate()
    np.testing.assert_allclose(made.signals.omega, expected.signals.omega, atol=1e-10)
    np.testing.assert_allclose(made.signals.torque, expected.signals.torque, atol=1e-8)
    level = np.asarray(made.signals.parts["thrust_level"])
    assert level.shape[1] == 4  # each pair is two nozzles
    used = level[:-1, :2].sum() * 0  # only the first pair tells a specific impulse
    flow = 2.5 / (220 * 9.80665)
    assert used < made.signals.parts["propellant"][-1] <= 20.1 * 2 * flow


def test_a_file_with_thrusters_reads_back(tmp_path):
    scenario = pushing(tmp_path, FAILURE)
    again = load(written(tmp_path, dump(scenario)))
    assert again == scenario


@pytest.mark.slow
def test_a_failure_is_an_event_of_the_run(tmp_path):
    run = build(pushing(tmp_path, FAILURE, "pwm"))
    actuators = run.loop.plant.effectors[0]
    assert isinstance(actuators, PulsedThrusters)
    events = actuators.failures
    assert [int(k) for k in events.kind] == [FailureKind.STUCK_ON]
    assert [int(k) for k in events.number] == [2]  # the way that it is declared
    level = np.asarray(run.simulate().signals.parts["thrust_level"])[:, 2]
    np.testing.assert_allclose(level[17:], 1, rtol=1e-12)
    assert level.max() == pytest.approx(1)
    assert np.any(level[:16] < 1)


@pytest.mark.slow
def test_failures_are_dispersed_and_a_case_flies_again(tmp_path):
    drawn = """
[dispersion.failure_time_s]
distribution = "uniform"
low = 2
high = 18
[dispersion.failed_thruster]
distribution = "uniform"
low = -0.5
high = 3.5
[dispersion.failure_kind]
distribution = "uniform"
low = -0.5
high = 4.5
[dispersion.misalignment_rad]
distribution = "uniform"
low = -0.01
high = 0.01
"""
    text = dump(pushing(tmp_path, FAILURE, "pwm"))
    study = build_study(load(written(tmp_path, text, drawn)), 8, seed=3)
    assert isinstance(study, Study)
    outputs = study.evaluate(np.arange(8))
    copies = jax.vmap(lambda case: study.case_factory(case, None))(study.cases(np.arange(8)))
    events = copies.loop.plant.effectors[0].failures
    for name, reached in (
        ("failure_time", events.at),
        ("failed_thruster", events.number),
        ("failure_kind", events.kind),
    ):
        np.testing.assert_allclose(reached, outputs.drawn[name], rtol=1e-14)
    struck = np.rint(outputs.drawn["failed_thruster"][:, 0])
    assert len(set(struck)) > 1
    assert set(struck) <= {0, 1, 2, 3}
    one = study.evaluate(np.array([5]))
    assert one.omega.tobytes() == outputs.omega[5:6].tobytes()


def turned_by(events):
    """What each event makes of the torques of both ways of its thruster."""
    ways = [
        (event, way)
        for event in range(events.count)
        for way in np.flatnonzero(events.hit(event, 4))
    ]
    return [np.asarray(events.turned[event][:, way]) for event, way in ways]


def test_a_thruster_is_turned_by_its_force_or_by_its_torque(tmp_path):
    quarter = 'at_s = 1\nkind = "turned"\nturn_rad = [0, 1.5707963267948966, 0]\n'
    texts = [f'[[failure]]\nof = "thruster {name}"\n{quarter}' for name in ("1", "pitch")]
    events = build(pushing(tmp_path, "".join(texts))).loop.plant.effectors[0].failures
    turned = turned_by(events)
    # A quarter turn about y leaves the force (0, -2.5, 0) at (0, 0, 2) and torques along y alone.
    expected = [[5, 0, 0], [-5, 0, 0], [0, 5, 0], [0, -5, 0]]
    np.testing.assert_allclose(turned, expected, atol=1e-12)
    texts = [
        text.replace("[0, 1.5707963267948966, 0]", "[1.5707963267948966, 0, 0]") for text in texts
    ]
    events = build(pushing(tmp_path, "".join(texts))).loop.plant.effectors[0].failures
    turned = turned_by(events)
    # About x the force points along -z through the centre, the torque of the second along z.
    np.testing.assert_allclose(turned, [[0, 0, 0], [0, 0, 0], [0, 0, 5], [0, 0, -5]], atol=1e-12)


MISTAKES = [
    ("force_N = 2.5\n", "", "thruster", "must have position_m, direction, force_N, or"),
    ("direction = [0, -3, 0]", "direction = [0, 0, 1]", "direction", "got no torque"),
    ("direction = [0, -3, 0]", "direction = [0, 0, 0]", "direction", "must be a direction"),
    ("two_sided = true\nspec", "spec", "thruster", "makes a torque along [-1.0, 0.0, 0.0]"),
    ('name = "pitch"', 'name = "1"', "name", 'must be a name of its own, got "1" again'),
    ("torque_N_m = 5", "torque_Nm = 5", "torque_Nm", "did you mean torque_N_m?"),
    ('kind = "pwm"', 'kind = "delta-sigma"', "min_on_time_s", "must be above 0"),
    ('kind = "pwm"', 'kind = "pvm"', "modulation.kind", "did you mean pwm?"),
    ("torque_N_m = 5", "torque_N_m = 5\nrise_time_s = 0.2", "rise_time_s", "control.period_s"),
    ('of = "thruster pitch"', 'of = "thruster 2"', "of", 'must name one of "thruster 1", "thr'),
    ('kind = "stuck-on"', 'kind = "leaking"', "fraction", "must be given for a failure of kind"),
    ('kind = "stuck-on"', 'kind = "dead"\nfraction = 1', "fraction", "must not be given"),
    (
        'law = "three-slew"',
        'law = "rate"\nk1 = 0.4\nk2 = 0.2',
        "thruster",
        "must belong to a sampled law",
    ),
    ("[[thruster]]\nname", f"{IDEAL}[[thruster]]\nname", "thruster_torque_axes", "one of the keys"),
]


@pytest.mark.parametrize(("old", "new", "key", "message"), MISTAKES)
def test_mistakes_are_told(tmp_path, old, new, key, message):
    text = f'{HEAD}{PAIRS}[modulation]\nkind = "pwm"\n{FAILURE}{REST}'
    assert old in text
    with pytest.raises(ScenarioError) as caught:
        load(written(tmp_path, text.replace(old, new, 1)))
    told = [str(problem) for problem in caught.value.problems]
    assert any(key in line and message in line for line in told), told
    assert not any("Argument" in line for line in told), told


PAIR = """\
[[thruster]]
position_m = [0, 0, 2e-4]
direction = {}
force_N = 1e-9
two_sided = true
"""


@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
def test_no_torque_is_too_small_for_a_small_spacecraft(tmp_path):
    text = f"{HEAD}{PAIR.format([0, -1, 0])}{PAIR.format([1, 0, 0])}{REST}"
    torques = [one.torque() for one in load(written(tmp_path, text), purpose="text").thruster]
    np.testing.assert_allclose(torques, [[2e-13, 0, 0], [0, 2e-13, 0]], rtol=1e-12)


def test_the_default_is_pulse_width(tmp_path):
    scenario = load(written(tmp_path, HEAD, PAIRS, REST))
    modulation = build(scenario).loop.plant.effectors[0].modulation
    assert not isinstance(modulation, IdealThrottle)
    assert modulation.counts_openings()
