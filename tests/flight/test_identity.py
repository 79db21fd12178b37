"""A store keeps which flight code made it, and no other flight code continues it."""

import hashlib
import subprocess
from pathlib import Path
from typing import Any

import pytest

from helpers.tools import needs
from jaxsat.core.errors import LibraryError
from jaxsat.flight.external import Library
from jaxsat.flight.harness import ABI, library_source, records_header
from jaxsat.flight.program import flight_program
from jaxsat.flight.source import header, source
from jaxsat.flight.templates import template
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import build_study
from jaxsat.store.files import OutputError
from jaxsat.store.header import read_header
from jaxsat.store.store import StudyStore

SPREAD = "dispersion.inertia={distribution='uniform',low=-0.1,high=0.1}"
CHANGES = ["simulation.duration_s=2", "failure=[]", SPREAD]
STRONGER = "control.natural_frequency_rad_s=0.07"


def exported(folder: Path, *changes: str, single: bool = False) -> Path:
    """The folder with what the library is built of, without test vectors."""
    run = build(load("cubesat-12u", [*CHANGES, *changes]))
    program = flight_program(run.loop, run.start, single=single)
    texts = {
        "controller.h": header(program, []),
        "controller.c": source(program, [], libm=False),
        "controller_records.h": records_header(program, []),
        "controller_library.c": library_source(program, []),
        "Makefile": template("Makefile", ULP="0", DIFFERENCE="0"),
    }
    folder.mkdir()
    for name, text in texts.items():
        (folder / name).write_text(text)
    return folder


def library(folder: Path, *words: str) -> Path:
    command = ["make", "build/libcontroller.so", "CC=gcc", "CFLAGS=-O0", *words]
    subprocess.run(command, cwd=folder, check=True, capture_output=True)
    return folder / "build" / "libcontroller.so"


def identity(path: Path, *changes: str) -> dict[str, Any]:
    run = build(load("cubesat-12u", [*CHANGES, *changes]))
    return Library(path, run.loop, run.start).identity


@needs("gcc")
@pytest.mark.slow
def test_only_the_same_flight_code_continues_a_store(tmp_path):
    folder, store = exported(tmp_path / "first"), tmp_path / "store.zarr"
    first = library(folder)
    study = build_study(load("cubesat-12u", CHANGES), 2, engine="scan", chunk=1, controller=first)
    own, columns = study.identity(), study.columns()

    def open_store(path: Path) -> None:
        flown = {**own, "controller": identity(path)}
        with StudyStore(store, flown, columns, 2, 1, coordinates=study.coordinates()):
            pass

    with StudyStore(store, own, columns, 2, 1, coordinates=study.coordinates()):
        pass
    kept = read_header(store).identity["controller"]
    text = (folder / "controller.h").read_bytes() + (folder / "controller.c").read_bytes()
    assert kept["source_sha256"] == hashlib.sha256(text).hexdigest()
    assert kept["binary_sha256"] == hashlib.sha256(first.read_bytes()).hexdigest()
    assert (kept["abi"], kept["precision"]) == (ABI, "double")

    head, end, functions = (folder / "controller.c").read_text().partition("\n};\n")
    assert "(x != 0.0)" in functions
    (folder / "controller.c").write_text(
        head + end + functions.replace("(x != 0.0)", "(x != 1.0)", 1)
    )
    edited = library(folder).rename(tmp_path / "edited.so")
    assert changed(edited, kept) == {"source_sha256", "binary_sha256"}
    with pytest.raises(
        OutputError,
        match=r"another study \(controller\.binary_sha256: \S+ there, \S+ here; "
        r"controller\.source_sha256: \S+ there, \S+ here\); give another folder\.",
    ):
        open_store(edited)
    (folder / "controller.c").write_text(head + end + functions)
    again = library(folder).rename(tmp_path / "again.so")
    assert changed(again, kept) == set()
    open_store(again)  # the same code, built again
    optimised = library(folder, "-B", "CFLAGS=-O1").rename(tmp_path / "optimised.so")
    assert changed(optimised, kept) == {"binary_sha256"}
    single = library(exported(tmp_path / "single", single=True))
    assert changed(single, kept) == set(kept) - {"abi"}
    stronger = library(exported(tmp_path / "stronger", STRONGER))
    assert changed(stronger, kept) == {"source_sha256", "parameters_sha256", "binary_sha256"}


def changed(path: Path, kept: dict[str, Any]) -> set[str]:
    return {name for name, value in identity(path).items() if value != kept[name]}


@needs("gcc")
@pytest.mark.slow
def test_a_library_serves_other_studies_of_its_controller_alone(tmp_path):
    folder = exported(tmp_path / "flight")
    path = library(folder).rename(tmp_path / "flight.so")
    own = identity(path)
    other = ["spacecraft.inertia_kg_m2=[0.4, 0.5, 0.6]", "disturbance.constant_N_m=[0, 0, 1e-6]"]
    spread = "dispersion.omega_rad_s={distribution='uniform',low=-0.01,high=0.01}"
    assert identity(path, STRONGER, *other, spread, "simulation.duration_s=3") == own
    with pytest.raises(LibraryError, match="must be made of this scenario's controller"):
        run = build(load("switching"))
        Library(path, run.loop, run.start)
    with pytest.raises(LibraryError, match=r"no flight code: control\.law: must be a law"):
        run = build(load("paper-three-axis"))
        Library(path, run.loop, run.start)

    without = library(folder, "SHA256=").rename(tmp_path / "without.so")
    with pytest.raises(LibraryError, match=r"SHA-256 .* got none"):
        identity(without)
    text = (folder / "controller_library.c").read_text()
    (folder / "controller_library.c").write_text(text.replace(f'return "{ABI} ', 'return "7 '))
    later = library(folder)
    with pytest.raises(LibraryError, match=f"must have ABI version {ABI}, got 7"):
        identity(later)
    with later.open("ab") as file:
        file.write(b"built again")
    with pytest.raises(LibraryError, match="start another process"):
        identity(later)
