"""sampled.c, pulsed.c and what they are given: cases and numbers of a study."""

import ctypes

import diffrax
import equinox as eqx
import jax
import numpy as np
from hand_written import POINTER, WHOLE, address, library

from jaxsat.compiler.functions import error_function
from jaxsat.control.demands import MorinSamson
from jaxsat.control.oscillatory import Oscillator
from jaxsat.core.declaration.failures import FailureKind
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.engine.fixed import SampledStepper
from jaxsat.simulation.engine.native import NativeEngine
from jaxsat.spacecraft.actuators import Actuators
from jaxsat.spacecraft.modulation import PulseWidth
from jaxsat.spacecraft.pulsed_thrusters import PulsedThrusters
from jaxsat.studies.ensemble import Study
from pulses import study_of

COLUMNS = 11
USED = 2
"""More columns of pulsed.c: propellant and openings."""


def sampled_study(count: int, duration: float) -> Study:
    """acceptance-hard with the oscillatory law."""
    return build_study(load("acceptance-hard", _changes(duration)), count, seed=1)


def sampled_engine(workers: int) -> NativeEngine:
    """One step of Bogacki and Shampine's third order a period, as the scenario has it."""
    return NativeEngine(SampledStepper(diffrax.Bosh3()), workers=workers)


def pulsed_study(count: int, duration: float) -> Study:
    """The same with six thrusters that push, pulse-width modulation and a failure."""
    return study_of(True, False, count, _changes(duration))


def _changes(duration: float) -> list[str]:
    cost = "simulation.attitude_cost=wz"
    return ["control.law='oscillatory'", cost, f"simulation.duration_s={duration}"]


class Sampled:
    """sampled.c, for the cases of a study, or pulsed.c where thrusters push."""

    def __init__(self, study: Study, count: int):
        actuators = study.case_factory.loop.plant.effectors[0]
        pulsed = isinstance(actuators, PulsedThrusters)
        self.columns = COLUMNS + (USED if pulsed else 0)
        program, cases = study.program, study.cases(np.arange(count))
        assert program.cost.unsettled is None
        assert program.cost.limit is None
        self.periods = program.intervals
        copies = jax.jit(
            jax.vmap(lambda case: eqx.filter(program.case_factory(case, None), eqx.is_array))
        )(cases)
        self.rows, self.keys = _rows(copies), np.ascontiguousarray(copies.loop.sensors.key)
        one = jax.tree.map(lambda x: np.asarray(x[0]), copies.loop)
        self.numbers = _numbers(one, program)
        if pulsed:
            self.numbers = np.concatenate([self.numbers, _of_pulses(actuators)])
        self.function = library("pulsed" if pulsed else "sampled", _coefficients()).sampled
        self.function.argtypes = [*[POINTER] * 3, *[WHOLE] * 3, POINTER]
        self.function.restype = None

    def run(self, start, torque, gains, results, begin: int, end: int) -> None:
        """Fill the rows `begin` to `end` of the results; all else it has already."""
        del start, torque, gains
        keys = self.keys.ctypes.data_as(ctypes.c_void_p)
        given = (address(self.rows), keys, address(self.numbers))
        self.function(*given, self.periods, begin, end, address(results))


def _rows(copies) -> np.ndarray:
    """Inertia, axes, disturbance and start of every case."""
    plant, start = copies.loop.plant, copies.start
    wave = plant.disturbance
    inertia = np.asarray(plant.spacecraft.inertia)[:, *np.triu_indices(3)]
    actuators = copies.loop.plant.effectors[0]
    pulsed = isinstance(actuators, PulsedThrusters)
    axes = np.asarray(actuators.thrusters.torque if pulsed else actuators.torque_axes)
    axes = axes.reshape(len(axes), -1)
    rest = [wave.amplitude, wave.frequency, wave.phase, start.attitude.q, start.omega]
    return np.ascontiguousarray(np.concatenate([inertia, axes, *rest], axis=1))


def _numbers(loop, program) -> np.ndarray:
    """The fields of `Numbers` in order."""
    law, sensors, handover = loop.controller, loop.sensors, loop.controller.fine.handover
    early, late = law.fine.oscillator, law.fine.end_game
    filtering, fit = law.estimator.observer, law.estimator.least_squares
    form, orbit = early.form, early.form.model.orbit
    inertia = np.asarray(form.model.spacecraft.inertia)
    moments = np.diag(inertia)
    assert np.array_equal(inertia, np.diag(moments))
    assert np.array_equal(form.axes, np.eye(3))
    assert np.array_equal(form.to_command, np.eye(2))
    assert orbit.rate > 0
    assert not law.fine.fade_lean
    assert fit.samples == 10
    shared, again = ([x.frequency, x.tilt_gain, x.rate_gain] for x in (early, late))
    assert np.array_equal(shared, again)
    if isinstance(loop.plant.effectors[0], Actuators):
        assert np.array_equal(loop.plant.effectors[0].thrust_map, np.eye(2))
        assert loop.plant.effectors[0].limit == law.torque_limit
    parts = [
        *(orbit.rate, *moments, *shared, *_of_oscillator(early), *_of_oscillator(late)),
        *(handover.enter_rate, handover.enter_angle, handover.enter_turn),
        *(handover.leave_tilt, handover.leave_turn),
        *(filtering.frequency, filtering.noise, filtering.amplitude, filtering.drift),
        *(filtering.product_error, filtering.lean_error, *fit.prior, fit.noise),
        *(law.torque_limit, law.period, sensors.rate_noise, sensors.attitude_noise),
        *(program.tolerances.w, program.tolerances.z, program.tolerances.relative_rate),
        *(program.cost.w, program.cost.z, program.cost.relative_rate, program.cost.torque),
    ]
    return np.array([float(x) for x in parts])


def _of_oscillator(oscillator: Oscillator) -> tuple:
    """The fields of `Oscillator` in order."""
    demand = oscillator.demand
    assert isinstance(demand, MorinSamson)
    own = oscillator.largest_amplitude, oscillator.ratio, oscillator.dead_zone
    return demand.k3, demand.damping, demand.rest, *own


def _of_pulses(actuators: PulsedThrusters) -> np.ndarray:
    """The fields for thrusters that push: pairs about x, y and z, the first of which degrades."""
    thrusters, failures = actuators.thrusters, actuators.failures
    assert isinstance(actuators.modulation, PulseWidth)
    assert not thrusters.ramps
    torque = np.asarray(thrusters.torque)
    assert np.array_equal(np.sign(torque), np.kron(np.eye(3), [1, -1]))
    assert failures is not None
    assert (failures.number, failures.kind) == (0, FailureKind.DEGRADED)
    on_time = np.unique(np.asarray(thrusters.min_on_time))
    flow = np.broadcast_to(np.asarray(thrusters.flow), 6)
    full = np.abs(torque).sum(axis=0)[:4]
    return np.concatenate([full, on_time, flow, np.asarray(failures.at), failures.amount])


def _coefficients() -> str:
    """Those of the inverse error function as C constants."""
    lines = []
    for name in ("CENTRAL", "TAIL"):
        numbers = getattr(error_function, f"_ERF_INV_{name}")
        inside = ", ".join(map(repr, numbers))
        lines.append(f"enum {{ {name}S = {len(numbers)} }};")
        lines.append(f"static const double {name}[{name}S] = {{{inside}}};")
    return "\n".join(lines)
