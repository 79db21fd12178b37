"""Construction of the Monte-Carlo study of a scenario with a `[dispersion]` table."""

import dataclasses
from collections.abc import Callable
from pathlib import Path
from typing import Any, Literal, cast

import equinox as eqx
import jax
import numpy as np
from jaxtyping import Array, Float

from jaxsat.core.checks import require_counts
from jaxsat.core.declaration.actuators import EFFECTORS
from jaxsat.core.declaration.requirements import comparisons
from jaxsat.core.solvers import NamedSolver
from jaxsat.core.tolerances import Tolerances
from jaxsat.scenario.build.dispersion_trial import distribution_of
from jaxsat.scenario.build.plant import sunlight_of
from jaxsat.scenario.build.run import Run, build, build_tolerances
from jaxsat.scenario.dispersion_tables import DispersionTable
from jaxsat.scenario.errors import MissingTable
from jaxsat.scenario.parts.named import names_of
from jaxsat.scenario.parts.torque_makers import signs
from jaxsat.scenario.resolution import Errors, refined
from jaxsat.scenario.schema import Scenario
from jaxsat.simulation.assessment import IntegrationError
from jaxsat.simulation.engine.adaptive import AdaptiveStepper, Tolerance
from jaxsat.simulation.engine.fixed import FixedStepper
from jaxsat.simulation.engine.interface import AbstractEngine
from jaxsat.simulation.engine.monitors import state_signals
from jaxsat.simulation.engine.native import NativeEngine, native_obstacle
from jaxsat.simulation.engine.program import Program, observations_per_save, program_of
from jaxsat.simulation.engine.progress import RunningCost
from jaxsat.simulation.engine.reference import ReferenceEngine
from jaxsat.simulation.engine.scan import ScanEngine
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.simulation.methods import SMOOTH_STEP
from jaxsat.simulation.requirements import Requirements, raw_signals
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.studies.designs import AbstractDesign, Independent, LatinHypercube, SamePoint, Sobol
from jaxsat.studies.dispersions import RATES, Dispersed, Dispersions, StudyCase
from jaxsat.studies.ensemble import Study

ADAPTIVE_SOLVERS = {"dopri8": 1e-7, "tsit5": 2e-8, "dopri5": 2e-8}
"""Solvers with dense output of their own, on which switches are located, and their default relative
and absolute tolerance."""

EngineName = Literal["auto", "native", "scan", "diffrax"]
CHUNK, NATIVE_CHUNKS = 256, (1024, 4096)
"""Cases computed and written together: by XLA, and fewest and most by the native engine."""

ACCELERATOR_BATCH = 4096
"""Batch size that keeps a GPU busy; a smaller batch takes hardly less time."""

PILOTS = 256
"""Number of cases of which the one with the fastest start tests the fineness of the steps."""

ERROR_EVERY = 64
"""Intervals per error estimate of equal steps: a few percent of the time."""


def build_study(
    scenario: Scenario,
    count: int,
    *,
    seed: int | None = None,
    engine: EngineName = "auto",
    batch_size: int = 64,
    chunk: int | None = None,
    history: int | None = None,
    controller: Path | None = None,
) -> Study:
    """Return the study of `count` cases of a scenario, by default with the scenario's seed.

    `engine` "native" and "scan" take fixed steps for sampled and smooth loops and adaptive ones,
    ended by the law's switches, for laws with corners, "native" as machine code made for the
    program, on the processor, "scan" on JAX's default device; "diffrax" takes the method of a
    single run. "auto" is "native"; if that is impossible, the study's `remark` gives the reason,
    and the engine is "scan", or "diffrax" if adaptive steps do not support the scenario's solver.
    Raises `ValueError` if the scenario disperses nothing or something that its loop does not have,
    and for an impossible "native". `batch_size` cases are in memory together; `chunk` cases are
    written together, by default a number that suits the engine; `history` is the number of instants
    at which signals of every case are kept. `controller` is the library of an export, which
    replaces law and estimator, and whose digests become part of the study's identity; raises
    `LibraryError` unless it is of this scenario's controller.
    """
    if scenario.dispersion is None:
        raise MissingTable("dispersion")
    require_counts(count=count, batch_size=batch_size, chunk=1 if chunk is None else chunk)
    run = build(scenario)
    description: dict[str, Any] = {"scenario": _numbers(scenario)}
    if controller is not None:
        run, description["controller"] = _with_library(run, controller)
        engine = "scan" if engine == "auto" else engine  # machine code calls nothing back
    seed = scenario.simulation.seed if seed is None else seed
    copies, program = study_program(scenario, run, seed)
    if isinstance(run.loop, SampledLoop) or (engine != "diffrax" and not _adaptive(scenario, run)):
        program = dataclasses.replace(program, error_every=ERROR_EVERY)
    program = dataclasses.replace(program, requirements=_requirements(scenario, run))
    design = _design(scenario.dispersion, seed, count)
    example = StudyCase(np.zeros(1, np.uint32), np.zeros((1, sum(copies.dimensions().values()))))
    chosen_engine, remark = _engine(scenario, run, (program, example), engine, batch_size)
    chunk = _suitable_chunk(chosen_engine, count) if chunk is None else chunk
    return Study(
        program,
        design,
        chosen_engine,
        count,
        chunk,
        description=description,
        remark=remark,
        history=history,
        names=_names(scenario),
    )


