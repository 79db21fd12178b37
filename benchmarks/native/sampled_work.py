"""sampled.c and what it is given: the cases and numbers of a study of the oscillatory law."""

import ctypes

import diffrax
import equinox as eqx
import jax
import numpy as np
from hand_written import POINTER, WHOLE, address, library

from jaxsat.assembly.load import load
from jaxsat.assembly.study import build_study
from jaxsat.engine import NativeEngine, SampledStepper
from jaxsat.engine.native.functions import error_function
from jaxsat.montecarlo import Study

COLUMNS = 11


def sampled_study(count: int, duration: float) -> Study:
    """acceptance-hard with the oscillatory law."""
    changed = ["control.law='oscillatory'", f"simulation.duration_s={duration}"]
    return build_study(load("acceptance-hard", changed), count, seed=1)


def sampled_engine(workers: int) -> NativeEngine:
    """One step of Bogacki and Shampine's third order a period, as the scenario has it."""
    return NativeEngine(SampledStepper(diffrax.Bosh3()), workers=workers)


class Sampled:
    """sampled.c, for the cases of a study."""

    columns = COLUMNS

    def __init__(self, study: Study, count: int):
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
        self.function = library("sampled", _coefficients()).sampled
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
    axes = np.asarray(copies.loop.actuators.torque_axes).reshape(-1, 6)
    rest = [wave.amplitude, wave.frequency, wave.phase, start.attitude.q, start.omega]
    return np.ascontiguousarray(np.concatenate([inertia, axes, *rest], axis=1))


def _numbers(loop, program) -> np.ndarray:
    """The fields of `Numbers` in order."""
    law, sensors = loop.controller, loop.sensors
    assert np.array_equal(loop.actuators.thrust_map, np.eye(2))
    oscillator, handover = law.fine.oscillator, law.fine.handover
    demand, filtering, fit = oscillator.demand, law.estimator.observer, law.estimator.least_squares
    moments = np.diag(oscillator.form.model.spacecraft.inertia)
    assert loop.actuators.limit == law.torque_limit
    parts = [
        *(oscillator.form.model.orbit.rate, *moments, demand.k3, demand.damping, demand.rest),
        *(oscillator.frequency, oscillator.tilt_gain, oscillator.rate_gain),
        *(oscillator.largest_amplitude, oscillator.ratio, oscillator.dead_zone),
        *np.ravel(law.fine.end_game.gain),
        *(handover.enter_slow_rate, handover.enter_rate, handover.enter_angle),
        *(handover.leave_tilt, handover.leave_turn, handover.leave_rate),
        *(filtering.frequency, filtering.noise, filtering.amplitude, filtering.drift),
        *(filtering.product_error, filtering.lean_error, *fit.prior, fit.noise),
        *(law.torque_limit, law.period, sensors.rate_noise, sensors.attitude_noise),
        *(program.tolerances.w, program.tolerances.z, program.tolerances.relative_rate),
        *(program.cost.w, program.cost.z, program.cost.relative_rate, program.cost.torque),
    ]
    return np.array([float(x) for x in parts])


def _coefficients() -> str:
    """Those of the inverse error function as C constants."""
    lines = []
    for name in ("CENTRAL", "TAIL"):
        numbers = getattr(error_function, f"_ERF_INV_{name}")
        inside = ", ".join(map(repr, numbers))
        lines.append(f"enum {{ {name}S = {len(numbers)} }};")
        lines.append(f"static const double {name}[{name}S] = {{{inside}}};")
    return "\n".join(lines)
