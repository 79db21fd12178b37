"""Every actuator, sensor and disturbance, and the plug-ins of the docs: derivatives of a period.

The law is quaternion feedback with its defaults, or that of the docs; what is differentiated are
two periods of the closed loop, by the law's gain and by the state, at a start, at the target and
half a turn from it. On-off pulses have no derivative: tuning takes thrust in their place.
"""

import re
import sys
import tomllib
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsat.core.declaration.sensors as declared
from helpers import gyros
from helpers.derivatives import Derivatives
from helpers.every_law import KEYS, PLACES, UPSIDE_DOWN, library, scenario_of
from helpers.magnetic import document
from jaxsat.core import process
from jaxsat.core.attitude import Quaternion
from jaxsat.core.declaration.disturbances import DISTURBANCES
from jaxsat.core.declaration.magnetorquers import MAGNETORQUER
from jaxsat.core.declaration.thrusters import IDEAL_KINDS, THRUSTER
from jaxsat.core.declaration.wheels import WHEEL
from jaxsat.scenario.build.run import build_loop
from jaxsat.scenario.control import find_law
from jaxsat.scenario.parts.registry import TYPES
from jaxsat.scenario.plugins import ESTIMATOR
from jaxsat.scenario.schema import Scenario
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.studies.changes import controller_of
from jaxsat.studies.dispersions import number_at
from jaxsat.synthesis.tuning.forms import throttled
from scenario.packages import PACKAGE, forget_package, install_package

MORE = """import equinox as eqx
from jaxsat.control import AbstractController
from jaxsat.core.declaration import choice
"""
"""What the docs ask to be imported as well."""

DOCS = Path(__file__).parents[2] / "docs"
LAW = "quaternion-feedback"
BODY = {"inertia_kg_m2": [449.5, 264.6, 312.5]}
AXES = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0])
ORBIT = {"altitude_km": 500.0, "inclination_rad": 1.1, "ascending_node_rad": 0.4}


def ideal():
    return scenario_of(LAW)


def pulsed():
    """As tuning takes it: with thrust in place of pulses."""
    data = library("cubesat-12u")
    return throttled(Scenario.model_validate(data, context={"law": True}))


def with_wheels():
    wheel = {"torque_limit_N_m": 3.0, "momentum_limit_N_m_s": 50.0, "rotor_inertia_kg_m2": 0.1}
    wheel |= {"viscous_friction_N_m_s": 1e-3, "coulomb_friction_N_m": 0.01}
    return [{**wheel, "axis": axis, "momentum_N_m_s": 2.0} for axis in AXES]


def wheels():
    return scenario_of(LAW, spacecraft=BODY, wheel=with_wheels())


def magnetorquers():
    return Scenario.model_validate(document(wheels=3), context={"law": True})


def noise_and_delay():
    sampling = {"rate_noise_rad_s": 1e-5, "attitude_noise_rad": 1e-4, "delay_s": 0.02}
    return scenario_of(LAW, sampling=sampling)


GYRO = {
    "noise_density_rad_s_sqrt_Hz": 1e-6,
    "bias_walk_rad_s2_sqrt_Hz": 1e-9,
    "bias_rad_s": 1e-5,
    "bias_sigma_rad_s": 1e-6,
    "scale_factor": 1e-3,
    "misalignment_rad": [1e-3, 2e-3, -1e-3],
    "limit_rad_s": 0.5,
    "outage_start_s": 0.05,
    "outage_s": 0.1,
    "outage_every_s": None,
}
TRACKER = {
    "across_rad": 1e-5,
    "along_rad": 5e-5,
    "boresight": [0.0, 0.6, 0.8],
    "update_period_s": 0.1,
    "latency_s": 0.1,
    "rate_limit_rad_s": 0.5,
    "outage_start_s": 5.0,
    "outage_s": 2.0,
    "outage_every_s": None,
}


TIMES = {"update_period_s": 0.1, "latency_s": 0.1, "outage_start_s": 5.0, "outage_s": 2.0}
TIMES |= {"outage_every_s": 10.0}
TURN = {"misalignment_rad": [1e-3, 2e-3, -1e-3]}
MAGNETOMETER = {"noise_T": 1e-7, "bias_T": 1e-8, "scale_factor": 1e-3, **TURN, **TIMES}
SUN_SENSOR = {
    "noise_rad": 1e-3,
    "boresight": [1.0, 0.0, 0.0],
    "half_angle_rad": 3.0,
    **TURN,
    **TIMES,
}


