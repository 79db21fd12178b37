"""The package itself: light to import, rooms on demand."""

import subprocess
import sys

import pytest

import jaxsat


def test_rooms_are_there_on_demand():
    assert jaxsat.controllability.analyse([1.0, 2.0, 2.5], [[1], [0], [0]]).rank == 2
    with pytest.raises(AttributeError, match="rooms"):
        _ = jaxsat.rooms


def test_import_is_light_and_switches_nothing():
    program = "import sys, jaxsat; print('jax' in sys.modules); import jax, jaxsat.simulation; "
    program += "print(jax.config.jax_enable_x64)"
    done = subprocess.run(
        [sys.executable, "-c", program], capture_output=True, text=True, check=True
    )
    assert done.stdout.split() == ["False", "False"]
