"""Conversion of a scenario with a `[tuning]` table to a tuning plan, and back."""

import dataclasses
import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple, cast

import equinox as eqx
import numpy as np

from jaxsat.compiler import CannotLower
from jaxsat.control.fault_tolerant import FaultTolerant
from jaxsat.core.checks import as_float
from jaxsat.core.tolerances import Tolerances
from jaxsat.scenario.build.errors import BuildError, at_key
from jaxsat.scenario.build.run import build, build_loop
from jaxsat.scenario.build.study import EngineName, build_study, tolerances_of
from jaxsat.scenario.errors import MissingTable
from jaxsat.scenario.optimisers import DERIVATIVE_FREE, OptimiserSettings
from jaxsat.scenario.rules import at
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.tuning import BoundsTable, CostTable, TuningTable
from jaxsat.scenario.wording import shown
from jaxsat.simulation.engine.native import NativeEngine, process_obstacle
from jaxsat.simulation.engine.program import Program
from jaxsat.simulation.engine.progress import AttitudeCost, RunningCost, Unsettled
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.studies.changes import controller_of
from jaxsat.studies.dispersions import number_at
from jaxsat.synthesis.tuning.cost_evaluator import CostEvaluator, TrajectoryCounter
from jaxsat.synthesis.tuning.forms import in_one_form, refined, throttled
from jaxsat.synthesis.tuning.parameters import SearchSpace, TunedParameter, Values
from jaxsat.synthesis.tuning.plan import (
    AbstractAggregate,
    ConditionalValueAtRisk,
    LargestCost,
    Mean,
    Objective,
    Quantile,
    TailCompression,
    TuningPlan,
    TuningSettings,
)
from jaxsat.synthesis.tuning.strategies import require_package


def build_plan(
    scenario: Scenario, *, engine: EngineName = "auto", batch_size: int = 64, workers: int = 1
) -> TuningPlan:
    """Build the tuning run of a scenario.

    `engine` and `batch_size` are those of a study; where "auto" does not select the native engine
    the plan's `remark` says why. Raises `ValueError` where the scenario has no `[tuning]` table or
    disperses quantities that its loop lacks, and for "native" where that engine cannot run.
    """
    table = scenario.tuning
    if table is None:
        raise MissingTable("tuning")
    _require_optimiser(table)
    forms = _forms_of(scenario, table)
    scenario, smooth, widths = forms.scenario, forms.smooth, forms.widths
    space, start = forms.space, forms.start
    seed = scenario.simulation.seed
    unseen = seed + 1 if table.held_out_seed is None else table.held_out_seed
    free = table.optimiser == DERIVATIVE_FREE
    penalty = _false_alarm_penalty(scenario, table, space)
    bounded_cost = _cost(table.cost, scenario.simulation.attitude_cost)
    plain_cost = _plain(bounded_cost)

    def evaluator(variant: Scenario, cost: RunningCost, number: int) -> CostEvaluator:
        study = build_study(
            variant,
            1,
            seed=number,
            engine=engine if engine == "diffrax" else "scan",
            batch_size=batch_size,
        )
        program = _with_cost(study.program, cost, tolerances_of(scenario))
        return CostEvaluator(
            program,
            study.design,
            study.engine,
            space,
            workers,
            "differences" if free else table.gradient,
            table.half_width,
            table.cost.recovery,
            penalty,
        )

    runs = {
        "smooth": evaluator(smooth, bounded_cost, seed),
        "exact": evaluator(scenario, bounded_cost, seed),
        "refined": evaluator(forms.refined, bounded_cost, seed),
        "held_out": evaluator(scenario, plain_cost, unseen),
        "trained_on": evaluator(scenario, plain_cost, seed),
    }
    if free:  # nothing is differentiated
        runs["smooth"] = runs["exact"]
    runs, remark = _with_native_engine(runs, start, engine, differentiated=not free)
    exact = runs["exact"]
    return TuningPlan(
        space,
        start,
        **runs,
        settings=_settings(table, seed, float(exact.program.interval)),
        widths=widths,
        description={
            "scenario": scenario.model_dump(mode="json", exclude={"title", "description"}),
            "engine": exact.engine.identity(),
        },
        remark=remark,
    )


