"""The same study on every kind of device that JAX finds here, and by machine code.

    python benchmarks/devices.py [SCENARIO ...] [--cases 4096] [--batch-size 4096] [--rounds 2]

Each scenario is flown by the native engine on all processors, and by the scan engine on each
kind of device. A row tells the seconds of the first run, which compiles, the least of further ones,
cases a second, and the largest differences of settled cases from the native engine: settling time
(s), effort (relative), final rates (rad/s); and how many cases end otherwise.
"""

import argparse
import time

import jax
import numpy as np

import jaxsat
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study
from jaxsat.simulation.engine.progress import Outputs

SCENARIOS = ("benchmark-three-axis", "acceptance-mc", "failures-12u")


def timed(study, rounds: int) -> tuple[Outputs, float, float]:
    """Outputs, seconds of the first evaluation and of the best one after it."""
    cases, seconds = study.cases(np.arange(study.count)), []
    for _ in range(1 + rounds):
        begin = time.perf_counter()
        found = jax.block_until_ready(study.engine.evaluate(study.program, cases, study.gains))
        seconds.append(time.perf_counter() - begin)
    return jax.tree.map(np.asarray, found), seconds[0], min(seconds[1:])


def differences(found: Outputs, native: Outputs) -> tuple[float, float, float, int]:
    """Of settling time, effort and final rates of cases that both settle; how many do otherwise."""
    settled = np.isfinite(found.settling_time), np.isfinite(native.settling_time)
    both = settled[0] & settled[1]
    time_error = np.abs(found.settling_time - native.settling_time)[both]
    effort_error = np.abs(found.effort / native.effort - 1)[both]
    rate_error = np.abs(found.omega - native.omega)[both]
    other = (found.code != native.code) | (settled[0] != settled[1])
    return *(float(np.max(x, initial=0.0)) for x in (time_error, effort_error, rate_error)), int(
        other.sum()
    )


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("scenarios", nargs="*", default=SCENARIOS)
    parser.add_argument("--cases", type=int, default=4096)
    parser.add_argument("--batch-size", type=int, default=4096)
    parser.add_argument("--rounds", type=int, default=2)
    parser.add_argument("--skip-cpu", action="store_true", help="fly no scan on the processor")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    devices = [] if options.skip_cpu else [jax.devices("cpu")[0]]
    if jax.default_backend() != "cpu":
        devices.append(jax.devices()[0])
    print(f"jaxsat {jaxsat.__version__}, jax {jax.__version__}: {[d.device_kind for d in devices]}")
    print("scenario, engine: first (s), again (s), cases/s, |Δ| time (s), effort, rate, other ends")
    for name in options.scenarios:
        scenario = load(name, purpose="study")

        def study(engine, scenario=scenario):
            size = options.batch_size
            return build_study(scenario, options.cases, engine=engine, batch_size=size)

        native, first, again = timed(study("native"), options.rounds)
        print(f"{name}, native: {first:.2f}, {again:.3f}, {options.cases / again:.0f}", flush=True)
        for device in devices:
            with jax.default_device(device):
                found, first, again = timed(study("scan"), options.rounds)
            told = ", ".join(f"{x:.2g}" for x in differences(found, native))
            pace = options.cases / again
            print(
                f"{name}, scan on {device.platform}: {first:.2f}, {again:.3f}, {pace:.0f}, {told}",
                flush=True,
            )


if __name__ == "__main__":
    main()
