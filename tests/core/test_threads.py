"""Whatever the package remembers for all threads: twenty that want it first get one and the same.

Machine code is in `compiler/test_cold_threads.py`.
"""

import itertools
import pickle
import threading
import warnings
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import jaxsat
from helpers.threads import at_once, made_once
from jaxsat.compiler import functions
from jaxsat.compiler.c import naming
from jaxsat.compiler.llvm.threads import _shared
from jaxsat.control import periodic_gain
from jaxsat.control.linear_motion import PHASES, TURNS, linear_motion
from jaxsat.control.planning import guesses
from jaxsat.controllability import lie, stuck_dipole
from jaxsat.controllability.cone import torque_cone
from jaxsat.controllability.rank import analyse
from jaxsat.core import process
from jaxsat.core.declaration import PartDeclaration
from jaxsat.core.declaration.laws import LAWS
from jaxsat.core.process import _ADDED, add_folders
from jaxsat.core.trees import _places
from jaxsat.report import facts
from jaxsat.scenario import control, plugins, wording
from jaxsat.scenario.optimisers import OptimiserSettings
from jaxsat.scenario.parts import named
from jaxsat.simulation.engine import runge_kutta
from jaxsat.simulation.engine.native import kernel_store
from jaxsat.spacecraft.environment.orbit import CircularOrbit, DipoleField
from jaxsat.store.provenance import _processor, _versions
from jaxsat.studies import designs, run, statistics
from jaxsat.synthesis.comparison.acceptance import ComparisonSetting, comparison_scenario
from jaxsat.synthesis.tuning import descent
from studies.studies import tumbling

NEW = itertools.count()


def new_law():
    return replace(LAWS["coast"], name=f"cold-{next(NEW)}")


def new_part():
    declaration = PartDeclaration("A part")
    return plugins.Part(f"cold-{next(NEW)}", plugins.ACTUATORS, declaration, "no:Place")


def motion_with_rods():
    field = DipoleField(CircularOrbit(1.1e-3, 1.2, 0.4, 0.7, 2.0))
    body = (np.diag([0.13, 0.11, 0.05]), field, np.eye(3), np.zeros(3))
    return linear_motion(*body, gravity_gradient=True)


def closed_loop_of_rods():
    return pickle.dumps((motion_with_rods(), np.ones((TURNS, PHASES, 3, 9))))


def design_of_a_dipole():
    """Of a body without inertia for a step, which one rod holds."""
    steps = stuck_dipole._Steps(np.zeros((6, 6)), np.eye(6, 3), np.zeros((6, 0)))
    made, opposed = np.ones((1, 2, 3, 1)), np.ones((1, 2, 3))
    bounds = stuck_dipole._Bounds(1.0, 0.5, np.zeros(0), np.zeros(0))
    return pickle.dumps((steps, made, opposed, bounds))


FUNCTIONS = [
    (control.table_of, lambda: (new_law(),)),
    (named.table_of_part, lambda: (named.ActuatorsTable, new_part())),
    (wording.dotted_keys, lambda: (control.ModelTable,)),
    (plugins.installed, lambda: (plugins.ESTIMATOR,)),
    (designs._hypercube, lambda: (0, "a", 10, 2)),
    (statistics._order_statistics, lambda: (100, 95.0)),
    (statistics.f_quantile, lambda: (3, 20, 0.9)),
    (guesses.random_numbers, lambda: (4,)),
    (periodic_gain._gains, lambda: (pickle.dumps((motion_with_rods(), 0.3, 1.0)),)),
    (periodic_gain._multipliers, lambda: (closed_loop_of_rods(),)),
    (stuck_dipole._least, lambda: (design_of_a_dipole(),)),
    (runge_kutta._named_tableau, lambda: ("heun",)),
    (descent._transformation, lambda: (OptimiserSettings(), 10)),
    (lie._monomials, lambda: (2,)),
    (naming._statements, lambda: (__file__,)),
    (naming._tree, lambda: (__file__,)),
    (facts._tables, lambda: ("[control]",)),
    (_versions, tuple),
    (_processor, tuple),
    (_places, lambda: (3,)),
    (functions.program, lambda: ("atan2", "float64", "float64")),
    (kernel_store._packages_and_sources, lambda: (Path(jaxsat.__file__).parent,)),
    (kernel_store._known_roots, tuple),
    (_shared, lambda: (-1,)),
]


NAMES = [function.__name__ for function, _ in FUNCTIONS]


@pytest.mark.parametrize(("function", "arguments"), FUNCTIONS, ids=NAMES)
def test_a_thing_is_made_once_by_the_threads_that_want_it_first(function, arguments):
    for _ in range(3):
        if function not in (control.table_of, named.table_of_part):
            function.cache_clear()  # tables that others have made are not to be made again
        these = arguments()
        made_once(lambda these=these: function(*these), function)


def analysis():
    return analyse([1.0, 2.0, 2.5], [[1], [0], [0]])


def chunk_work():
    study = tumbling()
    return run._ChunkWork(study, study.chunk, study.count, None, {})


PROPERTIES = [
    (lambda: torque_cone(np.eye(3)[:, :2], np.array([True, True])), "normal"),
    (analysis, "local"),
    (analysis, "linear"),
    (analysis, "away_from_rest"),
    (tumbling, "failures"),
    (chunk_work, "_program_here"),
]


SLOW = {"_program_here"}


@pytest.mark.parametrize(
    ("make", "name"),
    [
        pytest.param(make, name, id=name, marks=[pytest.mark.slow] if name in SLOW else [])
        for make, name in PROPERTIES
    ],
)
def test_a_property_is_found_once_by_the_threads_that_want_it_first(make, name):
    thing = make()
    for _ in range(2):
        made_once(lambda: getattr(thing, name), getattr(type(thing), name)._function)
        del vars(thing)[name]


def test_threads_add_one_folder(tmp_path, monkeypatch):
    monkeypatch.setattr("sys.path", [*jaxsat.core.process.sys.path])
    before = list(_ADDED)
    try:
        at_once(lambda: add_folders([str(tmp_path)]))
        assert [*before, str(tmp_path)] == _ADDED
    finally:
        _ADDED[:] = before


def test_a_study_is_drawn_and_read_without_filters_of_warnings(monkeypatch):
    """Python has one set of them for all threads; SciPy and scenarios warn nevertheless."""
    study = tumbling(design=designs.Sobol(3))
    study.cases(np.arange(2))  # imports SciPy
    with monkeypatch.context() as patched:
        patched.setattr(warnings, "catch_warnings", None)
        study.cases(np.arange(37))
        scenario = comparison_scenario(ComparisonSetting("hard", 3.0, "three-slew"))
    assert scenario.spacecraft.torque_limit_N_m == 3.0


def test_threads_leave_the_search_for_dead_cycles_as_it_was(monkeypatch):
    """Also where one comes in while another one goes out."""
    enabled, looked, left = process.gc.isenabled, threading.Event(), threading.Event()

    def slowly():
        found = enabled()
        if not found:
            looked.set()
            left.wait(0.2)
        return found

    def come():
        with process.no_collection():
            pass

    monkeypatch.setattr(process.gc, "isenabled", slowly)
    other = threading.Thread(target=come)
    with process.no_collection():
        other.start()
        assert looked.wait(60)
    left.set()
    other.join()
    assert enabled()
