"""A study starts quickly: nothing is imported or compiled that it has no use for."""

import subprocess
import sys

import pytest

PROGRAM = """
import sys
import jax
import numpy as np
jax.config.update("jax_enable_x64", True)
happened = []
jax.monitoring.register_event_duration_secs_listener(lambda name, *_, **__: happened.append(name))
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.store.store import StudyStore
study = build_study(load("benchmark-three-axis", purpose="study"), 100, engine="scan")
study.cases(np.arange(100)), study.columns()
assert "diffrax" not in sys.modules  # which a study needs to be traced, and no kernel that is kept
study.identity()
slow = {"matplotlib", "optax", "pandas", "scipy", "xarray"} & set(sys.modules)
print(sorted(slow), sum("backend_compile" in name for name in happened))
jax.numpy.arange(3.0) + 1
print(sum("backend_compile" in name for name in happened) > 0)
"""


@pytest.mark.slow
def test_a_study_starts_without_slow_imports_and_compilations():
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True
    )
    assert done.stdout.splitlines() == ["[] 0", "True"]
