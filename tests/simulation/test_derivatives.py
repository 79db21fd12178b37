"""Every actuator, sensor and disturbance, and the plug-ins of the docs: derivatives of a period.

The law is quaternion feedback with its defaults, or that of the docs; what is differentiated are
two periods of the closed loop, by the law's gain and by the state, at a start, at the target and
half a turn from it. On-off pulses have no derivative: tuning takes thrust in their place.
"""

import re
import sys
from pathlib import Path

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.derivatives import Derivatives
from helpers.every_law import PLACES, library, scenario_of
from helpers.magnetic import document
from jaxsat import search_path
from jaxsat.assembly.run import build_loop
from jaxsat.assembly.tuning_forms import throttled
from jaxsat.attitude import Quaternion
from jaxsat.dynamics import PlantState
from jaxsat.montecarlo.perturbed import controller_of
from jaxsat.scenario.schema import Scenario
from jaxsat.simulation import SampledLoop

DOCS = Path(__file__).parents[2] / "docs"
LAW = "quaternion-feedback"
AXES = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
ORBIT = {"altitude_km": 500.0, "inclination_rad": 1.1, "ascending_node_rad": 0.4}


def ideal():
    return scenario_of(LAW)


def pulsed():
    """As tuning takes it: with thrust in place of pulses."""
    data = library("cubesat-12u")
    return throttled(Scenario.model_validate(data, context={"law": True}))


def wheels():
    wheel = {"torque_limit_N_m": 3.0, "momentum_limit_N_m_s": 50.0, "rotor_inertia_kg_m2": 0.1}
    wheel |= {"viscous_friction_N_m_s": 1e-3, "coulomb_friction_N_m": 0.01}
    each = [{**wheel, "axis": axis, "momentum_N_m_s": 2.0} for axis in AXES]
    spacecraft = {"inertia_kg_m2": [449.5, 264.6, 312.5]}
    return scenario_of(LAW, spacecraft=spacecraft, wheel=each)


def magnetorquers():
    return Scenario.model_validate(document(wheels=3), context={"law": True})


def noise_and_delay():
    sampling = {"rate_noise_rad_s": 1e-5, "attitude_noise_rad": 1e-4, "delay_s": 0.02}
    return scenario_of(LAW, sampling=sampling)


def navigation():
    tracker = {"across_rad": 1e-5, "along_rad": 5e-5}
    gyro = {"noise_density_rad_s_sqrt_Hz": 1e-6, "bias_walk_rad_s2_sqrt_Hz": 1e-9}
    return scenario_of(LAW, gyro=gyro, star_tracker=tracker, estimator={})


def disturbances():
    torques = {
        "amplitude_N_m": [0.01, 0.02, 0.001],
        "frequency_rad_s": [0.7, 0.8, 0.1],
        "constant_N_m": [1e-3, -1e-3, 2e-3],
        "gravity_gradient": True,
        "residual_dipole_A_m2": [1.0, -2.0, 0.5],
        "drag_density_kg_m3": 1e-11,
        "drag_area_m2": 2.0,
        "drag_centre_m": [0.1, 0.2, 0.0],
        "solar_area_m2": 2.0,
        "solar_centre_m": [0.1, 0.0, 0.2],
        "sun_direction": [1.0, 0.2, 0.1],
        "eclipses": True,
    }
    return scenario_of(LAW, disturbance=torques, orbit=ORBIT)


def law_of_the_docs():
    return of_the_docs("your-own-law.md")


def disturbance_and_actuators_of_the_docs():
    return of_the_docs("your-own-disturbance.md", control={"law": LAW}, failed=[])


PARTS = [ideal, pulsed, wheels, magnetorquers, noise_and_delay, navigation, disturbances]
PLUGINS = [law_of_the_docs, disturbance_and_actuators_of_the_docs]
FILES = {"QuaternionPD": "quaternion_pd", "SolarTorque": "solar", "CoarseValves": "valves"}


def of_the_docs(page, control=None, failed=None):
    """The scenario of a page, whose classes are in files beside the test's folder."""
    import tomllib

    text = (DOCS / page).read_text(encoding="utf-8")
    for code in re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL):
        for name, file in FILES.items():
            if f"class {name}(" in code:
                Path(f"{file}.py").write_text(code, encoding="utf-8")
    data = tomllib.loads(re.findall(r"^```toml\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)[0])
    data = {key: value for key, value in data.items() if key not in ("tuning", "dispersion")}
    if control is not None:
        data["control"] = {**control, "natural_frequency_rad_s": 0.1}
        data["spacecraft"]["failed_thrusters"] = failed
    return Scenario.model_validate(data, context={"law": True})


@pytest.fixture(scope="module", params=PARTS + PLUGINS, ids=lambda part: part.__name__)
def part(request, tmp_path_factory):
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("plug-ins")
        patch.chdir(folder)
        patch.setattr(sys, "path", [str(folder), *sys.path])
        patch.setattr(search_path, "_ADDED", [])
        loop = build_loop(request.param())
        gain = "kp" if request.param is law_of_the_docs else "natural_frequency"
        names = [gain, *"φθψ", "ω1", "ω2", "ω3"]
        yield loop, Derivatives(lambda *given: after_two_periods(loop, gain, *given), names)
    for file in FILES.values():
        sys.modules.pop(file, None)


def after_two_periods(loop, gain, x, quaternion, omega):
    """The plant after two periods in steps of Euler; of a continuous law its rates."""
    law = controller_of(loop)
    scaled = getattr(law, gain) * jnp.exp(x[0])
    changed = eqx.tree_at(lambda loop: getattr(controller_of(loop), gain), loop, scaled)
    turned = quaternion + Quaternion(quaternion).rate(x[1:4]).q
    start = changed.start(PlantState(Quaternion(turned).normalised(), omega + x[4:]))
    if not isinstance(changed, SampledLoop):
        return leaves(changed.motion(jnp.array(1.3), start).rate.plant)

    def step(t, hold, plant, carry):
        rate = changed.plant_rate(t, plant, hold, jnp.zeros_like(hold.length))
        return jax.tree.map(lambda one, slope: one + hold.length * slope, plant, rate), carry

    state = start
    for number in range(2):
        t = number * changed.controller.period
        state, _, _ = changed.period(jnp.array(number), t, state, step, None)
    return leaves(state.plant)


def leaves(plant):
    return jnp.concatenate([jnp.ravel(leaf) for leaf in jax.tree.leaves(plant)])


@pytest.mark.parametrize("place", PLACES)
def test_derivatives_are_finite_and_equal_to_differences(part, place):
    loop, derivatives = part
    frame = np.asarray(loop.plant.orbit.frame_rate(Quaternion(PLACES[place])))
    rate = np.array([2e-3, -3e-3, 4e-3]) if place == "a start" else np.zeros(3)
    found = derivatives.at(np.zeros(7), np.array(PLACES[place]), frame + rate)
    assert found.wrong == []
    assert found.compared >= set(derivatives.names[:1])
    if place == "a start":
        assert found.compared == set(derivatives.names)
