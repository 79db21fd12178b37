"""Controllers of two kinds for tests of what surrounds them, and their files."""

from contextlib import contextmanager

import pytest

from jaxsat.core.declaration.keys import number
from jaxsat.flight import vectors
from jaxsat.flight.guard import guard_header
from jaxsat.flight.guard_source import guard_source
from jaxsat.flight.interface import Parameter
from jaxsat.flight.parameters import parameters_header, parameters_source
from jaxsat.flight.program import FlightProgram
from jaxsat.flight.source import header, source
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from tests.flight.laws import Filtered, loop_of, start

KEYS = (number("gain", "Gains", "N m s", above=0, at_most=50, size=2, tunable=True),)
GYRO = "gyro.bias_sigma_rad_s=1e-5"
TRACKER = "star_tracker={across_rad=1e-5, along_rad=1e-4}"


def filtered():
    """Loop, start and keys of a law that has much in it."""
    return loop_of(Filtered(gain=[3.0, 2.0])), start(), KEYS


def estimating(*sensors: str):
    """Those of a law of the library behind an estimator; `sensors` are overrides of the scenario,
    by default a gyro and a star tracker."""
    scenario = load("switching", [GYRO, *(sensors or (TRACKER,))])
    run = build(scenario)
    return run.loop, run.start, scenario.law.declaration.keys


def sources(program: FlightProgram, table: list[Parameter]) -> dict[str, str]:
    """The files of a controller, its guard and its parameters."""
    return {
        "controller.h": header(program, []),
        "controller.c": source(program, [], libm=False),
        "controller_guard.h": guard_header(program, []),
        "controller_guard.c": guard_source(program, []),
        "controller_parameters.h": parameters_header(table, []),
        "controller_parameters.c": parameters_source(program, table, []),
    }


@contextmanager
def few_samples():
    """Samples of two short runs, and few with extreme numbers."""
    with pytest.MonkeyPatch.context() as patch:
        for name, count in (("SAMPLES", 32), ("CASES", 2), ("LONGEST", 64), ("EDGES", 64)):
            patch.setattr(vectors, name, count)
        yield
