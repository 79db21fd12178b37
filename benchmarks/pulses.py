"""What pulses cost: a study with six on/off thrusters beside the same with ideal torques.

    python benchmarks/pulses.py [CASES]

The same law, sensors, cases and duration, on one thread, by the native engine; with thrusters also
pulse-width modulation, allocation by least propellant and a failure in flight, and then with gyro,
star tracker and Kalman filter in place of white noise. Times are the least of several runs,
compiling left out. `native/compare.py --work pulsed` sets the pulses beside C written by hand.
"""

import sys
import tempfile
import time
from collections.abc import Sequence
from pathlib import Path

import diffrax
import jax
import numpy as np

from jaxsat.scenario import library
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.engine.fixed import SampledStepper
from jaxsat.simulation.engine.native import NativeEngine

SIX = "".join(
    f"""
[[thruster]]
torque_axis = {[sign * (axis == k) for k in range(3)]}
torque_N_m = 5
min_on_time_s = 0.005
specific_impulse_s = 220
"""
    for axis in range(3)
    for sign in (1, -1)
)
FAILURE = """
[[failure]]
of = "thruster 1"
at_s = 50
kind = "degraded"
fraction = 0.8
"""
FILTER = """
[gyro]
noise_density_rad_s_sqrt_Hz = 1.5e-5
bias_walk_rad_s2_sqrt_Hz = 3e-8
bias_sigma_rad_s = 2e-5

[star_tracker]
across_rad = 2.4e-5
along_rad = 1.2e-4
boresight = [0.0, 0.6, 0.8]
update_period_s = 0.5
latency_s = 0.2
"""
NOISE = """rate_noise_rad_s = 3e-05
attitude_noise_rad = 0.0001
"""
CHANGES = ("simulation.duration_s=100", "simulation.solver.substeps=1")
REPEATS = 5


def scenario_text(pulsed: bool, filtered: bool) -> str:
    """acceptance-hard, with ideal torques or six thrusters that push, white noise or a filter."""
    text = library()["acceptance-hard"].read_text(encoding="utf-8")
    if filtered:
        assert NOISE in text
        text = text.replace(NOISE, "") + FILTER
    if not pulsed:
        return text
    for line in (
        "thruster_torque_axes = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\n",
        "failed_thrusters = [3]\n",
    ):
        assert line in text
        text = text.replace(line, "")
    before, mark, after = text.partition("[orbit]")
    return f'{before}{SIX}{FAILURE}[modulation]\nkind = "pwm"\n\n{mark}{after}'


def study_of(pulsed: bool, filtered: bool, count: int, changes: Sequence[str] = CHANGES):
    """A study of the scenario, read from a file as a user would."""
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "scenario.toml"
        file.write_text(scenario_text(pulsed, filtered), encoding="utf-8")
        return build_study(load(file, changes), count, seed=1)


def processor_seconds(study, count: int) -> tuple[float, float]:
    """The least of several runs, and the mean effort (N m s) of their cases."""
    engine = NativeEngine(SampledStepper(diffrax.Bosh3()), workers=1)
    cases, best = study.cases(np.arange(count)), np.inf
    outputs = engine.evaluate(study.program, cases)
    for _ in range(REPEATS):
        begin = time.process_time()
        outputs = engine.evaluate(study.program, cases)
        best = min(best, time.process_time() - begin)
    return best, float(np.mean(outputs.effort))


def main() -> None:
    """Print the paces and their ratios."""
    count = int(sys.argv[1]) if len(sys.argv) > 1 else 512
    ideal = 0.0
    for name, pulsed, filtered in (
        ("ideal torques, white noise", False, False),
        ("pulses and a failure", True, False),
        ("pulses, a failure, filter", True, True),
    ):
        taken, effort = processor_seconds(study_of(pulsed, filtered, count), count)
        ideal = ideal or taken
        print(
            f"{name:28} {count / taken:6.0f} cases a processor second, "
            f"{taken / ideal:.2f} times as long, mean effort {effort:.1f} N m s",
            flush=True,
        )


if __name__ == "__main__":
    jax.config.update("jax_enable_x64", True)
    main()
