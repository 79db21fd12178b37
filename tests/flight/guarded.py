"""The guarded C of a closed loop, and runs of the plant under it with faults in measurements."""

import ctypes
import subprocess
from pathlib import Path
from typing import Any, NamedTuple

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from jaxsat.control.navigation.estimator import AbstractEstimator, Estimate
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.attitude import Quaternion
from jaxsat.flight import vectors
from jaxsat.flight.flight import Input, Seen
from jaxsat.flight.guard import groups, guard_header, status_bits
from jaxsat.flight.guard_source import guard_source
from jaxsat.flight.harness import records_header
from jaxsat.flight.measurements import Measured
from jaxsat.flight.program import FlightProgram, flight_program
from jaxsat.flight.source import header, source
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.wheels import wheel_momentum

ROWS = r"""
#include "controller_guard.h"
#include "controller_records.h"

static controller_guard guards[8];
static controller_state states[8];
static controller_output out;
static controller_guard_parameters limits;

void begin(int which, int hold, const double *attitude);
void begin(int which, int hold, const double *attitude)
{
  @BEGIN@
  limits = controller_default_guard_parameters;
  limits.hold_samples = hold;
}

unsigned guarded(int which, const double *row, const bool *flags, double *commands, double *state);
unsigned guarded(int which, const double *row, const bool *flags, double *commands, double *state)
{
  controller_input in;
  const controller_validity valid = {@VALID@};
  read_controller_input(row, &in);
  const unsigned status = controller_guard_step(&controller_default_parameters, &limits, &in,
                                                &valid, &guards[which], &out);
  write_controller_output(&out, commands);
  write_controller_state(&guards[which].state, state);
  return status;
}

void plain(int which, int first, const double *row, const double *attitude, double *commands,
           double *state);
void plain(int which, int first, const double *row, const double *attitude, double *commands,
           double *state)
{
  controller_input in;
  read_controller_input(row, &in);
  if (first != 0) {
    @INIT@
  }
  controller_step(&controller_default_parameters, &in, &states[which], &out);
  write_controller_output(&out, commands);
  write_controller_state(&states[which], state);
}
"""


class Guarded:
    """The compiled guard and controller of a loop, for eight controllers beside each other."""

    def __init__(self, folder: Path, loop: Any, start: PlantState, *, single: bool = False):
        self.program: FlightProgram = flight_program(loop, start, single=single)
        real = "float" if single else "double"
        given, copied = "", "(void)attitude;"
        if self.program.estimates:
            copied = f"{real} q[4]; for (int i = 0; i < 4; i++) {{ q[i] = ({real})attitude[i]; }}"
            given = "q, "
        begin = f"{copied} controller_guard_init({given}&guards[which]);"
        init = f"{copied} controller_init(&controller_default_parameters, {given}&in, "
        flags = ", ".join(f"flags[{n}]" for n, _ in enumerate(groups(self.program)))
        driver = ROWS.replace("@BEGIN@", begin).replace("@INIT@", f"{init}&states[which]);")
        files = {
            "controller.h": header(self.program, []),
            "controller.c": source(self.program, [], libm=False),
            "controller_guard.h": guard_header(self.program, []),
            "controller_guard.c": guard_source(self.program, []),
            "controller_records.h": records_header(self.program, []),
            "rows.c": driver.replace("@VALID@", flags),
        }
        for name, text in files.items():
            (folder / name).write_text(text)
        command = "gcc -O0 -std=c99 -Wall -Wextra -Wconversion -pedantic -Werror -shared -fPIC"
        command += " -ffp-contract=off rows.c controller.c controller_guard.c -o guarded.so -lm"
        built = subprocess.run(command.split(), cwd=folder, capture_output=True, text=True)
        assert built.returncode == 0, built.stderr
        self.library = ctypes.CDLL(str(folder / "guarded.so"))
        self.library.guarded.restype = ctypes.c_uint
        self.bits = {
            name.removeprefix("CONTROLLER_STATUS_"): bit
            for name, (bit, _) in status_bits(self.program).items()
        }
        structs = self.program.structs
        self.sizes = structs["output"].size, structs["state"].size
        self.torques = structs["output"].fields[0].size
        self.groups = [group.name for group in groups(self.program)]

    def begin(self, which: int, hold: int = 10, attitude=(1.0, 0.0, 0.0, 0.0)) -> None:
        """Begin a guard anew."""
        q = np.asarray(attitude, float)
        self.library.begin(which, hold, q.ctypes.data_as(ctypes.c_void_p))

    def step(self, which: int, row, invalid: frozenset[str] = frozenset()):
        """Status, commands and state of a guarded sample."""
        row = np.ascontiguousarray(row, float)
        flags = np.array([name not in invalid for name in self.groups])
        commands, state = (np.zeros(size) for size in self.sizes)
        pointers = [x.ctypes.data_as(ctypes.c_void_p) for x in (row, flags, commands, state)]
        return self.library.guarded(which, *pointers), commands, state

    def plain(self, which: int, first: bool, row, attitude=(1.0, 0.0, 0.0, 0.0)):
        """Commands and state of a sample without the guard."""
        row, q = np.ascontiguousarray(row, float), np.asarray(attitude, float)
        commands, state = (np.zeros(size) for size in self.sizes)
        pointers = [x.ctypes.data_as(ctypes.c_void_p) for x in (row, q, commands, state)]
        self.library.plain(which, int(first), *pointers)
        return commands, state

    def places(self, group: str) -> list[int]:
        """Where the numbers of a measurement are in an input."""
        found, place = [], 0
        for field in self.program.structs["input"].fields:
            if field.path.split(".")[0] == group:
                found += range(place, place + field.size)
            place += field.size
        return found


