"""From a scenario to the objects of the core."""

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import cast

import diffrax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.attitude import WZ, AbstractAttitude, Quaternion
from jaxsat.checks import as_float
from jaxsat.control import (
    AbstractController,
    AbstractSampledController,
    Coast,
    InternalModel,
    RateLaw,
    SwitchingLaw,
    ThreeAxisLaw,
    oscillatory_settling,
    three_slew_settling,
)
from jaxsat.dynamics import PlantState, RigidBody
from jaxsat.environment import (
    AbstractDisturbance,
    AbstractOrbit,
    ConstantTorque,
    ExactOrbit,
    GravityGradient,
    NoDisturbance,
    PeriodicTorque,
    SmallAngleOrbit,
    SumOfDisturbances,
    circular_orbit_rate,
)
from jaxsat.montecarlo import with_numbers
from jaxsat.noise import key_of_seed
from jaxsat.scenario.control_tables import (
    CoastTable,
    ModelTable,
    OscillatoryTable,
    RateTable,
    SwitchingTable,
    ThreeAxisTable,
    ThreeSlewTable,
)
from jaxsat.scenario.coordinates import uses_error_coordinates
from jaxsat.scenario.dispersion_tables import SamplingTable
from jaxsat.scenario.layout import working_thrusters
from jaxsat.scenario.schema import Scenario, flattened
from jaxsat.scenario.tables import DisturbanceTable
from jaxsat.scenario.tuning_tables import TUNABLE
from jaxsat.simulation import (
    AbstractLoop,
    ContinuousLoop,
    ErrorCoordinateLoop,
    Method,
    SampledLoop,
    Trajectory,
    adaptive,
    default_method,
    fixed,
    simulate,
)
from jaxsat.simulation.methods import SMALLEST_STEP
from jaxsat.vehicle import Actuators, Sensors, Spacecraft

SOLVERS: dict[str, type[diffrax.AbstractSolver]] = {
    "euler": diffrax.Euler,
    "midpoint": diffrax.Midpoint,
    "heun": diffrax.Heun,
    "ralston": diffrax.Ralston,
    "bosh3": diffrax.Bosh3,
    "tsit5": diffrax.Tsit5,
    "dopri5": diffrax.Dopri5,
    "dopri8": diffrax.Dopri8,
}
DEFAULT_SUBSTEPS = 4


@dataclass(frozen=True)
class Run:
    """All that `jaxsat.simulation.simulate` takes, made from a scenario."""

    loop: AbstractLoop
    start: PlantState
    times: Float[Array, " times"]
    method: Method

    @property
    def mode_names(self) -> Mapping[int, str]:
        """What the numbers of `mode` mean, for sampled laws; else empty."""
        return self.loop.controller.mode_names if isinstance(self.loop, SampledLoop) else {}

    def simulate(self) -> Trajectory:
        """Run the loop."""
        return simulate(self.loop, self.start, self.times, method=self.method)


def build(scenario: Scenario) -> Run:
    """The closed loop of a scenario, its start, the times to save and the way to integrate.

    Arrays take the default precision: switch 64-bit on first (`jax_enable_x64`).
    """
    loop = build_loop(scenario)
    return Run(loop, build_start(scenario), build_times(scenario), build_method(scenario, loop))


def build_loop(scenario: Scenario) -> AbstractLoop:
    """Plant, controller and thrusters in the coordinates that the scenario asks for."""
    plant, controller = build_plant(scenario), build_controller(scenario)
    if isinstance(controller, AbstractSampledController):
        substeps = scenario.simulation.solver.substeps or DEFAULT_SUBSTEPS
        sensors, delay = build_sampling(scenario)
        return SampledLoop(plant, controller, build_actuators(scenario), substeps, sensors, delay)
    if uses_error_coordinates(flattened(scenario)):
        return ErrorCoordinateLoop(plant, cast(RateLaw | ThreeAxisLaw, controller))
    return ContinuousLoop(plant, controller, build_actuators(scenario))


def build_plant(scenario: Scenario) -> RigidBody:
    """The rigid body in its orbit under its disturbances."""
    table = scenario.spacecraft
    spacecraft = Spacecraft(as_float(table.inertia_kg_m2))
    orbit = _orbit(scenario.orbit.relation, orbit_rate(scenario))
    held = table.third_rate == "held"
    return RigidBody(spacecraft, orbit, _disturbance(scenario), held)


