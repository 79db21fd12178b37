"""Scenario files: TOML, validated, built into the objects of the core."""

from jaxsat.scenario.build import Run, build
from jaxsat.scenario.dump import dump, json_schema
from jaxsat.scenario.errors import Problem, ScenarioError, ScenarioWarning
from jaxsat.scenario.load import library, load
from jaxsat.scenario.schema import Scenario

__all__ = [
    "Problem",
    "Run",
    "Scenario",
    "ScenarioError",
    "ScenarioWarning",
    "build",
    "dump",
    "json_schema",
    "library",
    "load",
]
