"""Line maps, TOML text, JSON Schema, and scenarios built into the core's objects."""

import math
import tomllib

import jax
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from jaxsat.assembly.load import load
from jaxsat.assembly.run import build
from jaxsat.scenario import Scenario, dump, json_schema
from jaxsat.scenario.lines import line_map, nearest_line
from jaxsat.scenario.toml_text import toml_document
from jaxsat.simulation import adaptive, simulate
from jaxsat.vehicle import Actuators


def test_line_map():
    text = '''\
# a comment with [brackets] and = signs
top = "a # no comment"
"quoted key" = 'single'
long = """
[not.a.table]
x = 1 \\""" still text
"""
raw = \'\'\'
] }\'\'\'
[ a . b ]   # comment
list = [ # comment ]
  [1, 2],
  { x = 1, y.z = [
     3 ] },
]
date = 1979-05-27 07:32:00
dotted."k.e y".x = true
[[many]]
v = 1
[[many]]
v = 2
[a]
last = -inf'''
    data = tomllib.loads(text)
    lines = line_map(text)
    expected = {
        ("top",): 2,
        ("quoted key",): 3,
        ("long",): 4,
        ("raw",): 8,
        ("a",): 22,
        ("a", "b"): 10,
        ("a", "b", "list"): 11,
        ("a", "b", "list", 0): 12,
        ("a", "b", "list", 0, 1): 12,
        ("a", "b", "list", 1): 13,
        ("a", "b", "list", 1, "x"): 13,
        ("a", "b", "list", 1, "y", "z", 0): 14,
        ("a", "b", "date"): 16,
        ("a", "b", "dotted", "k.e y", "x"): 17,
        ("many", 0): 18,
        ("many", 1, "v"): 21,
        ("a", "last"): 23,
    }
    assert {key: lines.get(key) for key in expected} == expected
    assert set(every_location(data)) == set(lines)
    assert nearest_line(lines, ("a", "b", "missing", 3)) == 10
    assert nearest_line(lines, ("nothing",)) == 1


def every_location(value, path=()):
    if path:
        yield path
    entries = value.items() if isinstance(value, dict) else enumerate(value)
    for key, entry in entries if isinstance(value, dict | list) else ():
        if isinstance(entry, dict | list):
            yield from every_location(entry, (*path, key))
        else:
            yield (*path, key)


keys = st.text(st.characters(exclude_categories=["Cs"]), max_size=8)
scalars = (
    st.booleans()
    | st.integers(-(2**63), 2**63 - 1)
    | st.floats(allow_nan=False)
    | st.text(st.characters(exclude_categories=["Cs"]))
)
values = st.recursive(
    scalars, lambda inner: st.lists(inner, max_size=4) | st.dictionaries(keys, inner, max_size=4)
)


@given(st.dictionaries(keys, values, max_size=5))
def test_documents_read_back(document):
    """What is written is what `tomllib` reads (empty tables left out), and every key has a line."""
    text = toml_document(document)
    read = tomllib.loads(text)
    assert read == without_empty_tables(document)
    assert set(line_map(text)) >= set(every_location(read))


def without_empty_tables(table):
    kept = {}
    for key, value in table.items():
        inner = without_empty_tables(value) if isinstance(value, dict) else value
        if inner != {}:
            kept[key] = inner
    return kept


def numbers(low, high):
    return st.floats(low, high, allow_subnormal=False)


positive = numbers(1e-6, 1e6)
printable = st.characters(exclude_categories=["Cc", "Cf", "Cs", "Cn", "Zl", "Zp"])
vector3 = st.tuples(*[numbers(-10, 10)] * 3)
pair = st.tuples(positive, positive)
switches = st.tuples(*[st.booleans()] * 3)


@st.composite
def inertias(draw):
    moments = draw(st.tuples(*[numbers(1, 1000)] * 3))
    if draw(st.booleans()):
        return moments
    small = draw(st.tuples(*[numbers(-0.4, 0.4)] * 3))
    matrix = np.diag(moments)
    matrix[0, 1] = matrix[1, 0] = small[0]
    matrix[0, 2] = matrix[2, 0] = small[1]
    matrix[1, 2] = matrix[2, 1] = small[2]
    return matrix.tolist()


GAINS = {"k1": positive, "k2": positive, "k3": positive, "mu": positive, "a": positive,
         "k4": positive | pair}  # fmt: skip
