"""The plan of exported flight code: its files, its upload in C, and its rows of the interface."""

import csv
import json
import re
import subprocess
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from helpers.tools import needs
from jaxsat.cli import main
from jaxsat.cli.scenarios import refusals
from jaxsat.control.plan_tracking import PlanTracking
from jaxsat.flight import vectors
from jaxsat.flight.files import export, export_plan
from jaxsat.flight.flight import CannotExport
from jaxsat.flight.request import Request
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.scenario.build.study import _with_library
from tests.flight.folders import write_files
from tests.flight.sizes import too_large

PROVENANCE = {"versions": {"jaxsat": "0"}, "platform": "here", "created": "now"}
STRICT = ["-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror"]
DRIVER = r"""
#include "later/plan.h"
#include <math.h>
#include <stdio.h>
#include <string.h>

static controller_parameters p, before;

static void load(controller_plan plan, uint32_t checksum)
{
  const int result = (int)controller_load_plan(&plan, checksum, &p);
  printf("%d %d\n", result, memcmp(&p, &before, sizeof(p)) == 0);
}

int main(void)
{
  controller_plan plan = controller_planned;
  (void)memcpy(&p, &controller_default_parameters, sizeof(p));
  (void)memcpy(&before, &p, sizeof(p));
  load(plan, CONTROLLER_PLAN_CHECKSUM + 1u);
  plan.torque[3][1] = (@REAL@)5.001;
  load(plan, CONTROLLER_PLAN_CHECKSUM);
  load(plan, controller_plan_checksum(&plan));
  plan = controller_planned;
  plan.rate_gain[31][1][2] = (@REAL@)NAN;
  load(plan, controller_plan_checksum(&plan));
  plan = controller_planned;
  plan.duration = 0;
  load(plan, controller_plan_checksum(&plan));
  plan = controller_planned;
  plan.attitude[31][0] = 0;
  plan.attitude[31][1] = 0;
  load(plan, controller_plan_checksum(&plan));
  load(controller_planned, CONTROLLER_PLAN_CHECKSUM);
  for (int i = 0; i < 32; i++) {
    for (int j = 0; j < 2; j++) {
      printf("%.17g %.17g\n", (double)p.law_plan_torque[i][j],
             (double)p.law_plan_rate_gain[i][j][2]);
    }
  }
  printf("%.17g %.17g\n", (double)p.law_plan_begin, (double)p.law_plan_duration);
  return 0;
}
"""


def request_of(*, single=False, law="planned"):
    run = build(load("acceptance-nominal", [f"control.law={law}"]))
    keys = load("acceptance-nominal", [f"control.law={law}"]).law.declaration.keys
    return Request(run.loop, run.start, 1.0, "", "", PROVENANCE, single, keys=keys)


