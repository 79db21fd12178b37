"""Trajectories of scenarios, and cases of their studies, as datasets."""

from collections.abc import Callable, Mapping
from typing import TYPE_CHECKING, Any

import jax
import numpy as np

from jaxsat.core.checks import as_array
from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.declaration.sensor import TACHOMETER
from jaxsat.scenario.build.run import build
from jaxsat.scenario.dump import dump
from jaxsat.scenario.resolution import refined
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.toml_text import toml_document
from jaxsat.simulation.assessment import Assessment
from jaxsat.simulation.trajectory import Trajectory
from jaxsat.store.dataset import errors_of, trajectory_arrays
from jaxsat.store.labelled import LabelledArrays

_EFFECTORS = tuple(one.name for one in ACTUATORS)

_GROUPS = {"gyro": 1, TACHOMETER: 2}
"""Sensors whose failures come behind those of the attitude, in the order of draws."""

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
    hold the number of the case (`case`), the values drawn for it (`drawn_NAME`), and its tables
    `[[failure]]` where they are drawn (`failures`).
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
    if (failures := _failures(scenario, study, replay.outputs.drawn)) is not None:
        arrays.attrs["failures"] = toml_document({"failure": failures})
    for name, values in replay.outputs.drawn.items():
        arrays.attrs[f"drawn_{name}"] = [float(value) for value in values]
    return arrays


def _failures(
    scenario: Scenario, study: "Study", numbers: Mapping[str, Any]
) -> list[dict[str, Any]] | None:
    """Return the tables `[[failure]]` of actuators and sensors as drawn for a case.

    None where nothing of them is drawn.
    """
    from jaxsat.studies.failure_codes import CODES

    if not any(name.startswith(("fail", "sensor_failure")) for name in numbers):
        return None
    devices, of_sensors = [], []
    for table in scenario.failure:
        one = table.model_dump(exclude_none=True)
        (devices if one["of"].partition(" ")[0] in _EFFECTORS else of_sensors).append(one)
    devices.sort(key=lambda one: _EFFECTORS.index(one["of"].partition(" ")[0]))
    of_sensors.sort(key=lambda one: _GROUPS.get(one["of"].partition(" ")[0], 0))
    for one, at in zip(of_sensors, numbers.get("sensor_failure_time", ()), strict=False):
        one["at_s"] = float(at)
    if study.failures is None or not devices:
        return of_sensors
    draws = {name: np.asarray(values)[None] for name, values in numbers.items()}
    columns = study.failures.struck(draws, 1)
    for number, one in enumerate(devices):
        at, part, code, amount = (values[0, number] for values in columns.values())
        one |= {"of": study.failures.names[part], "at_s": float(at)}
        kind = CODES.get(int(code))  # none for one beyond the end of the run
        if kind is not None and (kind.text != one["kind"] or kind.one_number):
            amounts = {kind.keys[0]: float(amount)} if kind.one_number else {}
            devices[number] = (
                {key: one[key] for key in ("of", "at_s")} | {"kind": kind.text} | amounts
            )
    return [*devices, *of_sensors]