OPTIONAL = {
    "omega3_width_rad_s": numbers(0, 1),
    "internal_model_frequency_rad_s": pair,
    "attitude_weight_N_m": numbers(0, 10),
    "saturation_width": numbers(0, 1),
    "tilt_width": numbers(0, 1),
    "measured_disturbance": switches,
    "model": st.fixed_dictionaries(
        {},
        optional={
            "inertia_kg_m2": inertias(),
            "orbit_rate_rad_s": numbers(0, 1),
            "orbit_relation": st.sampled_from(["exact", "small-angle"]),
        },
    ),
}
THRESHOLDS = {
    "lower_threshold_rad_s": numbers(1e-6, 1),
    "upper_threshold_rad_s": numbers(1, 2),
    "period_s": st.just(0.1),
    "rate_slope_limit_rad_s2": pair,
    "three_axis_slope_limit_rad_s2": pair,
}
LAW_KEYS = {
    "coast": [],
    "rate": ["k1", "k2", "omega3_width_rad_s", "measured_disturbance", "model"],
    "three-axis": ["k3", "mu", "a", "k4", *list(OPTIONAL)[1:]],
    "switching": [*GAINS, *THRESHOLDS, *OPTIONAL],
}


@st.composite
def scenarios(draw):
    law = draw(st.sampled_from(list(LAW_KEYS)))
    optional = {key: value for key, value in OPTIONAL.items() if key in LAW_KEYS[law]}
    required = {key: value for key, value in (GAINS | THRESHOLDS).items() if key in LAW_KEYS[law]}
    control = draw(st.fixed_dictionaries(required, optional=optional))
    attitude = draw(
        st.fixed_dictionaries({"w": st.tuples(numbers(-5, 5), numbers(-5, 5)),
                               "z_rad": numbers(-9, 9)})
        | st.just({"quaternion": (0.5, 0.5, -0.5, 0.5)})
    )  # fmt: skip
    orbit = draw(st.sampled_from(["rate_rad_s", "altitude_km"]))
    spacecraft = st.fixed_dictionaries(
        {
            "inertia_kg_m2": inertias(),
            "thruster_torque_axes": st.just([[1, 0, 0.1], [0, 2, 0], [0, 0, 1]]),
        },
        optional={"failed_thrusters": st.just([3]), "torque_limit_N_m": positive},
    )
    disturbance = dict.fromkeys(("amplitude_N_m", "phase_rad", "constant_N_m"), vector3)
    return {
        "title": draw(st.text(printable, min_size=1, max_size=200)),
        "description": draw(st.text(printable | st.sampled_from("\n\t"))),
        "spacecraft": draw(spacecraft),
        "orbit": {orbit: draw(numbers(1e-6, 1)), "relation": draw(st.sampled_from(["exact"]))},
        "disturbance": {
            **draw(st.fixed_dictionaries({}, optional=disturbance)),
            "frequency_rad_s": [0.7, 0.8, draw(numbers(-1, 1))],
            "gravity_gradient": draw(st.booleans()),
        },
        "initial": {**attitude, "omega_rad_s": draw(vector3)},
        "control": {"law": law, **control},
        "simulation": {
            "duration_s": draw(st.integers(1, 1000)),
            "save_every_s": draw(st.sampled_from([0.1, 0.5, 1])),
            "attitude": draw(st.sampled_from(["wz", "quaternion"])),
            "seed": draw(st.integers(0, 2**63 - 1)),
        },
    }


@settings(max_examples=60, deadline=None)
@given(data=scenarios())
def test_dump_and_load_are_inverse(data, tmp_path_factory):
    scenario = Scenario.model_validate(data)
    text = dump(scenario)
    assert Scenario.model_validate(tomllib.loads(text)) == scenario
    lines = line_map(text)
    assert set(every_location(tomllib.loads(text))) <= set(lines)
    build(scenario)  # what passes the checks meets no error in the core


def test_scenarios_are_frozen_and_checked_in_python_too():
    scenario = load("paper-rate")
    with pytest.raises(ValidationError):
        scenario.title = "other"
    data = scenario.model_dump()
    data["control"]["k1"] = -1
    data["spacecraft"]["failed_thrusters"] = [7]
    with pytest.raises(ValidationError) as caught:
        Scenario.model_validate(data)
    assert "must be greater than 0 √(rad/s), got -1" in str(caught.value)
    assert "must name thrusters from 1 to 3, got 7" in str(caught.value)


def test_schema_describes_every_key_with_its_unit():
    schema = json_schema()
    tables = [schema, *schema["$defs"].values()]
    suffixes = {"kg_m2": "kg m²", "N_m": "N m", "rad_s": "rad/s", "rad_s2": "rad/s²", "km": "km",
                "rad": "rad", "s": "s"}  # fmt: skip
    seen = 0
    for table in tables:
        assert table["additionalProperties"] is False
        for key, entry in table["properties"].items():
            assert entry.get("description"), key
            if "$ref" in str(entry):  # a table, whose own keys have the units
                continue
            for suffix, unit in suffixes.items():
                if key.endswith("_" + suffix) and not any(
                    key.endswith(f"{longer}") for longer in suffixes if len(longer) > len(suffix)
                ):
                    assert entry["unit"] == unit, key
                    seen += 1
            if "unit" in entry:
                shown = "no unit" if entry["unit"] == "1" else entry["unit"]
                assert entry["description"].endswith(f"({shown})")
    assert seen > 25
    assert schema["$schema"].startswith("https://json-schema.org/")


