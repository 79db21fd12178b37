"""Construction of the closed loop and the run of a scenario."""

import enum
import weakref
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Any, cast

import jax
import numpy as np
from jaxtyping import Array, Float

from jaxsat.control.controller import AbstractBacksteppingLaw, AbstractController, Coast
from jaxsat.control.sampled import AbstractSampledController, Guard
from jaxsat.core.attitude import WZ, AbstractAttitude, Quaternion
from jaxsat.core.checks import as_array, as_float
from jaxsat.core.errors import PrecisionError
from jaxsat.core.ranges import MAX_FIXED_STEPS
from jaxsat.core.solvers import NamedSolver
from jaxsat.core.tolerances import Tolerances
from jaxsat.scenario.build.actuators import build_distribution, build_thrusters, ideal_thrusters
from jaxsat.scenario.build.controller import build_controller
from jaxsat.scenario.build.effector_trial import require_acts, require_steered
from jaxsat.scenario.build.errors import BuildError, at_key, made_of_numbers
from jaxsat.scenario.build.plant import build_effectors, build_plant
from jaxsat.scenario.build.plugin_trial import require_runs
from jaxsat.scenario.build.sensors import build_navigation, build_sampling, build_tachometers
from jaxsat.scenario.control import is_plugin
from jaxsat.scenario.derived import has_invalid_samples, hold_samples_of, uses_error_coordinates
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.resolution import substeps_of
from jaxsat.scenario.schema import Scenario, flattened
from jaxsat.scenario.tables import MAX_SAMPLED_STEPS, SolverTable
from jaxsat.simulation.engine.single import fly
from jaxsat.simulation.error_coordinates import ErrorCoordinateLoop
from jaxsat.simulation.loops import AbstractLoop, ContinuousLoop
from jaxsat.simulation.methods import MIN_STEP, Method, adaptive, default_method, fixed
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.simulation.trajectory import Trajectory
from jaxsat.spacecraft.dynamics import PlantState, RigidBody
from jaxsat.spacecraft.effector import AbstractEffector


@dataclass(frozen=True)
class Run:
    """The closed loop of a scenario and how it is run."""

    loop: AbstractLoop
    start: PlantState
    times: Float[Array, " times"]
    method: Method
    tolerances: Tolerances = field(default_factory=Tolerances)

    @property
    def modes(self) -> type[enum.IntEnum] | None:
        """Meaning of the numbers of `mode`, for sampled laws; else None."""
        return self.loop.controller.modes if isinstance(self.loop, SampledLoop) else None

    def simulate(self, tell: Callable[[str], None] = lambda obstacle: None) -> Trajectory:
        """Run the loop by `simulation.engine.fly`; `tell` receives the reason for diffrax."""
        return fly(self.loop, self.start, self.times, self.method, tell, self.tolerances)


def build(scenario: Scenario) -> Run:
    """Return the closed loop of a scenario, its start, the times to save and the integration
    method.

    Raises `PrecisionError` if JAX is set to 32-bit floats, and `BuildError`, which names the key,
    if the numbers of the scenario make no such loop. The last result is cached for its scenario.
    """
    if not jax.config.read("jax_enable_x64"):
        raise PrecisionError(
            "Scenarios need 64-bit floats, but JAX is set to 32-bit ones: call "
            '`jax.config.update("jax_enable_x64", True)` first.'
        )
    for reference, run in _latest:
        if reference() is scenario:
            return run
    run = _build(scenario)
    _latest[:] = [(weakref.ref(scenario), run)]
    return run


_latest: list[tuple[weakref.ref[Scenario], Run]] = []
"""The last scenario built and its run: both are frozen."""


def _build(scenario: Scenario) -> Run:
    loop = build_loop(scenario)
    with at_key("initial"):
        start = made_of_numbers(build_start(scenario, loop.plant.effectors))
    steering = getattr(getattr(loop, "distribution", None), "steering", ())
    require_acts(loop.plant.effectors, start)
    require_steered(steering, loop.plant.effectors, start)
    law = scenario.law
    if is_plugin(law.name):
        controller = (
            loop.law if isinstance(loop, ErrorCoordinateLoop) else cast(Any, loop).controller
        )
        require_runs(law, controller, start)
    method, tolerances = build_method(scenario, loop), build_tolerances(scenario)
    return Run(loop, start, build_times(scenario), method, tolerances)


def build_uncontrolled(scenario: Scenario) -> tuple[ContinuousLoop, PlantState]:
    """Return plant and thrusters without the control law, and the start.

    Coulomb friction and failures of wheels, which do not affect controllability, are left out.
    Raises `BuildError` as `build` does.
    """
    with at_key("spacecraft"):
        plant = build_plant(scenario)
        others = tuple(one.without_corners() for one in plant.effectors)
        plant = plant.with_effectors((ideal_thrusters(scenario, torques=0), *others))
        loop = ContinuousLoop(plant, Coast())
    with at_key("initial"):
        start = build_start(
            scenario.with_keys("simulation", attitude="quaternion"), plant.effectors
        )
    return made_of_numbers(loop), made_of_numbers(start)


