"""Scenarios written and read again, and frozen in between."""

import tomllib

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from pydantic import ValidationError

from jaxsat.scenario import Scenario, dump
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.lines import line_map
from scenario.documents import every_location


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
            "thruster_torque_axes": st.just([[1, 0, 0.1], [0, 0.8, 0.6], [0, 0, 1]]),
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


@pytest.mark.slow
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
