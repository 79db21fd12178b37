"""Tunes the gains of the three slews' presets (`jaxsat.core.declaration.tuned_gains`) by CMA-ES.

    python benchmarks/preset_gains.py --torque-limit 5 --minutes 8

What is minimised are the times within which half, nine tenths and 99 % of the cases of the
acceptance set settle, over those of the present gains, at all three levels; an unsettled case costs
as much as ten times the time. Prints the best gains and the mean of the last generations, and how
both and the present ones do on a seed that took no part.
"""

import argparse
import time
import warnings
from collections.abc import Callable
from typing import Any, NamedTuple, cast

import cma
import jax
import numpy as np

import jaxsat
from jaxsat.core.declaration.settling import TUNED_LIMITS
from jaxsat.core.declaration.tuned_gains import APPROACH, STEPS, TWO_CHANNEL
from jaxsat.scenario import ScenarioWarning
from jaxsat.synthesis.comparison.acceptance import ComparisonSetting, comparison_scenario

LEVELS = {"hard": (384, 2.0), "mc": (128, 1.0), "nominal": (128, 1.0)}
"""Cases of each level, and its weight."""

PERCENTILES = {50: 0.5, 90: 0.4, 99: 0.1}
"""Of the settling time, and their weights."""

UNSETTLED, SLOWEST, AWAY = 10.0, 1e4, 2e-3
"""Cost of the fraction that does not settle, s that an infinite time counts, and cost of the square
of a gain's logarithm."""


class Gain(NamedTuple):
    """One gain that is tuned: where it stands, and whether it is a share of the torque."""

    table: str
    path: tuple[str, ...]
    is_share: bool = False


GAINS = (
    Gain("approach", ("slews", "share"), True),
    Gain("approach", ("rate_law", "share"), True),
    Gain("approach", ("stopped_rate",)),
    Gain("approach", ("rate_law", "dead_zone")),
    Gain("approach", ("slews", "rate_tolerance")),
    Gain("approach", ("slews", "angle_tolerance")),
    Gain("fine", ("demand", "k3")),
    Gain("fine", ("demand", "kz")),
    Gain("fine", ("frequency",)),
    Gain("fine", ("largest_amplitude",)),
    Gain("fine", ("demand", "rest")),
    Gain("fine", ("enter_rate",)),
    Gain("approach", ("rate_law", "rate_gain")),
)

Tables = dict[str, Any]


def changed(tables: Tables, logarithms: np.ndarray) -> Tables:
    """The gains times exp of `logarithms`; of a share s that is s / (1 - s)."""
    found = dict(tables)
    for gain, factor in zip(GAINS, np.exp(logarithms), strict=True):
        found[gain.table] = _replaced(found[gain.table], gain.path, float(factor), gain.is_share)
    return found


def _replaced(gains: Any, path: tuple[str, ...], factor: float, is_share: bool) -> Any:
    name, *rest = path
    value = getattr(gains, name)
    if rest:
        return gains._replace(**{name: _replaced(value, tuple(rest), factor, is_share)})
    new = 1 / (1 + (1 / value - 1) / factor) if is_share else value * factor
    return gains._replace(**{name: new})


def measured(limit: float, seed: int, scale: int = 1) -> dict[str, tuple[float, dict[int, float]]]:
    """By level the share that settles and the percentiles of the settling time (s)."""
    found = {}
    for level, (count, _) in LEVELS.items():
        setting = ComparisonSetting(level=level, torque_limit=limit, law="three-slew")
        study = jaxsat.build_study(comparison_scenario(setting), scale * count, seed=seed)
        times = study.values(np.arange(scale * count))["settling_time"]
        found[level] = (
            float(np.isfinite(times).mean()),
            {one: float(np.percentile(times, one, method="higher")) for one in PERCENTILES},
        )
    return found


def cost_of(limit: float, seed: int, with_gains: Callable[[np.ndarray], None]):
    """The cost of logarithms; 1 for those of the present gains."""
    with_gains(np.zeros(len(GAINS)))
    before = measured(limit, seed)

    def cost(logarithms: np.ndarray) -> float:
        with_gains(logarithms)
        total = 0.0
        for level, (settled, times) in measured(limit, seed).items():
            ratios = {one: min(at, SLOWEST) / before[level][1][one] for one, at in times.items()}
            quick = sum(PERCENTILES[one] * ratio for one, ratio in ratios.items())
            total += LEVELS[level][1] * (quick + UNSETTLED * (1 - settled))
        weight = sum(weight for _, weight in LEVELS.values())
        return total / weight + AWAY * float(np.sum(np.square(logarithms)))

    return cost


def main() -> None:
    """Tune the gains of one torque limit."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--torque-limit", type=float, choices=TUNED_LIMITS, default=5.0)
    parser.add_argument("--minutes", type=float, default=8.0)
    parser.add_argument("--seed", type=int, default=555)
    parser.add_argument("--unseen", type=int, default=777)
    given = parser.parse_args()
    jax.config.update("jax_enable_x64", True)
    warnings.simplefilter("ignore", ScenarioWarning)
    step = STEPS[TUNED_LIMITS.index(given.torque_limit)]
    before: Tables = {"approach": APPROACH[step], "fine": TWO_CHANNEL[step]}

    def with_gains(logarithms: np.ndarray) -> None:
        tables = changed(before, logarithms)
        cast(dict, APPROACH)[step] = tables["approach"]
        cast(dict, TWO_CHANNEL)[step] = tables["fine"]

    cost = cost_of(given.torque_limit, given.seed, with_gains)
    search = cma.CMAEvolutionStrategy(
        np.zeros(len(GAINS)), 0.15, {"popsize": 10, "seed": 1, "verbose": -9}
    )
    end = time.monotonic() + 60 * given.minutes
    while time.monotonic() < end:
        asked = search.ask()
        search.tell(asked, [cost(one) for one in asked])
        print(search.countiter, search.result.fbest, flush=True)
    found = {"best": search.result.xbest, "mean": search.result.xfavorite}
    for name, logarithms in {**found, "present": np.zeros(len(GAINS))}.items():
        with_gains(logarithms)
        print(name, changed(before, logarithms))
        print(measured(given.torque_limit, given.unseen, scale=3))


if __name__ == "__main__":
    main()
