"""Packages that were frozen at a release, with numbers of that release: both must stay."""

import ast
import hashlib
import json
import os
import pkgutil
import subprocess
import sys

import numpy as np
import pytest

from scenario.packages import FROZEN, PACKAGE, install_package

FLOWN = """
import json, sys, warnings
warnings.simplefilter("error", DeprecationWarning)
import jax
import numpy as np
jax.config.update("jax_enable_x64", True)
import jaxsat

scenario = jaxsat.load(sys.argv[1])
flight = jaxsat.fly(scenario).dataset
values = jaxsat.build_study(scenario, 4, seed=1).values(np.arange(4))
ends = {name: np.asarray(flight[name])[-1].tolist() for name in sys.argv[2].split()}
print(json.dumps([ends, {name: np.asarray(values[name]).tolist() for name in sys.argv[3].split()}]))
"""
"""Flies a scenario and a study of it, whose draws have one value each."""

RELEASE_0_2 = {
    "all-parts": (
        {
            "w": [-0.084564, -0.152898],
            "omega": [6.67307e-3, 13.88688e-3, 3.416e-5],
            "rate_estimate_error": [-2.845e-5, 1.2466e-5, -3.08e-6],
        },
        {
            "w": [-0.083040, -0.152545],
            "omega": [6.54318e-3, 13.84594e-3, 3.4825e-5],
            "requirement_margin": [0.092398],
        },
    ),
    "flywheels-in-air": (
        {
            "w": [0.00504543, 0.01411406],
            "flywheel_momentum": [0.11140431, -0.09197960, 0.04924283],
            "rate_estimate_error": [-5.3338e-5, 4.2618e-5, -1.48412e-5],
        },
        {
            "w": [-0.00434526, 0.01506130],
            "peak_flywheel_momentum": [0.3278173, 0.1, 0.1963689],
            "requirement_margin": [-0.0278173, 0.0267226],
            "failure_amount": [0.25, np.nan],
        },
    ),
    "beacon": (
        {
            "w": [7.05832e-4, 4.42462e-4],
            "attitude_estimate_error": [1.318480e-3, 1.005532e-3, 5.63026e-4],
            "sensor_excluded": [0.0, 1.0, 0.0],
        },
        {"sensor_exclusions": [0.0, 1.0, 0.0]},
    ),
}
"""At the end of the flight, and of each case of the study."""

DIGEST = "5dbd37659e6ecddb323a3ea9c02ae1eba5c5d9952e6ad22036aa49c409982e5e"
"""SHA-256 of the paths and texts of the packages."""


def test_packages_of_0_2_are_as_they_were():
    """Not even to suit a later jaxsat: it accepts what they do for one release, with a warning."""
    found = [*FROZEN.rglob("*.py"), *FROZEN.rglob("*.toml")]
    texts = {file.relative_to(FROZEN).as_posix(): file.read_text("utf-8") for file in found}
    text = "".join(f"{name}\n{texts[name]}" for name in sorted(texts))
    assert hashlib.sha256(text.encode()).hexdigest() == DIGEST


def test_what_packages_of_0_2_import_is_there():
    names = set()
    for file in FROZEN.rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and str(node.module).startswith("jaxsat"):
                names |= {f"{node.module}:{one.name}" for one in node.names}
    assert "jaxsat.spacecraft.effector:AbstractEffector" in names
    for name in names:
        pkgutil.resolve_name(name)


@pytest.mark.slow
@pytest.mark.parametrize("name", RELEASE_0_2)
def test_packages_of_0_2_fly_as_they_did(tmp_path, monkeypatch, name):
    install_package(tmp_path, monkeypatch, PACKAGE)
    install_package(tmp_path, monkeypatch, FROZEN / "flywheels")
    install_package(tmp_path, monkeypatch, FROZEN / "ground-beacon")
    ends, values = RELEASE_0_2[name]
    command = [
        sys.executable,
        "-c",
        FLOWN,
        FROZEN / f"{name}.toml",
        " ".join(ends),
        " ".join(values),
    ]
    done = subprocess.run(command, capture_output=True, text=True, env=dict(os.environ))
    assert done.returncode == 0, done.stderr
    flight, study = json.loads(done.stdout)
    for quantity, expected in ends.items():
        np.testing.assert_allclose(flight[quantity], expected, rtol=1e-3, atol=1e-7)
    for quantity, expected in values.items():
        each = np.broadcast_to(expected, (4, len(expected)))
        np.testing.assert_allclose(np.array(study[quantity], float), each, rtol=1e-3, atol=1e-7)