def test_plant_and_law_hold_the_numbers_of_the_file():
    run = build(load("switching", ["control.model.inertia_kg_m2=[450, 260, 310]",
                                   "control.measured_disturbance=[false,false,true]",
                                   "disturbance.constant_N_m=[0,0,1e-6]",
                                   "disturbance.gravity_gradient=true",
                                   "orbit.altitude_km=400", "simulation.solver.substeps=7",
                                   "simulation.solver.name=tsit5"]))  # fmt: skip
    plant, law = run.loop.plant, run.loop.controller
    np.testing.assert_array_equal(plant.spacecraft.moments, [449.5, 264.6, 312.5])
    np.testing.assert_array_equal(law.rate_law.model.spacecraft.moments, [450, 260, 310])
    assert float(plant.orbit.rate) == pytest.approx(math.sqrt(3.986004418e14 / 6778137.0**3))
    assert float(law.three_axis_law.model.orbit.rate) == float(plant.orbit.rate)
    assert len(plant.disturbance.terms) == 3
    assert law.three_axis_law.internal_model is None
    known = law.rate_law.model.disturbance
    np.testing.assert_array_equal(known.amplitude, [0, 0, 0.001])
    np.testing.assert_allclose(law.rate_slope_limit, [5 / 450, 5 / 260])
    np.testing.assert_allclose(law.three_axis_slope_limit, [25 / 450, 25 / 260])
    assert run.loop.substeps == 7
    assert type(run.method.solver).__name__ == "Tsit5"
    assert float(run.loop.actuators.limit) == 5


def test_attitude_is_integrated_in_the_parameters_asked_for():
    wz = build(load("paper-three-axis")).start.attitude
    quaternion = build(load("paper-three-axis", ["simulation.attitude=quaternion"])).start.attitude
    assert type(wz).__name__ == "WZ"
    assert type(quaternion).__name__ == "Quaternion"
    np.testing.assert_allclose(wz.as_dcm().matrix, quaternion.as_dcm().matrix, atol=1e-15)


@pytest.mark.slow
def test_coasting_needs_no_thrusters():
    changes = ["spacecraft.failed_thrusters=[1,2,3]", "control.law=coast",
               "simulation.duration_s=10"]  # fmt: skip
    run = build(load("paper-rate", changes))
    assert isinstance(run.loop.actuators, Actuators)
    trajectory = run.simulate()
    assert trajectory.outcome == 0
    assert not np.any(np.asarray(trajectory.signals.torque))


def test_method_of_the_file():
    def method(*changes):
        return build(load("paper-three-axis", changes)).method

    free = build(load("free-third-rate")).method
    assert float(free.step_size.rtol) == 1e-8
    assert float(free.step_size.dtmin) == 2e-3
    usual = adaptive()
    assert float(method().step_size.rtol) == float(usual.step_size.rtol)
    assert type(method("simulation.solver.name=tsit5").solver).__name__ == "Tsit5"
    loose = method("simulation.solver.rtol=1e-6")
    assert float(loose.step_size.rtol) == 1e-6
    assert float(loose.step_size.atol) == float(usual.step_size.atol)
    assert loose.max_steps == usual.max_steps
    fixed = method("simulation.solver.step_s=0.25")
    assert float(fixed.first_step) == 0.25


def test_long_runs_with_fixed_steps_have_steps_enough():
    changes = ["simulation.duration_s=50000", "control.law=coast"]
    run = build(load("paper-rate", changes))
    assert run.method.max_steps >= 50000 / float(run.method.first_step)


@pytest.mark.slow
def test_other_numbers_compile_nothing_anew():
    traces = []

    @jax.jit
    def final(loop, start, times):
        traces.append(1)
        return simulate(loop, start, times, method=method).signals.omega[-1]

    short = ["simulation.duration_s=2", "control.saturation_width=1", "control.tilt_width=0.1",
             "simulation.solver.step_s=0.1"]  # fmt: skip
    first = build(load("paper-three-axis", short))
    method = first.method
    final(first.loop, first.start, first.times)
    second = build(load("paper-three-axis", [*short, "control.k3=0.06", "control.mu=0.9",
                                             "disturbance.amplitude_N_m=[0,0,0]"]))  # fmt: skip
    final(second.loop, second.start, second.times)
    assert len(traces) == 1
