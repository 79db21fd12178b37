"""A design in one call, with the folder of the way: `design`."""

from dataclasses import replace
from pathlib import Path

from jaxsat.core.errors import ArgumentError
from jaxsat.core.process import processors
from jaxsat.scenario import Scenario
from jaxsat.scenario.control import required_law
from jaxsat.studies.executors import Serial, Threads
from jaxsat.studies.work import Work
from jaxsat.synthesis.controller_design.candidates import GAINS
from jaxsat.synthesis.controller_design.files import write_files
from jaxsat.synthesis.controller_design.request import (
    ALL,
    QUICK,
    SCREENING_CASES,
    VALIDATION_CASES,
    Attitude,
    DesignSettings,
    Goal,
    Vehicle,
    law_asked_for,
)
from jaxsat.synthesis.controller_design.result import ControllerDesign
from jaxsat.synthesis.controller_design.steps import DesignRun
from jaxsat.synthesis.controller_design.studies import Studies
from jaxsat.synthesis.controller_design.tuning import TUNED_CASES
from jaxsat.synthesis.execution import Execution, Listener, folder_of_call

KIND = "design"
"""The kind of the output folder."""


CASE = 400
"""Bytes of a case in memory and on the disk, about."""

USUAL_DURATION = 1200.0
"""Seconds of a case where the file has none, about."""

STUDIES = 4
"""Candidates in all steps before the verification, about."""


def design(
    vehicle: Scenario | Vehicle,
    *,
    law: str | None = None,
    settled: float = 0.99,
    cases: int = 2000,
    steps: int = 16,
    seed: int | None = None,
    attitude: Attitude = "wanted",
    goal: Goal = "quickest",
    out: str | Path | None = None,
    execution: Execution = Execution(),
    listener: Listener = Listener(),
) -> ControllerDesign:
    """Design a controller for a vehicle, and verify it on cases never seen before.

    The vehicle is one of `read_vehicle` or the scenario of one. `law` is the law to design, "all"
    for every law of jaxsat that fits, "quick" for those that are verified within minutes, None for
    the vehicle's own ("quick" if that is "coast"). At least a fraction `settled` of `cases` cases
    must settle; `steps` are those of the tuner, 0 for none. The seeds of the steps are `seed` (the
    scenario's own if left out) and the three that follow. The first law's fraction of 500 cases is
    a remark to the `listener` while the design goes on. With `attitude` "nearest" the target is the
    nearest attitude that can be held. The `goal` "settled" is done with the first law that surely
    settles the wanted fraction, and tunes only where none does. With `out` the design is kept in
    that folder, as by `jaxsat design`, and the same call resumes it.

    Raises `ValueError` for arguments that cannot be and `OutputError` for a folder that cannot be
    used. A vehicle with nothing to design raises nothing: see `ControllerDesign.outcome`.
    """
    if isinstance(vehicle, Scenario):
        vehicle = Vehicle(vehicle, law_asked_for(vehicle), timed=True)
    scenario, timed = vehicle.scenario, vehicle.timed
    settings = DesignSettings(
        law=required_law_to_design(vehicle.law, law),
        settled=settled,
        cases=cases,
        steps=steps,
        seed=scenario.simulation.seed if seed is None else seed,
        attitude=attitude,
        goal=goal,
        engine=execution.engine,
    )
    listener.approve([_work(vehicle, settings)])
    identity = {"scenario": scenario.model_dump(mode="json"), "timed": timed, **settings.identity()}
    with folder_of_call(out, KIND, identity) as folder:
        executor = execution.executor or (Threads(processors()) if processors() > 1 else Serial())
        studies = Studies(folder, replace(execution, executor=executor), listener)
        controller_design = DesignRun(scenario, settings, studies, timed).run()
        if out is not None:
            listener.progress("figures and files", None)
            write_files(controller_design, folder)
        return controller_design


def _work(vehicle: Vehicle, settings: DesignSettings) -> Work:
    """What all steps take, about."""
    simulation, cases = vehicle.scenario.simulation, settings.cases
    trajectories = STUDIES * (SCREENING_CASES + VALIDATION_CASES) + cases
    trajectories += 8 * settings.steps * TUNED_CASES
    duration = simulation.duration_s if vehicle.timed else USUAL_DURATION
    intervals = round(duration / simulation.save_every_s)
    return Work(trajectories, trajectories * intervals, cases * CASE, cases * CASE)


def required_law_to_design(own: str, law: str | None = None) -> str:
    """The law that is to be designed: `law`, or the `own` one of a scenario, or `ALL` or `QUICK`.

    Raises `ArgumentError` for one that there is not or that aims at no attitude.
    """
    name = own if law is None else law
    choices = f"a law ({', '.join(GAINS)}), {ALL} or {QUICK}"
    declaration = None if name in (ALL, QUICK) else required_law(name, choices).declaration
    if declaration is None or (declaration.regulates_attitude and declaration.torques):
        return name
    if law is None:
        rule = f"must be given, as {own}, the scenario's own, aims at no attitude: {choices}"
        raise ArgumentError("law", rule, "nothing")
    raise ArgumentError("law", f"must be one that aims at an attitude: {choices}", law)
