"""Capability of a vehicle with failures: verdict, attitudes that it can hold, scale and period."""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from jaxsat.controllability.cone import ROUNDING
from jaxsat.controllability.judgement import Judgement
from jaxsat.controllability.wording import lost_words, verdict_sentence
from jaxsat.core.allocation import torque_directions
from jaxsat.core.declaration.actuators import ACTUATORS
from jaxsat.core.declaration.laws import Law
from jaxsat.core.declaration.tuned_gains import STEPS
from jaxsat.core.errors import JaxsatError
from jaxsat.core.inertia import normal_axes
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.actuator_set import judge_scenario, law_words
from jaxsat.scenario.build.balance import turn_to_held, undriven_balance
from jaxsat.scenario.cautions import HELD_TURN
from jaxsat.scenario.control import known_law
from jaxsat.scenario.derived import believed_axes, has_sensors, torque_limit
from jaxsat.scenario.domain import held_turn
from jaxsat.scenario.parts.wheels import inertia_of
from jaxsat.scenario.quantities import inertia_matrix
from jaxsat.scenario.resolution import fastest


class UnsuitableVehicle(JaxsatError, ValueError):
    """A vehicle for which no controller can be designed until its scenario is completed."""


@dataclass(frozen=True)
class VehicleVerdict:
    """Verdict on the remaining actuators, and the attitude that they can hold.

    `lost` is what the actuators left lack, `turn` the rotation vector (rad, body axes) from the
    target to the nearest attitude that can be held without torque about the undriven axis: zeros
    where the target can be, None where none can. `balance` describes the environmental torque about
    that axis, `in_flight` later failures, `orbit` whether gravity gradient acts, `laws` which laws
    apply.
    """

    judgement: Judgement
    lost: str
    turn: tuple[float, float, float] | None
    in_flight: tuple[str, ...]
    orbit: tuple[str, ...]
    laws: str
    balance: tuple[str, ...] = ()

    @property
    def holds(self) -> bool:
        """Whether a law can hold the target attitude within the tolerances of settling."""
        if self.judgement.laws == "none":
            return False
        if self.judgement.laws == "three torques":
            return True
        return self.turn is not None and max(map(abs, self.turn)) <= HELD_TURN

    @property
    def two_torques(self) -> bool:
        """Whether laws make two torques, by thrusters or wheels."""
        return self.judgement.laws in ("two torques", "two wheels")

    @property
    def _need(self) -> str:
        if self.judgement.laws == "nearest attitude":
            return "another momentum about the axis that no wheel drives"
        return "a torque about the unactuated axis"

    def lines(self) -> list[str]:
        """Return the verdict as sentences."""
        sentences = [verdict_sentence(self.judgement)]
        sentences.append(f"Missing: {self.lost}.")
        sentences.append(f"Laws: {self.laws}.")
        if self.judgement.laws == "none":
            pass  # no law holds any attitude
        elif self.holds:
            sentences.append("The target attitude can be held.")
        elif self.turn is None:
            sentences.append("No attitude can be held without torque about the unactuated axis.")
        else:
            turn = ", ".join(f"{round(part, 6):.3g}" for part in self.turn)
            sentences.append(
                f"The target attitude cannot be held: it needs {self._need}. "
                "The nearest attitude that can be held is rotated from it by the rotation vector "
                f"({turn}) rad, body axes."
            )
        return [*sentences, *self.balance, *self.orbit, *self.in_flight]


class Scale(NamedTuple):
    """Reference moment of inertia J0 (kg m²), torque (N m) and unit of time τ = √(J0/T) (s).

    `moments` are those about the two driven axes, reduced as in `normal_axes`.
    """

    moments: tuple[float, float]
    torque: float

    @property
    def moment(self) -> float:
        """J0, the geometric mean of both moments."""
        return math.sqrt(self.moments[0] * self.moments[1])

    @property
    def time(self) -> float:
        """τ, in which the torque turns J0 by half a radian from rest."""
        return math.sqrt(self.moment / self.torque)


def require_judged(scenario: Scenario) -> None:
    """Raise `UnsuitableVehicle` for actuators that the verdict does not include."""
    names = [one.name for one in ACTUATORS if one.judged]
    for one in ACTUATORS:
        if getattr(scenario, one.name) and one.name not in names:
            raise UnsuitableVehicle(
                f"{one.name} must be omitted: jaxsat designs controllers by a verdict that counts "
                f"{', '.join(names)} alone"
            )


def vehicle_verdict(scenario: Scenario) -> VehicleVerdict:
    """Return the verdict on the actuators that work at the start; raises as `require_judged`."""
    require_judged(scenario)
    judgement, balance = judge_scenario(scenario), undriven_balance(scenario)
    return VehicleVerdict(
        judgement,
        lost_words(judgement),
        _held_turn(scenario, judgement) if balance is None else balance.turn,
        _in_flight(scenario),
        _orbit_lines(scenario),
        law_words(scenario, judgement),
        () if balance is None else tuple(balance.lines()),
    )


