"""The trajectory of one case of a study, as that of a single run."""

from typing import TYPE_CHECKING

import jax
import numpy as np

from jaxsat.core.checks import as_array
from jaxsat.scenario import Scenario, dump
from jaxsat.simulation import Assessment, Trajectory
from jaxsat.store import trajectory_dataset
from jaxsat.studies import Study

if TYPE_CHECKING:
    import xarray as xr


def replay_case(scenario: Scenario, study: Study, number: int) -> "xr.Dataset":
    """Case `number` of the study of a scenario with its complete history.

    The dataset is that of `jaxsat simulate`. Its attributes hold the number of the case (`case`)
    and the values drawn for it (`drawn_NAME`). It has every observed instant.
    """
    replay = study.replay(number)
    steps, unknown = as_array(np.array(len(replay.times) - 1)), as_array(np.array(np.nan))
    outputs, signals = jax.tree.map(as_array, (replay.outputs, replay.signals))
    attitude = scenario.law.declaration.regulates_attitude
    settled, error = outputs.settling_time, outputs.integration_error
    assessment = Assessment(settled, unknown) if attitude else Assessment(unknown, settled)
    times, ranges = as_array(replay.times), signals.torque_range
    dataset = trajectory_dataset(
        Trajectory(times, signals, None, outputs.code, steps, assessment, ranges, error),
        title=scenario.title,
        scenario=dump(scenario),
        modes=getattr(scenario.law.controller, "modes", None),
        seed=study.design.seed,
    )
    dataset.attrs["case"] = number
    for name, values in replay.outputs.drawn.items():
        dataset.attrs[f"drawn_{name}"] = [float(value) for value in values]
    return dataset