def _require_optimiser(table: TuningTable) -> None:
    if table.optimiser == DERIVATIVE_FREE:
        require_package(f'tuning.optimiser = "{DERIVATIVE_FREE}"')


class _Forms(NamedTuple):
    """The scenario in one form, smoothed for gradients and in finer steps, and the search."""

    scenario: Scenario
    smooth: Scenario
    refined: Scenario
    widths: dict[str, float]
    space: SearchSpace
    start: np.ndarray


def _forms_of(scenario: Scenario, table: TuningTable) -> _Forms:
    scenario = in_one_form(scenario, table)
    space, start = _search(scenario, table.parameters)
    widths = dict(table.smoothing)
    if table.optimiser == DERIVATIVE_FREE:
        return _Forms(scenario, scenario, refined(scenario), {}, space, start)
    smooth = throttled(scenario.with_keys("control", **widths))
    return _Forms(scenario, smooth, refined(smooth), widths, space, start)


def try_tuning(scenario: Scenario) -> None:
    """Build all parts of a tuning run; raises `BuildError` where that fails.

    A scenario without `[tuning]` passes.
    """
    table = scenario.tuning
    if table is None:
        return
    with at_key("tuning.optimiser"):
        _require_optimiser(table)
    with at_key("tuning"):
        forms = _forms_of(scenario, table)
        for one in (forms.scenario, forms.smooth, forms.refined):
            build(one)
        _settings(table, scenario.simulation.seed, scenario.simulation.save_every_s)


def tuned_scenario(scenario: Scenario, plan: TuningPlan, point: np.ndarray) -> Scenario:
    """Return the scenario with the gains of a point of the search in `[control]`."""
    gains = plan.space.gains(plan.space.to_values(point))
    tunable = scenario.law.declaration.tunable
    numbers: dict[str, Any] = {}
    for key, place in tunable.items():
        if place in gains:
            value = gains[place]
            numbers[key] = float(value) if value.ndim == 0 else tuple(map(float, value))
    return scenario.with_keys("control", **numbers)


def _with_native_engine(
    runs: dict[str, CostEvaluator], start: np.ndarray, name: EngineName, *, differentiated: bool
) -> tuple[dict[str, CostEvaluator], str | None]:
    """Return the runs with the native engine where it is requested and able, else the reason."""
    if name in ("scan", "diffrax"):
        return runs, None
    native_runs, obstacle = runs, process_obstacle()
    if obstacle is None:
        native_runs, obstacle = _as_machine_code(runs, start, differentiated)
    if obstacle is None:
        return native_runs, None
    if name == "native":
        raise ValueError(f"The native engine cannot run this: {obstacle}")
    return runs, f"not the native engine: {obstacle}"


def _as_machine_code(
    runs: dict[str, CostEvaluator], start: np.ndarray, differentiated: bool
) -> tuple[dict[str, CostEvaluator], str | None]:
    """Return the runs with the native engine, compiled and tried, or the unsupported operation."""
    try:
        native_runs = {key: _native(evaluator) for key, evaluator in runs.items()}
        for key in ("smooth", "exact"):  # one interval of one case makes the machine code
            probe = dataclasses.replace(native_runs[key], counter=TrajectoryCounter())
            point = probe.space.to_search(start[None])
            probe.evaluate(point, np.arange(1), intervals=1)
            if differentiated:
                probe.differentiate(point, np.arange(1), intervals=1)
    except CannotLower as error:
        return runs, str(error)
    return native_runs, None


def _native(evaluator: CostEvaluator) -> CostEvaluator:
    scan = cast(ScanEngine, evaluator.engine)
    engine = NativeEngine(
        stepper=scan.stepper, workers=evaluator.workers, batch_size=scan.batch_size
    )
    return dataclasses.replace(evaluator, engine=engine, workers=1)  # threads of its own


