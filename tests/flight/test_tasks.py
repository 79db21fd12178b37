"""The example of a task runs the controller once a period, against stubs of FreeRTOS."""

import subprocess

import numpy as np
import pytest

from helpers.tools import needs
from jaxsat.flight.files import freertos_task
from jaxsat.flight.guard import guard_header, status_bits
from jaxsat.flight.guard_source import guard_source
from jaxsat.flight.program import flight_program
from jaxsat.flight.source import header, source
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from tests.flight.laws import Clocked, loop_of, start

KERNEL = """
/* Stands for FreeRTOS.h of the FreeRTOS kernel 10: types and macros that tasks use. */
#ifndef STUB_FREERTOS_H
#define STUB_FREERTOS_H
#include <stdint.h>
typedef uint32_t TickType_t;
#define configTICK_RATE_HZ ((TickType_t)1000)
#define pdMS_TO_TICKS(ms) ((TickType_t)(((TickType_t)(ms) * configTICK_RATE_HZ) / 1000U))
#endif
"""
TASK = """
/* Stands for task.h of the FreeRTOS kernel 10: two functions of its public interface. */
#include "FreeRTOS.h"
TickType_t xTaskGetTickCount(void);
void vTaskDelayUntil(TickType_t *const pxPreviousWakeTime, const TickType_t xTimeIncrement);
"""
MAIN = r"""
#include "controller_guard.h"
#include "FreeRTOS.h"
#include "task.h"
#include <stdio.h>
#include <stdlib.h>
void read_sensors(controller_input *in, controller_validity *valid);
void write_commands(const controller_output *out, uint32_t status);
void controller_task(void *unused);
static TickType_t now = 77u;
static int calls;
TickType_t xTaskGetTickCount(void) { return now; }
void vTaskDelayUntil(TickType_t *const woken, const TickType_t ticks)
{
  *woken += ticks;
  now = *woken;
  if (++calls == 6) {
    exit(0);
  }
}
void read_sensors(controller_input *in, controller_validity *valid)
{
  const double rate[3] = {0.125, 0.25, 0.5};
  in->attitude_q[0] = 1.0;
  for (int i = 0; i < 3; i++) {
    in->omega[i] = rate[i];
  }
  valid->attitude = true;
  valid->omega = calls != 3;
}
void write_commands(const controller_output *out, uint32_t status)
{
  printf("%u %u %.17g\n", (unsigned)now, (unsigned)status, out->torque[0]);
}
int main(void)
{
  controller_task(NULL);
  return 1;
}
"""
STRICT = ["gcc", "-std=c99", "-Wall", "-Wextra", "-Wconversion", "-pedantic", "-Werror", "-I."]


def _write(folder, program, main=MAIN):
    files = {
        "controller.h": header(program, []),
        "controller.c": source(program, [], libm=False),
        "controller_guard.h": guard_header(program, []),
        "controller_guard.c": guard_source(program, []),
        "freertos_task.c": freertos_task(program),
        "FreeRTOS.h": KERNEL,
        "task.h": TASK,
        "main.c": main,
    }
    for name, text in files.items():
        (folder / name).write_text(text)


def _run(folder, *words) -> str:
    done = subprocess.run(words, cwd=folder, capture_output=True, text=True, check=False)
    assert done.returncode == 0, done.stderr
    return done.stdout


@needs("gcc")
def test_the_task_steps_once_a_period_and_tells_status(tmp_path):
    program = flight_program(loop_of(Clocked()), start())
    _write(tmp_path, program)
    sources = ["main.c", "freertos_task.c", "controller.c", "controller_guard.c"]
    _run(tmp_path, *STRICT, "-ffp-contract=off", *sources, "-o", "task", "-lm")
    rows = np.array(
        [line.split() for line in _run(tmp_path, tmp_path / "task").splitlines()], float
    )
    bits = {name: bit for name, (bit, _) in status_bits(program).items()}
    held = bits["CONTROLLER_STATUS_INVALID_OMEGA"] | bits["CONTROLLER_STATUS_HELD"]
    np.testing.assert_array_equal(rows[:, 0], 77 + 500 * np.arange(6))  # the law's 0.5 s
    np.testing.assert_array_equal(rows[:, 1], [0, 0, 0, held, 0, 0])
    np.testing.assert_array_equal(rows[:, 2], [0, 0.5, 1, 1, 2, 2.5])  # the time, held once


@needs("gcc")
@pytest.mark.parametrize("single", [False, True], ids=["double", "single"])
def test_the_task_of_a_controller_with_an_estimator_compiles(tmp_path, single):
    sensors = ["gyro.bias_sigma_rad_s=1e-5", "star_tracker={across_rad=1e-5, along_rad=1e-4}"]
    run = build(load("switching", sensors))
    _write(tmp_path, flight_program(run.loop, run.start, single=single))
    _run(tmp_path, *STRICT, "-c", "freertos_task.c")
