"""Construction of a scenario's control law, with the law's own model of the plant."""

from contextlib import nullcontext

import numpy as np

from jaxsat.control.controller import AbstractController, LawContext, UnsuitableModel
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.checks import as_float
from jaxsat.core.declaration.laws import Law
from jaxsat.scenario.build.actuators import magnetic_context, wheel_context
from jaxsat.scenario.build.errors import BuildError
from jaxsat.scenario.build.plant import orbit_of, periodic_torque
from jaxsat.scenario.build.plugin_trial import LAW, sound
from jaxsat.scenario.build.thrusters import rate_noise, thruster_context
from jaxsat.scenario.control import ModelTable, is_plugin
from jaxsat.scenario.derived import believed_axes, torque_limit
from jaxsat.scenario.errors import Issue
from jaxsat.scenario.parts.torque_makers import TorqueMakers, left_by_wheels, wheel_axes
from jaxsat.scenario.parts.wheels import free_inertia, rotors
from jaxsat.scenario.quantities import values_of
from jaxsat.scenario.schema import Scenario
from jaxsat.spacecraft.dynamics import RigidBody
from jaxsat.spacecraft.environment.disturbances import AbstractDisturbance, NoDisturbance
from jaxsat.spacecraft.spacecraft import Spacecraft


def build_controller(scenario: Scenario) -> AbstractController | AbstractSampledController:
    """Return the control law with its own model of the plant.

    Raises `BuildError` if the law cannot be built for its model.
    """
    law, control = scenario.law, scenario.control
    values = values_of(law.declaration.keys, control)
    table = getattr(control, "model", ModelTable())
    disturbance = scenario.disturbance
    context = LawContext(
        _model(scenario, table, getattr(control, "measured_disturbance", ())),
        torque_limit(scenario),
        disturbance.amplitude_N_m,
        disturbance.frequency_rad_s,
        believed_axes(scenario),
        thruster_context(scenario),
        wheel_context(scenario),
        disturbance.gravity_gradient,
        wheel_axes(scenario.wheel) if scenario.wheel else None,
        magnetic_context(scenario),
        rate_noise(scenario) if law.declaration.sampled else 0.0,
        0.0 if scenario.sampling is None else scenario.sampling.delay_s,
    )
    foreign = is_plugin(law.name)
    with sound(law, LAW, law.controller, "can be built") if foreign else nullcontext():
        try:
            controller = law.from_table(values, context)
        except UnsuitableModel as error:
            raise BuildError(_model_issue(law, table, error)) from error
    if not isinstance(controller, law.controller):
        message = f'must be such that `from_table` of the law "{law.name}" gives the law, got '
        raise BuildError(Issue(LAW, message + type(controller).__name__))
    if isinstance(controller, AbstractSampledController):
        period = control.period_s
        if float(np.asarray(controller.period)) != float(np.asarray(as_float(period))):
            message = (
                f"must be the attribute `period` of the law, {controller.period}, got {period}"
            )
            raise BuildError(Issue(("control", "period_s"), message))
    return controller


def _model(scenario: Scenario, table: ModelTable, measured: tuple[bool, ...]) -> RigidBody:
    """The controller's model of the plant, with the periodic torques that it measures.

    Its inertia excludes the rotors, which a torque on the body does not turn.
    """
    inertia = table.inertia_kg_m2 or scenario.spacecraft.inertia_kg_m2
    relation = table.orbit_relation or scenario.orbit.relation
    rate = scenario.orbit.rate() if table.orbit_rate_rad_s is None else table.orbit_rate_rad_s
    disturbance: AbstractDisturbance = NoDisturbance()
    if any(measured):
        amplitude = np.where(measured, scenario.disturbance.amplitude_N_m, 0.0)
        disturbance = periodic_torque(amplitude, scenario.disturbance)
    third_rate = scenario.spacecraft.third_rate
    holds_third_rate = third_rate == "held" or _wheels_hold_the_third_rate(scenario)
    if rotors(scenario.wheel).any():
        inertia = free_inertia(inertia, scenario.wheel)
    return RigidBody(
        Spacecraft(as_float(inertia)), orbit_of(relation, rate), disturbance, holds_third_rate
    )


def _wheels_hold_the_third_rate(scenario: Scenario) -> bool:
    """Whether wheels alone make the two torques: without momentum they have no torque about z."""
    makers = TorqueMakers.of(scenario)
    if not makers.wheels or makers.law.torques != 2:
        return False
    return not left_by_wheels(makers.wheels, 2).any()


def _model_issue(law: Law, table: ModelTable, error: UnsuitableModel) -> Issue:
    """Issue at the key because of which the law cannot be built."""
    if error.about == "inertia":
        own = table.inertia_kg_m2 is not None
        key = "control.model.inertia_kg_m2" if own else "spacecraft.inertia_kg_m2"
    elif error.about == "inclination":
        key = "orbit.inclination_rad"
    else:
        own = table.orbit_rate_rad_s is not None
        key = "control.model.orbit_rate_rad_s" if own else "orbit.rate_rad_s"
    message = f'must be such that the law "{law.name}" {error}'
    involved = (("control", "law"), ("orbit", "altitude_km"), ("control",))
    return Issue(tuple(key.split(".")), message, involved)
