"""Scenario files: TOML with units, validated, every mistake with its place. Needs no JAX."""

from jaxsat.scenario.dump import dump, json_schema
from jaxsat.scenario.errors import Problem, ScenarioError, ScenarioWarning
from jaxsat.scenario.read import library, read
from jaxsat.scenario.schema import Scenario

__all__ = [
    "Problem",
    "Scenario",
    "ScenarioError",
    "ScenarioWarning",
    "dump",
    "json_schema",
    "library",
    "read",
]