def orbit_rate(scenario: Scenario) -> float:
    """ω0, rad/s, given or by the altitude."""
    rate, altitude = scenario.orbit.rate_rad_s, scenario.orbit.altitude_km
    return circular_orbit_rate(1000 * cast(float, altitude)) if rate is None else rate


def build_actuators(scenario: Scenario) -> Actuators:
    """The thrusters left; under `law = "coast"` any will do, as no torque is commanded."""
    table = scenario.spacecraft
    thrusters = working_thrusters(table.thruster_torque_axes, table.failed_thrusters)
    limit = math.inf if table.torque_limit_N_m is None else table.torque_limit_N_m
    if scenario.control.law == "coast":
        return Actuators(thrusters.torque_axes, jnp.zeros((thrusters.count, 2)), as_float(limit))
    return Actuators.of(thrusters, limit)


def build_controller(scenario: Scenario) -> AbstractController | AbstractSampledController:
    """The control law with its own model of the plant."""
    control = scenario.control
    if isinstance(control, CoastTable):
        return Coast()
    if isinstance(control, OscillatoryTable | ThreeSlewTable):
        return _settling_law(scenario, control)
    model = _model(scenario, control.model, control.measured_disturbance)
    if isinstance(control, RateTable):
        return _rate_law(control, model)
    if isinstance(control, ThreeAxisTable):
        return _three_axis_law(scenario, control, model)
    return _switching_law(scenario, control, model)


def build_sampling(scenario: Scenario) -> tuple[Sensors | None, Float[Array, ""] | None]:
    """Sensors and delay; None for those that are perfect in every case."""
    table, dispersion = scenario.sampling or SamplingTable(), scenario.dispersion
    noises = (table.rate_noise_rad_s, table.attitude_noise_rad)
    dispersed = dispersion is not None and (
        dispersion.rate_noise_rad_s is not None or dispersion.attitude_noise_rad is not None
    )
    key = key_of_seed(scenario.simulation.seed)
    sensors = Sensors(as_float(noises[0]), as_float(noises[1]), key)
    late = table.delay_s > 0 or (dispersion is not None and dispersion.delay_s is not None)
    return (
        sensors if any(noises) or dispersed else None,
        as_float(table.delay_s) if late else None,
    )


def build_start(scenario: Scenario) -> PlantState:
    """The state at time zero in the attitude parameters that are integrated."""
    table = scenario.initial
    if table.quaternion is None:
        w, z = cast(tuple[float, ...], table.w), cast(float, table.z_rad)
        attitude: AbstractAttitude = WZ(as_float(w), as_float(z))
    else:
        attitude = Quaternion(as_float(table.quaternion))
    wanted = scenario.simulation.attitude == "wz"
    attitude = attitude.as_wz() if wanted else attitude.as_quaternion()
    return PlantState(attitude, as_float(table.omega_rad_s))


def build_times(scenario: Scenario) -> Float[Array, " times"]:
    """Times to save at from zero to the end, s; on the samples of a sampled law."""
    table = scenario.simulation
    unit, count = table.save_every_s, round(table.duration_s / table.save_every_s)
    if not isinstance(scenario.control, SwitchingTable | OscillatoryTable | ThreeSlewTable):
        return jnp.asarray(np.arange(count + 1) * unit)
    period = scenario.control.period_s
    return jnp.asarray(np.arange(count + 1) * round(unit / period) * period)


def build_method(scenario: Scenario, loop: AbstractLoop) -> Method:
    """Solver and steps: those of `[simulation.solver]`, or what suits the loop."""
    table = scenario.simulation.solver
    solver = SOLVERS[table.name]() if table.name else None
    if table.steps == "fixed" or table.step_s is not None:
        return fixed(cast(float, table.step_s), solver)
    given = {
        "rtol": table.rtol,
        "atol": table.atol,
        "min_step": table.min_step_s,
        "max_steps": table.max_steps,
    }
    given = {name: value for name, value in given.items() if value is not None}
    if table.steps is None and not given:
        suitable = default_method(loop)
        return dataclasses.replace(suitable, solver=solver or suitable.solver)
    return adaptive(solver=solver, **{"min_step": SMALLEST_STEP, **given})


