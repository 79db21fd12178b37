"""Scenarios are read and checked without JAX, so mistakes in them are told at once."""

import subprocess
import sys

PROGRAM = """
import sys
from jaxsat.scenario.build.load import load
from jaxsat.scenario import ScenarioError, dump, json_schema, library
for name in library():
    dump(load(name, purpose="text"))
json_schema()
try:
    load("rate-limited", ["control.k1=-1", "control.law_=x"])
except ScenarioError as error:
    print(len(error.problems))
print(sorted({"jax", "diffrax", "equinox", "optax", "scipy"} & set(sys.modules)))
"""


def test_all_scenarios_are_checked_without_jax():
    done = subprocess.run(
        [sys.executable, "-c", PROGRAM], capture_output=True, text=True, check=True
    )
    assert done.stdout.split("\n") == ["2", "[]", ""]