class _Commanded(AbstractSampledController):
    """Commands what its memory is."""

    period: Any
    first: Any

    def init(self, state):
        return self.first

    def step(self, t, state, memory):
        return memory, memory


class _Measuring(AbstractEstimator):
    """Tells what is measured, and remembers it."""

    def init(self, attitude, sigma):
        rate = jnp.zeros(3)
        return Measured(rate, attitude.q, jnp.array(False))

    def step(self, sample, period, measurement, memory):
        attitude, rate = measurement.attitude, measurement.rate
        return Estimate(attitude, rate), Measured(rate, attitude.q, measurement.seen)


class Flights:
    """Equal plants side by side, each under a guarded controller of its own."""

    def __init__(self, loop: SampledLoop, start: PlantState, guarded: Guarded, count: int):
        self.guarded, self.count, self.number = guarded, count, 0
        self.length = float(np.asarray(loop.controller.period))
        law = _Commanded(loop.controller.period, jnp.zeros(guarded.torques))
        loop = eqx.tree_at(lambda x: x.controller, loop, law)
        if loop.navigation is not None:
            loop = eqx.tree_at(lambda x: x.navigation.estimator, loop, _Measuring())
        first = loop.start(start)
        self.state: Any = jax.tree.map(lambda x: jnp.stack([jnp.asarray(x)] * count), first)

        def rows(number, state):
            told = loop.law_input(number, state)
            measured: Any = Seen(told.state.attitude, told.state.omega, wheel_momentum(told.state))
            if told.navigation is not None:
                momentum = wheel_momentum(told.state)
                measured = told.navigation.memory._replace(wheel_momentum=momentum)
            now = Input(number, measured)
            leaves = [jnp.ravel(x).astype(float) for x in jax.tree.leaves(now)]
            return jnp.concatenate(leaves)

        def after(number, state, command):
            given = state._replace(memory=command)
            return vectors._after(loop, number, self.length, given)

        self._rows = jax.jit(jax.vmap(rows, (None, 0)))
        self._after = jax.jit(jax.vmap(after, (None, 0, 0)))

    def period(self, faults) -> list[int]:
        """One period; `faults(number, which, row)` may change a row and tells what is flagged.

        All commands are finite.
        """
        number = jnp.asarray(self.number)
        rows = np.array(self._rows(number, self.state))
        commands, status = [], []
        for which, row in enumerate(rows):
            flagged = faults(self.number, which, row)
            told, found, _ = self.guarded.step(which, row, flagged)
            assert np.isfinite(found).all(), (self.number, which)
            commands.append(found[: self.guarded.torques])
            status.append(told)
        self.state = self._after(number, self.state, np.array(commands))
        self.number += 1
        return status


FAULTS = ("none", "not a number", "gap", "infinite", "zero quaternion", "skipped", "repeated")
"""Faults of measurements in `faulty_flights`, one a flight."""


class FaultyFlights(NamedTuple):
    """Status of each sample and flight, and the plants at the end."""

    status: np.ndarray
    plant: Any


def faulty_flights(
    loop: SampledLoop, start: PlantState, guarded: Guarded, duration: float
) -> FaultyFlights:
    """Flights for a duration (s), each with one of `FAULTS`, from 10 s on.

    The gap has 50 samples, infinite rates 5, and zero quaternions 20.
    """
    flights = Flights(loop, start, guarded, len(FAULTS))
    for which in range(len(FAULTS)):
        guarded.begin(which, attitude=start.attitude.as_quaternion().q)
    rate = guarded.places("rate" if guarded.program.estimates else "omega")
    attitude = guarded.places("attitude")
    begin = round(10 / flights.length)

    def faults(number: int, which: int, row: np.ndarray) -> frozenset[str]:
        since, fault = number - begin, FAULTS[which]
        if fault == "not a number" and since == 0:
            row[rate[1]] = np.nan
        elif fault == "gap" and 0 <= since < 50:
            row[rate] = row[attitude] = np.nan
        elif fault == "infinite" and 0 <= since < 5:
            row[rate] = np.inf
        elif fault == "zero quaternion" and 0 <= since < 20:
            row[attitude] = 0.0
        elif fault == "skipped" and since >= 0:
            row[0] += 3
        elif fault == "repeated" and since == 0:
            row[0] -= 1
        return frozenset()

    status = np.array([flights.period(faults) for _ in range(round(duration / flights.length))])
    return FaultyFlights(status, flights.state.plant)


def pointing_errors(plant: Any) -> np.ndarray:
    """Angles (deg) between the body frames of plants and the orbit frame."""
    q: Quaternion = jax.vmap(lambda one: one.as_quaternion())(plant.attitude)
    return np.degrees(2 * np.arccos(np.minimum(1.0, np.abs(np.asarray(q.q)[:, 0]))))


def check_status(flown: FaultyFlights, guarded: Guarded, length: float) -> None:
    """Each fault is told, commands are held for 10 samples and zero after, as long as it lasts."""
    status, bits = flown.status, guarded.bits
    begin = round(10 / length)
    waited = 0 if guarded.program.estimates else 20
    waits = ((status & (bits["HELD"] | bits["ZERO"])) != 0).sum(axis=0)
    assert waits.tolist() == [0, 1, 50, 5, waited, 0, 1]
    zeros = ((status & bits["ZERO"]) != 0).sum(axis=0)
    assert zeros.tolist() == [0, 0, 40, 0, max(0, waited - 10), 0, 0]
    assert (status[begin : begin + 20, 4] & bits["INVALID_ATTITUDE"]).any()
    told = {name: np.argwhere(status & bits[name]).tolist() for name in ("SKIPPED", "REPEATED")}
    assert told["REPEATED"] == [[begin, 6]]
    assert told["SKIPPED"] == [[begin, 5], [begin + 1, 6]]