def _orbit(relation: str, rate: float) -> AbstractOrbit:
    return (ExactOrbit if relation == "exact" else SmallAngleOrbit)(as_float(rate))


def _disturbance(scenario: Scenario) -> AbstractDisturbance:
    table = scenario.disturbance
    terms: list[AbstractDisturbance] = [_periodic(table.amplitude_N_m, table)]
    if any(table.constant_N_m):
        terms.append(ConstantTorque(as_float(table.constant_N_m)))
    if table.gravity_gradient:
        terms.append(GravityGradient(as_float(orbit_rate(scenario))))
    return terms[0] if len(terms) == 1 else SumOfDisturbances(tuple(terms))


def _model(scenario: Scenario, table: ModelTable, measured: tuple[bool, ...]) -> RigidBody:
    """What the controller believes, with the periodic torques that it measures."""
    inertia = table.inertia_kg_m2 or scenario.spacecraft.inertia_kg_m2
    relation = table.orbit_relation or scenario.orbit.relation
    rate = orbit_rate(scenario) if table.orbit_rate_rad_s is None else table.orbit_rate_rad_s
    known: AbstractDisturbance = NoDisturbance()
    if any(measured):
        amplitude = np.where(measured, scenario.disturbance.amplitude_N_m, 0.0)
        known = _periodic(amplitude, scenario.disturbance)
    held = scenario.spacecraft.third_rate == "held"
    return RigidBody(Spacecraft(as_float(inertia)), _orbit(relation, rate), known, held)


def _periodic(amplitude: tuple[float, ...] | np.ndarray, table: DisturbanceTable) -> PeriodicTorque:
    return PeriodicTorque(
        as_float(amplitude), as_float(table.frequency_rad_s), as_float(table.phase_rad)
    )


def _rate_law(table: RateTable | SwitchingTable, model: RigidBody) -> RateLaw:
    return RateLaw(
        model, as_float(table.k1), as_float(table.k2), as_float(table.omega3_width_rad_s)
    )


def _three_axis_law(
    scenario: Scenario, table: ThreeAxisTable | SwitchingTable, model: RigidBody
) -> ThreeAxisLaw:
    frequency = table.internal_model_frequency_rad_s or scenario.disturbance.frequency_rad_s[:2]
    return ThreeAxisLaw(
        model,
        as_float(table.k3),
        as_float(table.mu),
        as_float(table.a),
        as_float(table.k4),
        InternalModel(as_float(frequency)) if table.internal_model else None,
        as_float(table.attitude_weight_N_m),
        as_float(table.saturation_width),
        as_float(table.tilt_width),
    )


def _settling_law(
    scenario: Scenario, table: OscillatoryTable | ThreeSlewTable
) -> AbstractSampledController:
    model = _model(scenario, table.model, (False, False, False))
    settling = oscillatory_settling if isinstance(table, OscillatoryTable) else three_slew_settling
    controller = settling(
        model,
        cast(float, scenario.spacecraft.torque_limit_N_m),
        observe=table.observe_ripple,
        estimate=table.estimate_axes,
        period=table.period_s,
    )
    places = TUNABLE.get(table.law, {})
    given = {place: getattr(table, key) for key, place in places.items()}
    return with_numbers(controller, {k: as_float(v) for k, v in given.items() if v is not None})


def _switching_law(scenario: Scenario, table: SwitchingTable, model: RigidBody) -> SwitchingLaw:
    limit = scenario.spacecraft.torque_limit_N_m
    moments = np.diag(np.asarray(model.spacecraft.inertia))[:2]
    usual = (math.inf if limit is None else limit) / moments
    rate_limit, three_axis_limit = (
        table.rate_slope_limit_rad_s2,
        table.three_axis_slope_limit_rad_s2,
    )
    return SwitchingLaw(
        rate_law=_rate_law(table, model),
        three_axis_law=_three_axis_law(scenario, table, model),
        upper_threshold=as_float(table.upper_threshold_rad_s),
        lower_threshold=as_float(table.lower_threshold_rad_s),
        period=as_float(table.period_s),
        rate_slope_limit=as_float(usual if rate_limit is None else rate_limit),
        three_axis_slope_limit=as_float(
            5 * usual if three_axis_limit is None else three_axis_limit
        ),
    )
