"""Flight code with actuators that a steering commands beside the law."""

import dataclasses
import subprocess
from typing import Any

import jax.numpy as jnp
import numpy as np
import pytest

from helpers.gyros import document
from helpers.tools import needs
from jaxsat.flight import vectors
from jaxsat.flight.files import export
from jaxsat.flight.flight import CannotExport, FlightController, Input, Seen, State
from jaxsat.flight.program import flight_program
from jaxsat.flight.request import Request
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.run import build
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.effector import AbstractEffector, Effect
from jaxsat.spacecraft.steering import AbstractSteering, Steered
from tests.flight.folders import write_files

PROVENANCE = {"versions": {"jaxsat": "0"}, "platform": "here", "created": "now"}


class Vanes(AbstractEffector):
    """Devices of a package, whose command has a name of its own in flight code."""

    kind = "vane"
    columns: jnp.ndarray
    failures: None = None

    @property
    def count(self):
        return self.columns.shape[1]

    def driven(self, state, command, struck):
        return self, command

    def piece(self, mode, command):
        return command

    def effect(self, piece, t, plant, state):
        return Effect(self.columns @ piece)

    def flight_commands(self, use, memory, period):
        return {"vane_angle": use}, memory


class Unnamed(Vanes):
    """Vanes without a command for flight code."""

    def flight_commands(self, use, memory, period):
        return {}, memory


class Taken(Vanes):
    """Vanes whose command has the name of the law's."""

    def flight_commands(self, use, memory, period):
        return {"torque": use}, memory


class Hinges(AbstractSteering):
    """Half of a torque, by vanes that turn with time."""

    kind = "vane"

    def __call__(self, t, state, command):
        return jnp.cos(t) * command / 2, command / 2


def with_vanes(vanes) -> Any:
    run = build(Scenario.model_validate(document()))
    plant = run.loop.plant.with_effectors((vanes,))
    loop = dataclasses.replace(run.loop, plant=plant, distribution=Steered((Hinges(),), None))
    return loop, PlantState(run.start.attitude, run.start.omega, (None,))


def test_dipoles_are_those_of_the_simulation_at_any_sample():
    """The field turns by a quarter of an orbit."""
    run: Any = build(load("wheel-and-rods"))
    flight, first = FlightController.of(run.loop), run.loop.start(run.start)
    state, dipoles = State(first.memory), []
    for number in (0, 700):
        t = jnp.array(number * float(run.loop.controller.period))
        shares, _ = run.loop._shares(t, run.start, first.memory)
        out, _ = flight.sample(Input(jnp.array(number), Seen.of(run.start)), state)
        kinds = [one.kind for one in run.loop.plant.effectors]
        use = shares.uses[kinds.index("magnetorquer")]
        np.testing.assert_allclose(out.dipole, use, rtol=1e-12)
        dipoles.append(np.asarray(use))
    assert np.abs(dipoles[1] - dipoles[0]).max() > 1e-3 * np.abs(dipoles[0]).max()


def test_commands_of_a_package_have_their_own_output():
    loop, start = with_vanes(Vanes(columns=jnp.eye(3)))
    flight = FlightController.of(loop)
    state = State(flight.begin_law(Seen.of(start)))
    out, _ = flight.sample(Input(jnp.array(3), Seen.of(start)), state)
    t = 3 * float(np.asarray(loop.controller.period))
    np.testing.assert_allclose(out.vane_angle, np.cos(t) * np.asarray(out.torque) / 2, rtol=1e-12)
    fields = {one.path: one.shape for one in flight_program(loop, start).structs["output"].fields}
    assert fields["vane_angle"] == (3,)


@pytest.mark.parametrize(
    ("vanes", "said"),
    [(Unnamed, "in Unnamed, got none"), (Taken, "in Taken, got torque")],
)
def test_commands_without_a_name_of_their_own_are_refused(vanes, said):
    loop, start = with_vanes(vanes(columns=jnp.eye(3)))
    with pytest.raises(CannotExport, match=f"vane: .* without `flight_commands` .* {said}"):
        flight_program(loop, start)


def test_a_steering_by_a_state_that_is_not_measured_is_refused():
    run = build(Scenario.model_validate(document()))
    with pytest.raises(CannotExport, match=r"gimbal: .* got GimbalSteering: .* states of gyros"):
        flight_program(run.loop, run.start)


@needs("gcc")
@pytest.mark.slow
@pytest.mark.parametrize("single", [False, True])
def test_dipoles_agree_to_the_bit(tmp_path, monkeypatch, single):
    monkeypatch.setattr(vectors, "SAMPLES", 50)
    monkeypatch.setattr(vectors, "CASES", 2)
    monkeypatch.setattr("jaxsat.flight.files.measured", lambda files: {})
    monkeypatch.setattr("jaxsat.flight.files.found_calls", lambda *given: given[3][:0])
    run = build(load("wheel-and-rods"))
    request = Request(run.loop, run.start, 5.0, "", "", PROVENANCE, single=single)
    write_files(tmp_path, export(request).files)
    command = ["make", "test", "CC=gcc", "CFLAGS=-O1"]
    done = subprocess.run(command, cwd=tmp_path, capture_output=True, text=True)
    assert done.returncode == 0, done.stdout + done.stderr
    assert done.stdout.count(" 0 numbers differ") == 2