@pytest.fixture(scope="module", params=[False, True], ids=["double", "single"])
def made(request, tmp_path_factory):
    """An export with few test vectors, and a folder with it and a later plan."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(vectors, "SAMPLES", 40)
        patch.setattr("jaxsat.flight.files.measured", lambda files: {})
        patch.setattr("jaxsat.flight.files.found_calls", lambda *given: given[3][:0])
        code = export(request_of(single=request.param))
    folder = tmp_path_factory.mktemp("flight")
    write_files(folder, code.files)
    write_files(folder / "later", export_plan(request_of(single=request.param), 600.0))
    return code, folder


def numbers_of(file: Path):
    """The arrays of a plan.csv by their fields, and its checksum."""
    rows = list(csv.DictReader(file.read_text().splitlines()))
    assert rows[-1]["field"] == "checksum"
    fields: dict[str, list[float]] = {}
    for row in rows[:-1]:
        fields.setdefault(row["field"], []).append(float(row["value"]))
    return {name: np.array(values) for name, values in fields.items()}, int(rows[-1]["value"], 16)


@needs("gcc")
@pytest.mark.slow
def test_the_tracker_agrees_with_its_vectors_and_a_plan_is_loaded_or_refused(made):
    code, folder = made
    assert too_large(code.files) == {}
    done = subprocess.run(["make", "all", "test", "fly", "CC=gcc"], cwd=folder, check=False)
    assert done.returncode == 0
    text = DRIVER.replace("@REAL@", "float" if code.program.single else "double")
    (folder / "driver.c").write_text(text)
    words = ["gcc", *STRICT, "-I.", "driver.c", "controller.c", "controller_plan.c"]
    subprocess.run([*words, "-o", "driver", "-lm"], cwd=folder, check=True)
    lines = subprocess.run(
        [folder / "driver"], capture_output=True, text=True, check=True
    ).stdout.splitlines()
    refused = ["3 1", "3 1", "1 1", "1 1", "1 1", "2 1"]
    assert lines[: len(refused)] == refused
    assert lines[len(refused)] == "0 0"
    table, _ = numbers_of(folder / "later" / "plan.csv")
    found = np.array([line.split() for line in lines[len(refused) + 1 :]], float)
    np.testing.assert_array_equal(found[:64, 0], table["torque"])
    np.testing.assert_array_equal(found[:64, 1], table["rate_gain"].reshape(64, 3)[:, 2])
    np.testing.assert_array_equal(found[64], [600.0, table["duration"][0]])


@pytest.mark.slow
def test_the_files_of_a_plan_have_the_numbers_of_the_parameters(made):
    code, folder = made
    kind = "<f4" if code.program.single else "<f8"
    for plan in (folder, folder / "later"):
        table, checksum = numbers_of(plan / "plan.csv")
        assert zlib.crc32(b"".join(x.astype(kind).tobytes() for x in table.values())) == checksum
        assert f"0x{checksum:08X}u" in (plan / "plan.h").read_text()
    table, _ = numbers_of(folder / "plan.csv")
    fields = {one.path: one for one in code.program.structs["parameters"].fields}
    for name, values in table.items():
        field = fields[f"law.plan.{name}"]
        kept = np.asarray(code.program.parameters[field.number], field.dtype)
        np.testing.assert_array_equal(values.astype(field.dtype), kept.ravel())
    rows = {
        row["path"]: row for row in csv.DictReader((folder / "icd.csv").read_text().splitlines())
    }
    torque = rows["law.plan.torque"]
    assert (torque["unit"], torque["range"], torque["dimensions"]) == ("N m", "-5 to 5", "32 x 2")
    assert rows["law.plan.duration"]["unit"] == "s"
    assert rows["control.kz"]["unit"] == "1/s"


@needs("gcc")
@pytest.mark.slow
def test_a_study_flies_the_tracker_in_the_loop(made):
    code, folder = made
    subprocess.run(["make", "build/libcontroller.so", "CC=gcc"], cwd=folder, check=True)
    run = build(load("acceptance-nominal", ["control.law=planned"]))
    outside, identity = _with_library(run, folder / "build" / "libcontroller.so")
    loop: Any = outside.loop
    record = json.loads(code.files["export.json"])
    assert identity["source_sha256"] == record["source_sha256"]
    assert isinstance(loop.controller.law, PlanTracking)


@pytest.mark.slow
def test_a_check_of_the_scenario_does_not_refuse_the_export():
    scenario = load("acceptance-nominal", ["control.law=planned"])
    assert not [line for line in refusals(scenario) if "export" in line]


def test_a_law_that_does_not_plan_has_no_plan():
    with pytest.raises(CannotExport, match="must be a law that plans, for a plan, got three-slew"):
        export_plan(request_of(law="three-slew"), 0.0)


@pytest.mark.slow
def test_the_command_writes_a_plan_alone(tmp_path):
    folder = tmp_path / "plan"
    words = ["export", "acceptance-nominal", "--set", "control.law=planned", "--plan-begin", "60"]
    with pytest.raises(SystemExit) as end:
        main([*words, "--out", str(folder), "--quiet"])
    assert not end.value.code
    assert {one.name for one in folder.iterdir()} >= {"plan.h", "plan.csv"}
    assert not (folder / "controller.c").exists()
    assert numbers_of(folder / "plan.csv")[0]["begin"] == [60.0]


@needs("frama-c")
@pytest.mark.slow
def test_frama_c_finds_no_run_time_error_with_a_plan_and_one_that_is_put_in(made, tmp_path):
    """Plans and parameters of many numbers are read to their ends, and not beyond, which is found
    in one precision: rows are the same in the other."""
    code, _ = made
    write_files(tmp_path, code.files)
    assert _alarms(tmp_path) == (0, [])
    if code.program.single:
        return
    place = tmp_path / "controller_plan.c"
    text = place.read_text()
    loop = "for (uint32_t i = 0u; i < row->count; i++)"
    assert text.count(loop) == 2
    place.write_text(text.replace(loop, loop.replace("<", "<=")))
    failed, lines = _alarms(tmp_path)
    assert failed
    assert all("controller_plan.c" in line for line in lines)
    assert len(lines) == 2


def _alarms(folder: Path) -> tuple[int, list[str]]:
    """Whether `make prove` fails, and the lines of alarms."""
    done = subprocess.run(["make", "prove"], cwd=folder, capture_output=True, text=True)
    return done.returncode, re.findall(r"^\[eva:alarm\].*", done.stdout, re.MULTILINE)
