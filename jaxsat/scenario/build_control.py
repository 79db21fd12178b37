"""From a scenario to its control law, with the law's own model of the plant."""

import math
from typing import cast

import numpy as np

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
    ripple_filter,
    three_slew_settling,
)
from jaxsat.dynamics import RigidBody
from jaxsat.environment import (
    AbstractDisturbance,
    NoDisturbance,
)
from jaxsat.scenario.build_errors import BuildError
from jaxsat.scenario.build_plant import orbit_of, orbit_rate, periodic_torque
from jaxsat.scenario.control_tables import (
    CoastTable,
    ModelTable,
    OscillatoryTable,
    RateTable,
    SwitchingTable,
    ThreeAxisTable,
    ThreeSlewTable,
)
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.schema import Scenario
from jaxsat.scenario.tuning_tables import TUNABLE
from jaxsat.vehicle import Spacecraft


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


def _model(scenario: Scenario, table: ModelTable, measured: tuple[bool, ...]) -> RigidBody:
    """What the controller believes, with the periodic torques that it measures."""
    inertia = table.inertia_kg_m2 or scenario.spacecraft.inertia_kg_m2
    relation = table.orbit_relation or scenario.orbit.relation
    rate = orbit_rate(scenario) if table.orbit_rate_rad_s is None else table.orbit_rate_rad_s
    known: AbstractDisturbance = NoDisturbance()
    if any(measured):
        amplitude = np.where(measured, scenario.disturbance.amplitude_N_m, 0.0)
        known = periodic_torque(amplitude, scenario.disturbance)
    held = scenario.spacecraft.third_rate == "held"
    return RigidBody(Spacecraft(as_float(inertia)), orbit_of(relation, rate), known, held)


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
    from jaxsat.montecarlo import with_numbers  # takes its time, and few laws need it

    model = _model(scenario, table.model, (False, False, False))
    amplitude, frequency = table.ripple_amplitude_N_m, table.ripple_frequency_rad_s
    disturbance = scenario.disturbance
    ripple = ripple_filter(
        model,
        disturbance.amplitude_N_m[2] if amplitude is None else amplitude,
        disturbance.frequency_rad_s[2] if frequency is None else frequency,
    )
    settling = oscillatory_settling if isinstance(table, OscillatoryTable) else three_slew_settling
    try:
        controller = settling(
            model,
            cast(float, scenario.spacecraft.torque_limit_N_m),
            observe=table.observe_ripple,
            estimate=table.estimate_axes,
            period=table.period_s,
            ripple=ripple,
        )
    except ValueError as error:
        raise BuildError(_unsteerable(table, model, error)) from error
    places = TUNABLE.get(table.law, {})
    given = {place: getattr(table, key) for key, place in places.items()}
    return with_numbers(controller, {k: as_float(v) for k, v in given.items() if v is not None})


def _unsteerable(
    table: OscillatoryTable | ThreeSlewTable, model: RigidBody, error: ValueError
) -> Issue:
    """What stands against the regulator that both settling laws end with."""
    first, second, _ = np.asarray(model.spacecraft.moments)
    rate = float(model.orbit.rate)
    if rate > 0:
        own = table.model.inertia_kg_m2 is not None
        key = "control.model.inertia_kg_m2" if own else "spacecraft.inertia_kg_m2"
    elif table.model.orbit_rate_rad_s is not None:
        key = "control.model.orbit_rate_rad_s"
    else:
        key = "orbit.rate_rad_s"
    message = (
        f'must be such that the law "{table.law}" can hold the attitude, which it does by J1 apart '
        f"from J2 and an orbit rate above 0, got J1 = {first:.6g} and J2 = {second:.6g} kg m², "
        f"{rate:.6g} rad/s ({str(error).rstrip('.')})"
    )
    involved = (("control", "law"), ("orbit", "altitude_km"), ("control",))
    return Issue(tuple(key.split(".")), message, involved)


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
