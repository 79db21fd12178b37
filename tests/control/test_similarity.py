"""One motion in every unit: the settling laws have no number with a dimension of their own."""

import tomllib

import numpy as np
import pytest

from cli.test_your_own_law import PAGE, blocks
from helpers import gyros
from helpers.units import in_units
from jaxsat.control.tolerant_actuators import TolerantMode
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.schema import Scenario

BASE = {
    "spacecraft.inertia_kg_m2": (449.5, 264.6, 312.5),
    "spacecraft.torque_limit_N_m": 5.0,
    "disturbance.amplitude_N_m": (0.01, 0.02, 0.001),
    "disturbance.frequency_rad_s": (0.7, 0.8, 0.1),
    "orbit.rate_rad_s": 0.0011,
    "initial.omega_rad_s": (0.1, -0.11, 0.02),
    "control.period_s": 0.1,
    "sampling.rate_noise_rad_s": 3e-5,
    "sampling.attitude_noise_rad": 1e-4,
    "simulation.save_every_s": 0.1,
    "simulation.duration_s": 150.0,
}
MASS = ("inertia_kg_m2", "torque_limit_N_m", "amplitude_N_m")
"""What a factor of the mass multiplies."""
POWERS = {"rad_s": -1, "limit_N_m": -2, "amplitude_N_m": -2, "_s": 1}
"""Powers of a factor of the time, by how a key ends."""


def power(key):
    return next((power for end, power in POWERS.items() if key.endswith(end)), 0)


def scaled(mass, time, values=BASE):
    """Overrides of a scenario, in units of so many of the old ones."""
    for key, value in values.items():
        number = np.array(value) * time ** power(key)
        number = number * mass if key.endswith(MASS) else number
        yield f"{key}={number.tolist()!r}"


def flown(law, mass, time):
    """Quaternion, rates in rad per unit of time, and modes; the same for every unit."""
    overrides = [f"control.law={law}", "title=scaled", *scaled(mass, time)]
    signals = build(load("acceptance-hard", overrides)).simulate().signals
    return np.asarray(signals.quaternion), np.asarray(signals.omega) * time, signals.mode


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
@pytest.mark.parametrize("law", ["oscillatory", "three-slew"])
def test_mass_and_time_may_be_of_any_unit(law):
    """J, T, d times any number; T, ω0, noise, period and d's frequency with the time."""
    quaternion, omega, mode = flown(law, 1.0, 1.0)
    assert len(set(np.asarray(mode))) == {"oscillatory": 2, "three-slew": 4}[law]
    for mass, time in ((1e-3, 1.0), (7.3, 1.0), (1.0, 7.3), (1e-3, 1e-1)):
        found = flown(law, mass, time)
        np.testing.assert_allclose(found[0], quaternion, atol=1e-7)
        np.testing.assert_allclose(found[1], omega, atol=1e-8)
        np.testing.assert_array_equal(found[2], mode)


def of_the_page(folder, monkeypatch):
    """The law that docs/your-own-law.md writes, and its scenario."""
    text = PAGE.read_text(encoding="utf-8")
    (folder / "quaternion_pd.py").write_text(blocks(text, "python")[0], encoding="utf-8")
    monkeypatch.syspath_prepend(folder)
    found = tomllib.loads(blocks(text, "toml")[0])
    return {key: found[key] for key in found if key not in ("dispersion", "tuning")}


TWO_WHEELS = [
    "failure=[{of='wheel A', kind='dead', at_s=1}, {of='wheel B', kind='dead', at_s=1}]",
    "initial.omega_rad_s=[2e-3, -1e-3, 2e-3]",
    "simulation.duration_s=100",
]
"""Momentum that two wheels are left with, and learn."""


@pytest.mark.slow
@pytest.mark.parametrize("time", [2.0**14, 2.0**-14])
def test_two_wheels_with_momentum_learn_it_alike_at_any_scale(time):
    """Of mass, so that torques stay in range, and of time; to the last bit."""
    scenario = load("wheels-fail", TWO_WHEELS)
    units = (time**2, 1.0, time)
    own, other = (build(one).simulate().signals for one in (scenario, in_units(scenario, units)))
    assert np.asarray(own.mode)[-1] == TolerantMode.NEAREST
    np.testing.assert_array_equal(other.mode, own.mode)
    np.testing.assert_array_equal(other.quaternion, own.quaternion)
    np.testing.assert_array_equal(np.asarray(other.omega) * time, own.omega)


UNITS = ((2.0**20, 1.0, 1.0), (2.0**-20, 1.0, 1.0), (1.0, 2.0**8, 1.0), (1.0, 1.0, 2.0**12))
"""Of mass, length and time: powers of two, which rounding does not see."""


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::jaxsat.scenario.ScenarioWarning")
@pytest.mark.parametrize("name", ["gyros", "a law of a user's own"])
def test_every_declared_unit_may_be_another(name, tmp_path, monkeypatch):
    """All keys times what their units become, defaults included: the motion is the same."""
    data = gyros.document() if name == "gyros" else of_the_page(tmp_path, monkeypatch)
    data["orbit"] = {"rate_rad_s": 0.0011}
    data["simulation"] |= {"duration_s": 10.0}
    scenario = Scenario.model_validate(data, context={"law": True})
    own = build(scenario).simulate().signals
    assert np.abs(np.diff(own.quaternion, axis=0)).max() > 1e-3
    for units in UNITS:
        other = build(in_units(scenario, units)).simulate().signals
        np.testing.assert_allclose(other.quaternion, own.quaternion, atol=1e-13)
        omega = np.asarray(other.omega) * units[2]
        np.testing.assert_allclose(omega, own.omega, atol=1e-13)