def refined_study(
    scenario: Scenario, count: int, tell: Callable[[str], None], **keys: Any
) -> tuple[Scenario, Study]:
    """Return the scenario with enough substeps that errors are within its limits in the first case
    and in the one with the fastest start, and its `build_study` with `keys`.

    Substeps that the scenario gives stay. The number depends on scenario, seed and design alone, so
    that studies that are resumed or larger, or use a controller's library, have the same. `tell`
    receives each change.
    """
    own = {**keys, "controller": None}
    study_of = lambda finer: build_study(finer, count, **own)  # noqa: E731
    scenario, study = refined(scenario, study_of, pilot_errors, tell)
    same = keys.get("controller") is None
    return scenario, study if same else build_study(scenario, count, **keys)


def pilot_errors(study: Study) -> Errors:
    """Largest error estimates of the first case and of the fastest of the first `PILOTS`."""
    if not study.program.error_every:
        return None, None
    cases = study.cases(np.arange(min(PILOTS, study.count) if study.has_fixed_size else PILOTS))
    numbers = np.unique([0, _fastest(study.case_factory, cases)])
    error = cast(IntegrationError, study.evaluate(numbers).integration_error)
    return float(np.max(error.rate)), float(np.max(error.attitude))


def _fastest(copies: Dispersed, cases: StudyCase) -> int:
    """Index of the case with the fastest start, the first one if no rate is dispersed."""
    if RATES.isdisjoint(copies.dispersions.names):
        return 0
    return int(np.argmax(np.linalg.norm(_start_rates(copies, cases), axis=1)))


@eqx.filter_jit
def _start_rates(copies: Dispersed, cases: StudyCase) -> Float[Array, "cases 3"]:
    return jax.vmap(lambda case: copies(case).start.omega)(cases)


def _names(scenario: Scenario) -> tuple[str, ...]:
    """Names of the thrusters that work at the start, two-sided ones twice, and of all effectors."""
    tables = scenario.thruster
    pairs = zip(tables, names_of(tables), strict=True)
    jets = [name for one, name in pairs if not one.failed for _ in signs(one)]
    if not tables:
        numbers = range(1, 1 + len(scenario.spacecraft.thruster_torque_axes or ()))
        jets = [str(n) for n in numbers if n not in scenario.spacecraft.failed_thrusters]
    kinds = {"thruster": jets}
    kinds |= {one.name: names_of(getattr(scenario, one.name)) for one in EFFECTORS}
    return tuple(f"{kind} {name}" for kind, names in kinds.items() for name in names)


def _with_library(run: Run, path: Path) -> tuple[Run, dict[str, Any]]:
    """Return the run with the library in the loop, and the library's identity."""
    if not isinstance(run.loop, SampledLoop):
        raise ValueError("--controller: must be given with a sampled law.")
    from jaxsat.flight.external import Library, with_library  # whose imports take their time
    from jaxsat.flight.flight import flight_loop

    loop = cast(SampledLoop, flight_loop(run.loop, run.start))
    library = Library(path, loop, run.start)
    return dataclasses.replace(run, loop=with_library(loop, library)), library.identity


def study_program(scenario: Scenario, run: Run, seed: int) -> tuple[Dispersed, Program]:
    """Return the dispersed copies of a run, and the program that runs them.

    Raises `ValueError` if the `[dispersion]` table has something that the loop does not have.
    """
    dispersions = build_dispersions(cast(DispersionTable, scenario.dispersion))
    copies = Dispersed(run.loop, run.start, dispersions, seed)
    table = scenario.simulation
    cost = RunningCost(attitude=table.attitude_cost)
    program = program_of(copies, run.loop, table.duration_s, _interval(scenario), cost=cost)
    return copies, dataclasses.replace(program, tolerances=tolerances_of(scenario))


def _interval(scenario: Scenario) -> float:
    """Time (s) between two observations of a continuous loop."""
    save_every = scenario.simulation.save_every_s
    return save_every / observations_per_save(save_every)


