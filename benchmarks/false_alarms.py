"""False alarms of a law that diagnoses its thrusters or wheels: a soak in which nothing fails.

    python benchmarks/false_alarms.py --cases 320
    python benchmarks/false_alarms.py --scenario failures-telescope

Flies a scenario that draws failures with all its other dispersions, but with the failures after the
end, and watches the CUSUM statistics at every sample. Prints the false alarms with the upper limit
of their number in an orbit that they allow (95 %, Poisson; three over the orbits where there is
none), how often the statistics exceed lower thresholds, and the rate at the threshold in use that
follows from the closed form of the average run length.
"""

import argparse
from typing import Any, cast

import jax
import numpy as np
from scipy.stats import chi2

from jaxsat.control.diagnosis.diagnosis import false_alarm_rate
from jaxsat.scenario.build.load import load
from jaxsat.scenario.build.study import build_study

ORBIT = 5677.0
"""s, at 500 km."""

NEVER = "dispersion.failure_time_s={distribution='uniform', low=1e6, high=2e6}"
BATCH = 32
"""Cases whose whole histories are in memory together."""


def upper_limit(events: int) -> float:
    """Of the mean number of events, of which so many were seen, with 95 %."""
    return float(chi2.ppf(0.95, 2 * (events + 1)) / 2)


def main() -> None:
    """Fly and count."""
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--scenario", default="failures-12u")
    parser.add_argument("--cases", type=int, default=320)
    parser.add_argument("--seed", type=int, default=77)
    parser.add_argument("--set", action="append", default=[], metavar="KEY=VALUE")
    options = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    scenario = load(options.scenario, [*options.set, NEVER])
    study = build_study(scenario, options.cases, seed=options.seed)
    law = cast(Any, study.case_factory.loop).controller
    threshold = float(law.diagnosis.threshold)
    period, samples = float(study.program.interval), study.program.intervals
    alarms, above, tested = 0, np.zeros(int(threshold) + 1, int), np.array(False)
    for first in range(0, options.cases, BATCH):
        numbers = np.arange(first, min(first + BATCH, options.cases))
        _, signals = study.engine.observed(
            study.program, study.cases(numbers), None, study.program.instants()
        )
        alarm = np.asarray(signals.mode) == law.modes.ALARM
        alarms += int(np.sum(alarm[:, 1:] & ~alarm[:, :-1]))
        statistic = threshold * np.asarray(signals.parts["detection_statistic"])
        tested = tested | np.any(statistic > 0, axis=(0, 1))
        levels = np.arange(len(above))[:, None, None, None]
        beyond = statistic[None] > levels
        above += np.sum(beyond[:, :, 1:] & ~beyond[:, :, :-1], axis=(1, 2, 3))
        print(f"{numbers[-1] + 1} of {options.cases} cases, {alarms} false alarms", flush=True)
    orbits = options.cases * samples * period / ORBIT
    print(f"{orbits:.1f} orbits of {ORBIT:.0f} s with {ORBIT / period:.0f} samples each")
    print(f"false alarms: {alarms}, below {upper_limit(alarms) / orbits:.2g} in an orbit (95 %)")
    watches = [one.watch for one in law.actuators]
    ends = np.cumsum([one.count for one in watches])[:-1]
    in_use = [np.count_nonzero(one) for one in np.split(tested, ends)]
    for watch, count in zip(watches, in_use, strict=True):
        each = 1 + len(watch.hypotheses.tests) + watch.hypotheses.weak_losses
        print(f"{each * count} tests, {each} of each actuator that is in use")
    reference = float(law.diagnosis.reference)
    print("threshold   exceeded in an orbit   by the closed form, where the model is true")
    for level in range(2, len(above)):
        expected = (
            ORBIT
            / period
            * sum(
                count / watch.count * false_alarm_rate(watch, reference, level)
                for watch, count in zip(watches, in_use, strict=True)
            )
        )
        print(f"{level:9d}   {above[level] / orbits:20.3g}   {expected:20.3g}")


if __name__ == "__main__":
    main()