def navigation(estimator):
    sensors = {"gyro": GYRO, "star_tracker": TRACKER, "estimator": {"kind": estimator}}
    if estimator == "mekf":
        directions = {"sun_sensor": SUN_SENSOR, "horizon_sensor": SUN_SENSOR}
        sensors |= {"magnetometer": MAGNETOMETER, **directions}
    return scenario_of(LAW, control={"law": LAW, **KEYS[LAW], "period_s": 0.1}, **sensors)


def without_a_gyro():
    """The filter that predicts rates by the dynamics and a torque that it estimates."""
    torques = ("torque_noise_N_m_sqrt_Hz", "torque_sigma_N_m", "torque_walk_N_m_s_sqrt_Hz")
    table = {"rate_sigma_rad_s": 0.01} | dict.fromkeys(torques, 1e-3)
    control = {"law": LAW, **KEYS[LAW], "period_s": 0.1}
    return scenario_of(LAW, control=control, star_tracker=TRACKER, estimator=table)


TORQUES = {
    "amplitude_N_m": [0.01, 0.02, 0.001],
    "frequency_rad_s": [0.7, 0.8, 0.1],
    "phase_rad": [0.1, 0.2, 0.3],
    "constant_N_m": [1e-3, -1e-3, 2e-3],
    "gravity_gradient": True,
    "residual_dipole_A_m2": [1.0, -2.0, 0.5],
    "drag_density_kg_m3": 1e-11,
    "drag_coefficient": 2.1,
    "drag_area_m2": 2.0,
    "drag_centre_m": [0.1, 0.2, 0.0],
    "solar_area_m2": 2.0,
    "solar_coefficient": 1.4,
    "solar_centre_m": [0.1, 0.0, 0.2],
    "sun_direction": [1.0, 0.2, 0.1],
    "eclipses": True,
}


def disturbances():
    return scenario_of(LAW, disturbance=TORQUES, orbit=ORBIT)


def panels():
    """Of which none is edge-on to the air or the light at any of the places."""
    plate = {"area_m2": 3.0, "centre_m": [0.5, -0.4, 0.3], "specular": 0.3, "diffuse": 0.2}
    plates = [{**plate, "normal": normal} for normal in ([1, 0.3, 0.2], [-0.4, 1, 0.3])]
    air = {"drag_density_kg_m3": 1e-9, "sun_direction": [1.0, 0.2, 0.1], "eclipses": True}
    return scenario_of(LAW, disturbance=air, orbit=ORBIT, panel=plates)


AMOUNTS = {
    "fraction": 0.6,
    "delay_s": 0.05,
    "turn_rad": [0.1, 0.2, -0.1],
    "factor": 3.0,
    "friction_N_m": 0.02,
}
"""How much of a failure, by the key of its kind."""


def failures(part, kinds, parts):
    """Every kind of failure of a part in both periods, each with every key that it has."""
    each = [(kind.text, key) for kind in kinds for key in kind.keys or (None,)]
    return [
        {"of": f"{part} {number % parts + 1}", "at_s": 0.013 * (1 + number), "kind": kind}
        | ({} if key is None else {key: AMOUNTS[key]})
        for number, (kind, key) in enumerate(each)
    ]


def failing_ideal_thrusters():
    return scenario_of(LAW, failure=failures("thruster", IDEAL_KINDS, 3))


def failing_pulsed_thrusters():
    data = library("cubesat-12u")
    data["failure"] = failures("thruster", THRUSTER.kinds, 8)
    return throttled(Scenario.model_validate(data, context={"law": True}))


def failing_magnetorquers():
    data = document(wheels=3)
    data["failure"] = failures("magnetorquer", MAGNETORQUER.kinds, 3)
    return Scenario.model_validate(data, context={"law": True})


def failing_wheels():
    """With rotors, whose edges are located."""
    failing = failures("wheel", WHEEL.kinds, 3)
    return scenario_of(LAW, spacecraft=BODY, wheel=with_wheels(), failure=failing)


def failing_wheels_without_rotors():
    """Whose edges are closed forms; one comes to rest, and one to its limit."""
    without = {"rotor_inertia_kg_m2": None, "viscous_friction_N_m_s": None}
    each = with_wheels()
    each[0]["momentum_N_m_s"], each[1]["momentum_N_m_s"] = 0.002, 49.995
    each = [{key: value for key, value in one.items() if key not in without} for one in each]
    kinds = [kind for kind in WHEEL.kinds if kind.text != "friction-up"]
    return scenario_of(LAW, spacecraft=BODY, wheel=each, failure=failures("wheel", kinds, 3))


def law_of_the_docs():
    return of_the_docs("your-own-law.md")


def disturbance_and_actuators_of_the_docs():
    law = {"law": LAW, **KEYS[LAW]}
    return of_the_docs("your-own-disturbance.md", control=law, failed=[])