def tolerances_of(scenario: Scenario) -> Tolerances:
    """Return the settling tolerances; under a law without a target attitude on the rate alone,
    which at rest is that of the orbit."""
    own = build_tolerances(scenario)
    if scenario.law.declaration.regulates_attitude:
        return own
    return own.of_rate(scenario.orbit.rate())


def _suitable_chunk(engine: AbstractEngine, count: int) -> int:
    """Cases of a chunk: some seconds of work for the engine, and several chunks in all."""
    if not isinstance(engine, NativeEngine):
        return max(CHUNK, engine.batch_size)
    fewest, most = NATIVE_CHUNKS
    return max(fewest, min(most, count // 16))


def _numbers(scenario: Scenario) -> dict[str, Any]:
    """Scenario data that affect numbers, without the seed, which belongs to the study."""
    data = scenario.model_dump(mode="json", exclude={"title", "description", "tuning"})
    del data["simulation"]["seed"], data["dispersion"]["case"]
    return data


def build_dispersions(table: DispersionTable) -> Dispersions:
    """Return the distributions of a `[dispersion]` table by name."""
    distributions = {name: distribution_of(entry) for name, entry in table.distributions.items()}
    return Dispersions(distributions, table.frequency_known)


def _design(table: DispersionTable, seed: int, count: int) -> AbstractDesign:
    if table.point is not None:
        return SamePoint(seed, table.point)
    if table.design == "sobol":
        return Sobol(seed)
    return LatinHypercube(seed, count) if table.design == "latin-hypercube" else Independent(seed)


def _engine(
    scenario: Scenario, run: Run, work: tuple[Program, StudyCase], name: EngineName, batch_size: int
) -> tuple[AbstractEngine, str | None]:
    """Return the engine, and the reason if it is not the requested native one."""
    solver, adaptive = scenario.simulation.solver, _adaptive(scenario, run)
    suits = not adaptive or solver.name in (None, *ADAPTIVE_SOLVERS)
    if name == "diffrax" or (name == "auto" and not suits):
        return ReferenceEngine(method=run.method, batch_size=batch_size), None
    method = solver.name or ("dopri8" if adaptive else "tsit5")
    if adaptive:
        usual = ADAPTIVE_SOLVERS.get(method)
        numbers: dict[str, Any] = {} if usual is None else {"rtol": usual, "atol": usual}
        numbers |= solver.tolerance
        stepper = AdaptiveStepper(NamedSolver(method), Tolerance(**numbers))
    else:
        substeps = round(_interval(scenario) / (solver.step_s or SMOOTH_STEP))
        stepper = FixedStepper(NamedSolver(method), max(1, substeps))
    remark = None
    if name != "scan":
        obstacle = native_obstacle(stepper, *work)
        if obstacle is None:
            return NativeEngine(stepper=stepper, batch_size=batch_size), None
        if name == "native":
            raise ValueError(f"The native engine cannot run this: {obstacle}")
        remark = f"not the native engine: {obstacle}"
    elif jax.default_backend() != "cpu" and batch_size < ACCELERATOR_BATCH:
        remark = (
            f"batches of {batch_size} cases leave an accelerator idle, "
            f"use at least {ACCELERATOR_BATCH} cases"
        )
    return ScanEngine(stepper=stepper, batch_size=batch_size), remark


def _adaptive(scenario: Scenario, run: Run) -> bool:
    """Whether jaxsat's engines take error-controlled steps."""
    loop, solver = run.loop, scenario.simulation.solver
    if isinstance(loop, SampledLoop) or solver.steps is not None or solver.step_s is not None:
        return solver.steps == "adaptive" and not isinstance(loop, SampledLoop)
    smooth = isinstance(loop, ContinuousLoop) and loop.is_smooth()
    return not smooth or solver.name in (None, *ADAPTIVE_SOLVERS)


def _requirements(scenario: Scenario, run: Run) -> Requirements | None:
    """Requirements that depend on the state of the loop alone; None without any."""
    if not scenario.requirement:
        return None
    shapes = jax.eval_shape(
        lambda: state_signals(run.loop, run.times[0], run.loop.start(run.start))
    )
    chosen = [one for one in scenario.requirement if raw_signals(one.parsed) <= set(shapes)]
    if not chosen:
        return None
    formulas = tuple(one.parsed for one in chosen)
    names = tuple(one.id for one in chosen)
    needs_sun = any(one.signal == "sun_angle" for all in formulas for one in comparisons(all))
    sun = scenario.disturbance.sun_direction
    light = sunlight_of(scenario.orbit, sun) if needs_sun else None
    return Requirements(names, formulas, scenario.simulation.duration_s, light)