def build_loop(scenario: Scenario) -> AbstractLoop:
    """Return plant, controller and thrusters in the coordinates of the scenario.

    Raises `BuildError` as `build` does.
    """
    with at_key("spacecraft"):
        plant = made_of_numbers(build_plant(scenario))
    with at_key("control"):
        controller = made_of_numbers(build_controller(scenario))
        return _close_loop(scenario, plant, controller)


def _close_loop(
    scenario: Scenario, plant: RigidBody, controller: AbstractController | AbstractSampledController
) -> AbstractLoop:
    is_sampled = isinstance(controller, AbstractSampledController)
    if not is_sampled and uses_error_coordinates(
        flattened(scenario) | {"control.law": scenario.law}
    ):
        return ErrorCoordinateLoop(plant, cast(AbstractBacksteppingLaw, controller))
    thrusters = build_thrusters(scenario)
    if thrusters is not None:
        plant = plant.with_effectors((thrusters, *plant.effectors))
    distribution = build_distribution(scenario, plant)
    if not is_sampled:
        return ContinuousLoop(plant, controller, distribution)
    sensors, delay = build_sampling(scenario)
    guard = Guard(hold_samples_of(scenario)) if has_invalid_samples(scenario) else None
    return SampledLoop(
        plant,
        controller,
        distribution,
        substeps_of(scenario),
        sensors,
        delay,
        build_navigation(scenario, plant),
        build_tachometers(scenario),
        guard,
    )


def build_start(scenario: Scenario, effectors: tuple[AbstractEffector, ...] = ()) -> PlantState:
    """Return the state at time zero in the attitude parameters that are integrated.

    The states of all these effectors are included, None for those at rest.
    """
    table = scenario.initial
    if table.quaternion is None:
        w, z = cast(tuple[float, ...], table.w), cast(float, table.z_rad)
        attitude: AbstractAttitude = WZ(as_float(w), as_float(z))
    else:
        attitude = Quaternion(as_float(table.quaternion))
    in_wz = scenario.simulation.attitude == "wz"
    attitude = attitude.as_wz() if in_wz else attitude.as_quaternion()
    states = {one.kind: state for one, state in build_effectors(scenario)}
    own = tuple(states.get(one.kind) for one in effectors)
    return PlantState(attitude, as_float(table.omega_rad_s), own or None)


def build_tolerances(scenario: Scenario) -> Tolerances:
    """Return the settling tolerances of the scenario."""
    return Tolerances.of_keys(**scenario.settled.model_dump())


def build_times(scenario: Scenario) -> Float[Array, " times"]:
    """Times to save, s, from zero to the end; on the samples of a sampled law."""
    table = scenario.simulation
    unit, count = table.save_every_s, round(table.duration_s / table.save_every_s)
    if not scenario.law.declaration.sampled:
        return as_array(np.arange(count + 1) * unit)
    period = scenario.control.period_s
    return as_array(np.arange(count + 1) * round(unit / period) * period)


def build_method(scenario: Scenario, loop: AbstractLoop) -> Method:
    """Return solver and steps: those of `[simulation.solver]`, or defaults for the loop.

    Raises `BuildError` for more steps than a run may have.
    """
    method = _method(scenario.simulation.solver, loop)
    _require_few_steps(scenario, loop, method)
    return method


def _method(table: SolverTable, loop: AbstractLoop) -> Method:
    solver = NamedSolver(table.name) if table.name else None
    if table.steps == "fixed" or table.step_s is not None:
        return fixed(cast(float, table.step_s), solver)
    if table.steps is None and not table.tolerance:
        return default_method(loop, solver)
    numbers: dict[str, Any] = {"min_step": MIN_STEP, **table.tolerance}
    return adaptive(solver=solver, **numbers)


def _require_few_steps(scenario: Scenario, loop: AbstractLoop, method: Method) -> None:
    table, most = scenario.simulation, MAX_FIXED_STEPS
    if isinstance(loop, SampledLoop):
        most = MAX_SAMPLED_STEPS
        step = scenario.control.period_s / loop.substeps
        key = "control.period_s" if table.solver.substeps is None else "simulation.solver.substeps"
    elif method.first_step is None:
        return  # adaptive steps have their own limit
    else:
        step = float(method.first_step)
        key = "simulation.duration_s" if table.solver.step_s is None else "simulation.solver.step_s"
    count = table.duration_s / step
    if count > most:
        message = (
            f"must leave at most {most} steps in a run, got {count:.3g} of {step:.3g} s in "
            f"{table.duration_s:g} s"
        )
        involved = ("simulation.duration_s", "simulation.solver.step_s", "control.period_s")
        involved = tuple(tuple(other.split(".")) for other in involved)
        raise BuildError(Issue(tuple(key.split(".")), message, involved))