def scale_of(scenario: Scenario) -> Scale:
    """Return the scale that makes the gains of a scenario's law dimensionless.

    Where only magnetorquers make torques the unit of time is 1/ω0. Raises `UnsuitableVehicle` where
    no torque limit is known.
    """
    limit = torque_limit(scenario)
    inertia = inertia_of(scenario)
    by_rods = limit is None and scenario.magnetorquer and not scenario.wheel
    if scenario.law.declaration.takes_orbits or by_rods:
        return scale_of_orbit(scenario)
    if limit is None:
        key = "[[wheel]] torque_limit_N_m" if scenario.wheel else "spacecraft.torque_limit_N_m"
        raise UnsuitableVehicle(f"{key} must be given in N m: gains are scaled by it")
    try:
        _, (first, second, _) = normal_axes(inertia, torque_directions(believed_axes(scenario)))
    except ValueError:
        first, second = np.linalg.eigvalsh(inertia)[1:]
    return Scale((float(first), float(second)), float(limit))


def scale_of_orbit(scenario: Scenario) -> Scale:
    """Return the scale of motion by magnetorquers, whose unit of time is 1/ω0."""
    moments = np.linalg.eigvalsh(inertia_of(scenario))[1:]
    torque = float(np.sqrt(np.prod(moments))) * scenario.orbit.rate() ** 2
    return Scale((float(moments[0]), float(moments[1])), torque)


def coupling(inertia: np.ndarray, directions: np.ndarray) -> float:
    """Return c = (S1 - S2) / n·Jn of a body (3, 3) with torques about two directions (3, 2)."""
    _, (first, second, along) = normal_axes(inertia, directions)
    return (first - second) / along


def _held_turn(scenario: Scenario, judgement: Judgement) -> tuple[float, float, float] | None:
    """Return the rotation to the nearest attitude that can be held; None where there is none.

    It balances the torques about the undriven axis; wheels, which store them, hold any attitude.
    """
    zero = (0.0, 0.0, 0.0)
    if (by_wheels := turn_to_held(scenario, judgement)) is not None:
        return tuple(by_wheels.tolist())
    if judgement.laws != "two torques" or scenario.wheel:
        return zero
    turn = held_turn(scenario, inertia_matrix(scenario.spacecraft.inertia_kg_m2))
    return None if turn is None else tuple(np.where(np.abs(turn) < ROUNDING, 0.0, turn).tolist())


def _orbit_lines(scenario: Scenario) -> tuple[str, ...]:
    if scenario.orbit.rate() == 0:
        return ()
    if scenario.disturbance.gravity_gradient:
        return ("Gravity gradient acts in every case.",)
    return (
        "No gravity gradient acts: in orbit it does, give `disturbance.gravity_gradient = true`.",
    )


def _in_flight(scenario: Scenario) -> tuple[str, ...]:
    if not scenario.failure:
        return ()
    draws = {} if scenario.dispersion is None else scenario.dispersion.distributions
    of_failures = ("failure_", "failed_", "sensor_failure_")
    drawn_quantities = [name for name in draws if name.startswith(of_failures)]
    failures = ", ".join(f"{one.of} {one.kind} at {one.at_s:g} s" for one in scenario.failure)
    how = f"; every case draws {', '.join(drawn_quantities)}" if drawn_quantities else ""
    if all(one.of_sensor for one in scenario.failure):
        return (f"Failures of sensors in flight ({failures}{how}) act in every case.",)
    return (
        f"Failures in flight ({failures}{how}) act in every case, and the law has no knowledge of "
        "them. The verdict and the laws are for the actuators that work at the start. To design "
        "for a known failure, give it as `failed`.",
    )


PERIOD = 0.1
"""Control period (s) of a law that has none by default."""

LARGEST_STEP, LARGEST_ANGLE = STEPS[0], 0.08
"""Up to which a period is made longer: parts of τ, and radians of the fastest motion.

So it is on the acceptance set at 1 N m, with 0.1 s. Gains of shorter periods are the same; longer
periods settle later.
"""

QUICKEST = 0.8
"""Largest natural frequency of a candidate, over 1/τ."""


def control_period(scenario: Scenario, law: Law, scale: Scale, orbital: Law | None = None) -> float:
    """Return the period (s) that the scenario gives; or the law's own, longer for slow bodies.

    Beside sensors it is not made longer, as they give their noise per sample. Where magnetorquers
    decide, it is that of the law `orbital`, which is made for them, or shorter, so that the
    quickest candidate turns by at most `LARGEST_ANGLE`.
    """
    usual, control, own_law = _usual(law), scenario.control, known_law(scenario.control.law)
    period = getattr(control, "period_s", None) or usual
    if own_law is None or period != _usual(own_law):
        return period
    if law.declaration.takes_orbits:
        return usual
    if "period_s" in control.model_fields_set:
        return period
    if orbital is not None:
        longest = min(_usual(orbital), LARGEST_ANGLE / QUICKEST * scale.time)
    elif has_sensors(scenario):
        return usual
    else:
        motion = fastest(scenario)
        by_motion = math.inf if motion is None else LARGEST_ANGLE / motion.rate
        longest = min(LARGEST_STEP * scale.time, by_motion)
    return float(f"{usual * max(1, math.floor(longest / usual)):.6g}")


def _usual(law: Law) -> float:
    """Return the default period (s) of a law."""
    defaults = [key.default for key in law.declaration.keys if key.name == "period_s"]
    return PERIOD if defaults in ([], [...]) else defaults[0]