def sensors_of_the_docs():
    """A magnetometer, a beacon, and a Sun sensor that the light of the Earth disturbs."""
    text = (DOCS / "your-own-sensor.md").read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    Path("beacons.py").write_text("\n".join(blocks), encoding="utf-8")
    place = {"latitude_rad": 0.3, "longitude_rad": 0.2, "noise_rad": 1e-3}
    beacon = {"kind": "beacons:Beacon", **place, **TURN, **TIMES}
    sun = {"kind": "beacons:AlbedoSun", "pull": 0.1, **SUN_SENSOR}
    sensors = {"gyro": GYRO, "magnetometer": MAGNETOMETER, "sensor": {"north": beacon, "sun": sun}}
    return scenario_of(LAW, control={"law": LAW, **KEYS[LAW], "period_s": 0.1}, **sensors)


def pid_of_the_docs():
    law = {"law": "quaternion_pd:QuaternionPID", "kp": 4.0, "ki_N_m_s": 0.1, "kd": 40.0}
    return of_the_docs("your-own-law.md", control=law)


def package():
    """The law and the disturbance of the package of the tests."""
    data = tomllib.loads((PACKAGE / "reduced-effort.toml").read_text(encoding="utf-8"))
    data = {key: value for key, value in data.items() if key not in ("tuning", "dispersion")}
    drag = {"kind": "aerodynamic", "force_N": 1e-3, "arm_m": [0.1, 0.2, -0.1]}
    data["disturbance"] = {"torques": {"drag": drag}}
    return Scenario.model_validate(data, context={"law": True})


def tachometers():
    """The wheel filter of a law that diagnoses wheels, of which one dies in the first period."""
    data = library("wheels-fail")
    data["failure"] = [{"of": "wheel A", "at_s": 0.05, "kind": "dead"}]
    return Scenario.model_validate(data, context={"law": True})


def gimbals():
    data = gyros.document([{"of": "gimbal 3", "at_s": 0.1, "kind": "locked"}])
    return Scenario.model_validate(data, context={"law": True})


def flexible_modes():
    data = gyros.document()
    mode = {"frequency_rad_s": 1.3, "damping": 0.02, "coupling_sqrt_kg_m": [0.6, -0.3, 0.5]}
    data["flexible_mode"] = [mode | {"angle_rad": 0.01}]
    return Scenario.model_validate(data, context={"law": True})


def estimated(kind):
    return Part(f"navigation-{kind}", lambda: navigation(kind))


class Part(NamedTuple):
    """A scenario, and where the law has its gain."""

    name: str
    scenario: Callable[[], Scenario]
    gain: str = "natural_frequency"


OF_JAXSAT = [ideal, pulsed, wheels, magnetorquers, noise_and_delay, disturbances, panels]
OF_JAXSAT += [failing_ideal_thrusters, failing_pulsed_thrusters, failing_magnetorquers]
OF_JAXSAT += [failing_wheels, failing_wheels_without_rotors, gimbals, flexible_modes]
OF_JAXSAT += [without_a_gyro]
PARTS = [Part(one.__name__, one) for one in OF_JAXSAT] + [estimated(kind) for kind in ESTIMATOR.own]
PARTS += [Part("tachometers", tachometers, "healthy.natural_frequency")]
PLUGINS = [
    Part("law_of_the_docs", law_of_the_docs, "kp"),
    Part("pid_of_the_docs", pid_of_the_docs, "kp"),
    Part("disturbance_and_actuators_of_the_docs", disturbance_and_actuators_of_the_docs),
    Part("sensors_of_the_docs", sensors_of_the_docs),
    Part("package", package, "alpha"),
]
FILES = {"QuaternionPD": "quaternion_pd", "SolarTorque": "solar", "CoarseValves": "valves"}
FILES |= {"Beacon": "beacons"}


