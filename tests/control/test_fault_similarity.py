"""The law that diagnoses has no number of its own that is right for one spacecraft only."""

import importlib.resources
import re

import numpy as np
import pytest

from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build

MASS, TIME = 64.0, 4.0
"""Inertia and torque, and every time, times these: powers of two, which rounding does not see."""

FACTORS = {
    "inertia_kg_m2": MASS,
    "constant_N_m": MASS / TIME**2,
    "force_N": MASS / TIME**2,
    **dict.fromkeys(("min_on_time_s", "valve_delay_s", "rise_time_s", "fall_time_s"), TIME),
    **dict.fromkeys(("at_s", "period_s", "duration_s", "save_every_s"), TIME),
    **dict.fromkeys(("natural_frequency_rad_s", "max_rate_rad_s", "rate_noise_rad_s"), 1 / TIME),
    "rate_rad_s": 1 / TIME,
}

SHORT = {"altitude_km = 500": "rate_rad_s = 0.0011", "at_s = 300": "at_s = 20"}
SHORT |= {"duration_s = 1200": "duration_s = 50", "save_every_s = 1": "save_every_s = 0.2"}


def scenario(folder, name, scaled):
    """That of the library, short and without dispersions, at its own or another scale."""
    text = (importlib.resources.files("jaxsat.scenario") / "library/failures-12u.toml").read_text()
    text = text[: text.index("[dispersion")]
    for old, new in SHORT.items():
        assert old in text
        text = text.replace(old, new)

    def times(match):
        key, value = match.group(1), match.group(2)
        factor = FACTORS.get(key, 1.0)
        return f"{key} = " + re.sub(
            r"-?[\d.]+(e-?\d+)?", lambda x: repr(float(x[0]) * factor), value
        )

    if scaled:
        text = re.sub(r"^(\w+) = ([-\[\d][^#\n]*)", times, text, flags=re.M)
        text = re.sub(r"^seed = .*", "seed = 12", text, flags=re.M)
    path = folder / f"{name}.toml"
    path.write_text(text)
    return load(str(path))


@pytest.mark.slow
def test_a_failure_at_another_scale_goes_the_same_way(tmp_path):
    """Inertia, torques and disturbance grow 64 times over, all times four times."""
    runs = [build(scenario(tmp_path, f"scale{s}", s)) for s in (False, True)]
    own, other = (run.simulate() for run in runs)
    kind = np.asarray(own.signals.parts["diagnosed_kind"])
    assert (kind[-1] >= 0).sum() == 1
    assert np.asarray(own.signals.omega).any()
    np.testing.assert_array_equal(kind, other.signals.parts["diagnosed_kind"])
    np.testing.assert_array_equal(own.signals.mode, other.signals.mode)
    np.testing.assert_allclose(own.signals.quaternion, other.signals.quaternion, atol=1e-9)
    np.testing.assert_allclose(own.signals.omega, np.asarray(other.signals.omega) * TIME, atol=1e-9)
