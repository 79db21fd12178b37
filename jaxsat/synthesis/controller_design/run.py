"""A design in one call, with a folder of its results: `design`."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import jaxsat
from jaxsat.core.declaration.quantities import DISPERSIBLE
from jaxsat.core.process import processors
from jaxsat.report.design_document import DESIGNED, LINES
from jaxsat.report.printers import markdown_page
from jaxsat.scenario import Scenario, dump
from jaxsat.scenario.build.actuator_set import fitting_laws
from jaxsat.store.provenance import provenance
from jaxsat.store.resumable import ResumableFolder
from jaxsat.studies.executors import Serial, Threads
from jaxsat.studies.work import Work
from jaxsat.synthesis.controller_design.candidates import (
    fitting_candidates,
    required_law_to_design,
)
from jaxsat.synthesis.controller_design.completion import completed
from jaxsat.synthesis.controller_design.explanation import drawn_numbers
from jaxsat.synthesis.controller_design.request import (
    SCREENING_CASES,
    VALIDATION_CASES,
    Attitude,
    DesignSettings,
    Goal,
    Vehicle,
    law_asked_for,
)
from jaxsat.synthesis.controller_design.result import ControllerDesign, Step
from jaxsat.synthesis.controller_design.steps import DesignRun
from jaxsat.synthesis.controller_design.studies import Studies
from jaxsat.synthesis.controller_design.tuning import TUNED_CASES
from jaxsat.synthesis.controller_design.vehicle import Scale, UnsuitableVehicle, vehicle_verdict
from jaxsat.synthesis.execution import Execution, Listener, folder_of_call

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from jaxsat.report.study_figures import DrawnNumber

PAGE, RECORD = "design.md", "design.json"


def require_candidate(vehicle: Vehicle) -> None:
    """Raise `UnsuitableVehicle` where no law that should apply to a vehicle can be built for it."""
    scenario, reasons = vehicle.scenario, []
    verdict = vehicle_verdict(scenario)

    def complete(under_law: Scenario, scale: Scale) -> Scenario:
        return completed(under_law, verdict, scale, vehicle.timed).scenario

    for name in fitting_laws(scenario, verdict.judgement):
        fitting = fitting_candidates(scenario, verdict, name, complete)
        if fitting.candidates:
            return
        reasons += fitting.left_out
    if reasons:
        raise UnsuitableVehicle(f"no law fits: {'; '.join(dict.fromkeys(reasons))}")


def design_comment(design: ControllerDesign, version: str) -> str:
    """Return comment lines for the designed scenario: its origin and verification."""
    verification = design.verification
    assert verification is not None
    lines = [
        f"Designed by jaxsat {version} for: {design.original.title}",
        *[f"  {line}" for line in design.verdict.lines()],
        design.headline,
        f"Verification: seed {design.settings.seeds.verification}, by "
        f"`jaxsat montecarlo {DESIGNED} --seed {design.settings.seeds.verification} "
        f"-n {design.settings.cases}`.",
    ]
    if design.assumed:
        lines += [f"{LINES['assumed']}:"]
        lines += [f"  {line}" for line in design.assumed]
    if design.misses_attitude is not None:
        lines.append(design.misses_attitude)
    elif design.settings.attitude == "nearest" and any(design.verdict.turn or ()):
        lines.append(
            "Body axes are turned so that the nearest attitude that can be held is the target."
        )
    if not design.gains:
        lines.append("The gains are functions of inertia, torque limit and control period.")
    return "".join(f"# {line}\n" for line in lines)


def write_files(design: ControllerDesign, folder: ResumableFolder) -> None:
    """Write the page, the designed scenario, the record as JSON, and figures."""
    folder.write(PAGE, markdown_page(design.document))
    if design.scenario is not None:
        comment = design_comment(design, jaxsat.__version__)
        folder.write(DESIGNED, comment + dump(design.scenario))
    record = design.record | provenance()
    folder.write(RECORD, json.dumps(record, indent=1, ensure_ascii=False) + "\n")
    if design.verification is not None:
        from jaxsat.report.saving import save_figures

        save_figures(lambda: _figures(design), folder.write)


def _figures(design: ControllerDesign) -> "dict[str, Figure | Callable[[], Figure]]":
    from jaxsat.report.figure_painter import paint
    from jaxsat.report.study_figures import study_drawings
    from jaxsat.report.tuning_document import gain_plots, loss_plots
    from jaxsat.synthesis.tuning.checkpoint import history_dataset

    assert design.verification is not None
    assert design.scenario is not None
    columns, title = design.verification.columns, design.scenario.title
    drawings = study_drawings(columns, _map_axes(design), title)
    figures: dict[str, Any] = {**drawings, "laws": _laws_figure(design)}
    if design.tuned is not None:
        plan, state = design.tuned.plan, design.tuned.state
        history = history_dataset(plan, state, title, dump(design.scenario))
        figures["loss"] = paint(loss_plots(history), f"{title}: loss of tuning")
        figures["gains"] = paint(gain_plots(history), f"{title}: gains in tuning", 1.9)
    return figures


def _laws_figure(design: ControllerDesign) -> "Figure":
    from jaxsat.report.comparison_figures import settling_comparison

    steps: dict[str, Step | None] = {"screening": design.screening, "validation": design.validation}
    panels, horizons = {}, {}
    for name, step in steps.items():
        if step is None:
            continue
        key = (name, step.rows[0].setting.torque_limit)
        panels[key] = {row.setting.law: row.settling_times for row in step.rows}
        assert design.scenario is not None
        horizons[key] = design.scenario.simulation.duration_s
    return settling_comparison(
        panels, horizons, f"{design.original.title}: screening and validation"
    )


def _map_axes(design: ControllerDesign) -> "dict[str, DrawnNumber]":
    """Return the two numbers on which settling depends most, or the cost where all cases settle."""
    from jaxsat.report.study_figures import DrawnNumber

    verification = design.verification
    assert verification is not None
    assert design.scenario is not None
    numbers = drawn_numbers(design.scenario, verification.columns, design.verdict.two_torques)
    names = [one.name for one in verification.separations] + [
        entry.name for entry in verification.summary.ranking if entry.matters
    ]
    axes = {}
    for label in list(dict.fromkeys(names))[:2]:
        quantity = DISPERSIBLE.get(label.partition("[")[0])
        unit, meaning = (quantity.unit, quantity.meaning) if quantity else _DERIVED[label]
        axes[label] = DrawnNumber(numbers[label], unit, meaning)
    return axes


_DERIVED = {
    "size of omega": ("rad/s", "size of the initial angular velocity"),
    "coupling c": ("1", "difference of the reduced moments over the third"),
}


KIND = "design"
"""Kind of the output folder."""


CASE = 400
"""Approximate bytes of a case in memory and on disk."""

USUAL_DURATION = 1200.0
"""Assumed duration of a case (s) where the file has none."""

STUDIES = 4
"""Approximate number of candidates in all steps before the verification."""


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
    """Design a controller for a vehicle, and verify it on unseen cases.

    The vehicle is one of `read_vehicle` or the scenario of one. `law` is the law to design, "all"
    for every law of jaxsat that fits, "quick" for those that are verified within minutes, None for
    the vehicle's own ("quick" for "coast"). At least a fraction `settled` of `cases` cases must
    settle; `steps` are those of the tuner, 0 for none. The seeds of the steps are `seed` (default:
    the scenario's) and the three that follow. The first law's fraction of 500 cases is a remark to
    the `listener` while the design goes on. With `attitude` "nearest" the target is the nearest
    attitude that can be held. The `goal` "settled" ends with the first law that settles the
    required fraction with 95 % confidence, and tunes only where none does. With `out` the design is
    kept in that folder, as by `jaxsat design`, and the same call resumes it.

    Raises `ValueError` for invalid arguments and `OutputError` for a folder that cannot be used. A
    vehicle with nothing to design raises nothing: see `ControllerDesign.outcome`.
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
    simulation, cases = vehicle.scenario.simulation, settings.cases
    trajectories = STUDIES * (SCREENING_CASES + VALIDATION_CASES) + cases
    trajectories += 8 * settings.steps * TUNED_CASES
    duration = simulation.duration_s if vehicle.timed else USUAL_DURATION
    intervals = round(duration / simulation.save_every_s)
    return Work(trajectories, trajectories * intervals, cases * CASE, cases * CASE)