def of_the_docs(page, control=None, failed=None):
    """The scenario of a page, whose classes are in files beside the test's folder."""
    text = (DOCS / page).read_text(encoding="utf-8")
    blocks = re.findall(r"^```python\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)
    for name, file in FILES.items():
        for code in (code for code in blocks if f"class {name}(" in code):
            further = [code for code in blocks if "class QuaternionPID(" in code]
            Path(f"{file}.py").write_text("\n".join([MORE, code, *further]), encoding="utf-8")
    data = tomllib.loads(re.findall(r"^```toml\n(.*?)^```$", text, re.MULTILINE | re.DOTALL)[0])
    data = {key: value for key, value in data.items() if key not in ("tuning", "dispersion")}
    if control is not None:
        data["control"] = control
    if failed is not None:
        data["spacecraft"]["failed_thrusters"] = failed
    return Scenario.model_validate(data, context={"law": True})


SLOW = {"failing_wheels", "failing_pulsed_thrusters", "failing_magnetorquers", "tachometers"}
SLOW |= {"noise_and_delay", "disturbances", "panels", "navigation-none", "magnetorquers"}
SLOW |= {"failing_wheels_without_rotors", "navigation-mekf", "wheels"}
SLOW |= {"flexible_modes", "gimbals", "without_a_gyro", "sensors_of_the_docs"}
ALL = [
    pytest.param(one, id=one.name, marks=[pytest.mark.slow] if one.name in SLOW else [])
    for one in PARTS + PLUGINS
]


@pytest.fixture(scope="module", params=ALL)
def part(request, tmp_path_factory):
    one = request.param
    with pytest.MonkeyPatch.context() as patch:
        folder = tmp_path_factory.mktemp("plug-ins")
        patch.chdir(folder)
        patch.syspath_prepend(folder)
        patch.setattr(process, "_ADDED", [])
        install_package(folder, patch)
        scenario = one.scenario()
        loop = build_loop(scenario)
        names = [one.gain, *"φθψ", "ω1", "ω2", "ω3"]
        after = lambda *given: after_two_periods(loop, one.gain, *given)  # noqa: E731
        yield scenario, loop, Derivatives(after, names)
    forget_package()
    for file in FILES.values():
        sys.modules.pop(file, None)


def after_two_periods(loop, gain, x, quaternion, omega):
    """The plant after two periods in steps of Euler; of a continuous law its rates."""
    scaled = number_at(controller_of(loop), gain) * jnp.exp(x[0])
    changed = eqx.tree_at(lambda loop: number_at(controller_of(loop), gain), loop, scaled)
    turned = quaternion + Quaternion(quaternion).rate(x[1:4]).q
    start = changed.start(PlantState(Quaternion(turned).normalised(), omega + x[4:]))
    if not isinstance(changed, SampledLoop):
        return leaves(changed.motion(jnp.array(1.3), start).rate.plant)

    def step(t, hold, plant, carry):
        rate = changed.motion(t, plant, hold, jnp.zeros_like(hold.length)).rate
        return jax.tree.map(lambda one, slope: one + hold.length * slope, plant, rate), carry

    def period(number, state):
        t = number * changed.controller.period
        return changed.period(number, t, state, step, None)[0]

    return leaves(jax.lax.fori_loop(0, 2, period, start).plant)


def leaves(plant):
    return jnp.concatenate([jnp.ravel(leaf) for leaf in jax.tree.leaves(plant)])


@pytest.mark.parametrize("place", PLACES)
def test_derivatives_are_finite_and_equal_to_differences(part, place):
    scenario, loop, derivatives = part
    if find_law(scenario.control.law).declaration.works_in_wz and place in UPSIDE_DOWN:
        pytest.skip("(w, z) are refused upside down: tests/control/test_derivatives.py")
    frame = np.asarray(loop.plant.orbit.frame_rate(Quaternion(PLACES[place])))
    rate = np.array([2e-3, -3e-3, 4e-3]) if place == "a start" else np.zeros(3)
    found = derivatives.at(np.zeros(7), np.array(PLACES[place]), frame + rate)
    assert found.wrong == []
    assert found.compared >= set(derivatives.names[:1])
    if place == "a start":
        assert found.compared == set(derivatives.names)


NO_PARTS = {"title", "description", "initial", "simulation", "settled", "dispersion", "tuning"}
NO_PARTS |= {"requirement", *TYPES}
"""Tables that are none of the spacecraft or its surroundings, or types, which `read` takes in."""

IN_OTHER_PLACES = {"actuators", "sensor", "unloading", "modulation"}
"""Those of plug-ins, of magnetorquers beside wheels, and of throttled thrusters."""


def test_the_list_has_every_part_that_a_scenario_can_have():
    """A key or table that is new is to be added above; failures and estimators are found."""
    keys = {key.name for one in DISTURBANCES.values() for key in one.keys}
    assert set(TORQUES) == keys
    assert set(GYRO) == {key.name for key in declared.GYRO.keys}
    assert set(TRACKER) == {key.name for key in declared.STAR_TRACKER.keys}
    tables = (MAGNETOMETER, SUN_SENSOR, SUN_SENSOR)
    for table, sensor in zip(tables, declared.ATTITUDE_SENSORS[1:], strict=True):
        assert set(table) == {key.name for key in sensor.keys}
    used = set().union(*(part.scenario().model_fields_set for part in PARTS))
    assert used | IN_OTHER_PLACES | NO_PARTS >= set(Scenario.model_fields)