def _search(scenario: Scenario, table: Mapping[str, BoundsTable]) -> tuple[SearchSpace, np.ndarray]:
    controller = controller_of(build_loop(scenario))
    parameters, values = [], []
    for key, place in scenario.law.declaration.tunable.items():
        bounds = table.get(key)
        if bounds is None:
            continue
        value = np.asarray(number_at(controller, place))
        if not np.all((value >= bounds.low) & (value <= bounds.high)):
            message = (
                f"must be bounds around control.{key} = {shown(value.tolist())}, "
                f"got {bounds.low} to {bounds.high}"
            )
            raise BuildError(at(f"tuning.parameters.{key}", message))
        parameters.append(
            TunedParameter(place, bounds.low, bounds.high, bounds.scale, value.shape, key)
        )
        values.append(value.ravel())
    return SearchSpace(tuple(parameters)), np.concatenate(values)


def _false_alarm_penalty(
    scenario: Scenario, table: TuningTable, space: SearchSpace
) -> Callable[[Values], np.ndarray] | None:
    """Return the cost of thresholds with too frequent false alarms, in closed form.

    No sample of cases shows one false alarm in years, so that a search would lower thresholds ever
    further. None for a law without these tests.
    """
    controller = controller_of(build_loop(scenario))
    if not isinstance(controller, FaultTolerant):
        return None
    diagnosis, period = controller.diagnosis, float(np.asarray(controller.period))
    samples = math.log(table.false_alarm_interval_s / period)

    def penalty(values: Values) -> np.ndarray:
        gains = space.gains(values)
        usual = np.ones(len(values))
        pairs = zip(
            gains.get("diagnosis.reference", usual * float(np.asarray(diagnosis.reference))),
            gains.get("diagnosis.threshold", usual * float(np.asarray(diagnosis.threshold))),
            strict=True,
        )
        rates = np.array([controller.false_alarm_rate(float(k), float(h)) for k, h in pairs])
        return np.maximum(samples + np.log(np.maximum(rates, np.finfo(float).tiny)), 0.0)

    return penalty


def _cost(table: CostTable, attitude: AttitudeCost) -> RunningCost:
    weights = table.model_dump(exclude={"recovery"})
    return RunningCost(**weights, unsettled=Unsettled(), attitude=attitude)


def _plain(cost: RunningCost) -> RunningCost:
    """Return the cost without bound and surrogate, of the same structure: nothing compiles anew."""
    return eqx.tree_at(
        lambda cost: (cost.settling, cost.limit), cost, (as_float(0.0), as_float(np.inf))
    )


def _with_cost(program: Program, cost: RunningCost, tolerances: Tolerances) -> Program:
    cost = eqx.tree_at(lambda cost: cost.unsettled, cost, Unsettled(tolerances))
    return dataclasses.replace(program, tolerances=tolerances, cost=cost, error_every=0)


def _aggregate(table: TuningTable) -> AbstractAggregate:
    if table.aggregate == "cvar":
        return ConditionalValueAtRisk(table.level)
    if table.aggregate == "quantile":
        return Quantile(table.level)
    return LargestCost() if table.aggregate == "worst" else Mean()


def _settings(table: TuningTable, seed: int, interval: float) -> TuningSettings:
    names = {one.name for one in dataclasses.fields(TuningSettings)}
    values: dict[str, Any] = {name: value for name, value in table if name in names}
    if table.starts == 1:
        values["screened"] = 0
    return TuningSettings(
        objective=Objective(_aggregate(table), TailCompression(table.tail_scale), table.case_bound),
        descent=OptimiserSettings(table.optimiser, table.learning_rate, table.schedule, table.clip),
        horizons=tuple(round(horizon / interval) for horizon in table.horizon_s or ()),
        seed=seed,
        **values,
    )
