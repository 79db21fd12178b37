"""Commands import no large package that they have no use for: each costs up to half a second."""

import json
import os
import subprocess
import sys

import pytest

STORES = {"numcodecs", "zarr"}
LABELS = {"pandas", "xarray"}
TABLES = {"h5py", *LABELS}
FIGURES = {"bokeh", "matplotlib"}
SOLVERS = {"diffrax", "optax", "scipy"}
CHECK = "scenarios check thruster-dies"
COMMANDS = {
    f"{CHECK} --set contrl.law=1": {"equinox", "jax", *STORES, *TABLES, *FIGURES, *SOLVERS},
    CHECK: {"numcodecs", *TABLES, *FIGURES, *SOLVERS},
    "controllability thruster-dies": {*STORES, *TABLES, *FIGURES, "optax", "scipy"},
}
"""What each must not have imported, nor those before it."""

COMPUTING = {
    "simulate paper-rate --out run": {
        *STORES,
        *LABELS,
        "bokeh",
        "diffrax",
        "optax",
        "scipy",
        "jaxsat.studies.ensemble",
    },
    "montecarlo failures-12u --case 1 --out case": {*LABELS, "bokeh", "optax"},
    "controllability thruster-dies --out reach": {*STORES, *LABELS, "bokeh", "optax", "scipy"},
    "montecarlo failures-12u -n 4": {
        "zarr",
        *TABLES,
        *FIGURES,
        "optax",
        "scipy",
        "jaxsat.control.planned",
    },
}

PROGRAM = """
import contextlib, io, json, sys
from jaxsat.cli.app import run
for line in sys.argv[1:]:
    with contextlib.redirect_stdout(io.StringIO()), contextlib.redirect_stderr(io.StringIO()):
        run(line.split())
    print(json.dumps(sorted(sys.modules)))
"""


def imports_of(lines, folder, **variables):
    """The modules that have been imported after each of several commands of one process."""
    command, environment = [sys.executable, "-c", PROGRAM, *lines], {**os.environ, **variables}
    done = subprocess.run(
        command, cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    return [set(json.loads(line)) for line in done.stdout.splitlines()]


def test_commands_that_fly_nothing(tmp_path):
    for (line, unwanted), modules in zip(
        COMMANDS.items(), imports_of(COMMANDS, tmp_path), strict=True
    ):
        assert "cyclopts" in modules
        assert ("jax" in modules) != ("contrl" in line)  # it has run
        assert unwanted & modules == set(), line


@pytest.mark.slow
@pytest.mark.parametrize("line", COMPUTING)
def test_commands_that_fly(line, tmp_path):
    """Also where a run compiles its program first."""
    variables = {"JAXSAT_CACHE_DIR": str(tmp_path / "empty")} if "simulate" in line else {}
    (modules,) = imports_of([line], tmp_path, **variables)
    assert "jaxsat.simulation.engine.native.kernel" in modules  # it has flown
    assert COMPUTING[line] & modules == set()
