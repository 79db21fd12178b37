"""Trajectories of scenarios, and cases of their studies, as datasets."""

from collections.abc import Callable
from typing import TYPE_CHECKING

import jax
import numpy as np

from jaxsat.core.checks import as_array
from jaxsat.scenario.build.run import build
from jaxsat.scenario.dump import dump
from jaxsat.scenario.resolution import refined
from jaxsat.scenario.schema import Scenario
from jaxsat.simulation.assessment import Assessment
from jaxsat.simulation.trajectory import Trajectory
from jaxsat.store.dataset import errors_of, trajectory_arrays
from jaxsat.store.labelled import LabelledArrays

if TYPE_CHECKING:  # a single run needs neither
    import xarray as xr

    from jaxsat.studies.ensemble import Study


def simulated(
    scenario: Scenario, tell: Callable[[str], None] = lambda obstacle: None
) -> LabelledArrays:
    """Return the trajectory of a scenario; for `tell` see `Run.simulate`.

    It is that of the case `dispersion.case`, if there is one, as `replay_case` computes it.
    """
    if scenario.dispersion is not None and scenario.dispersion.case is not None:
        from jaxsat.scenario.build.study import build_study

        number = scenario.dispersion.case
        return replayed_case(scenario, build_study(scenario, number + 1), number)
    run = build(scenario)
    return trajectory_arrays(
        run.simulate(tell),
        title=scenario.title,
        scenario=dump(scenario),
        seed=scenario.simulation.seed,
        modes=run.modes,
    )


def simulated_finely(
    scenario: Scenario, tell: Callable[[str], None]
) -> tuple[Scenario, LabelledArrays]:
    """Return the scenario with sufficiently fine steps, and its trajectory; see `refined`."""
    return refined(scenario, lambda one: simulated(one, tell), errors_of, tell)


def replay_case(scenario: Scenario, study: "Study", number: int) -> "xr.Dataset":
    """Return case `number` of the study of a scenario with its complete history.

    The dataset has the format of `jaxsat simulate`, with every observed instant. Its attributes
    hold the number of the case (`case`) and the values drawn for it (`drawn_NAME`).
    """
    return replayed_case(scenario, study, number).dataset()


def replayed_case(scenario: Scenario, study: "Study", number: int) -> LabelledArrays:
    """Return the arrays of `replay_case`."""
    replay = study.replay(number)
    steps, unknown = as_array(np.array(len(replay.times) - 1)), as_array(np.array(np.nan))
    outputs, signals = jax.tree.map(as_array, (replay.outputs, replay.signals))
    attitude = scenario.law.declaration.regulates_attitude
    settled, error = outputs.settling_time, outputs.integration_error
    assessment = Assessment(settled, unknown) if attitude else Assessment(unknown, settled)
    times, ranges = as_array(replay.times), signals.torque_range
    arrays = trajectory_arrays(
        Trajectory(times, signals, None, outputs.code, steps, assessment, ranges, error),
        title=scenario.title,
        scenario=dump(scenario),
        modes=getattr(scenario.law.controller, "modes", None),
        seed=study.design.seed,
    )
    arrays.attrs["case"] = number
    for name, values in replay.outputs.drawn.items():
        arrays.attrs[f"drawn_{name}"] = [float(value) for value in values]
    return arrays
