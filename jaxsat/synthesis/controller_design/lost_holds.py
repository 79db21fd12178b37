"""Cautions of a design before any flight, such as drift that laws for two torques do not balance.

The drift is that of the bodies of a study at rest in orbit.
"""

import math
from typing import NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from jaxsat.compiler.llvm.mapped import compiled_over_cases
from jaxsat.core.allocation import torque_directions
from jaxsat.core.ranges import SETTLED_W
from jaxsat.scenario import Scenario
from jaxsat.scenario.build.study import build_study
from jaxsat.scenario.derived import believed_axes
from jaxsat.scenario.domain import dimensionless_numbers, domain_cautions
from jaxsat.scenario.flexibility import flexibility_cautions
from jaxsat.scenario.holding import RestDrift, rest_drift
from jaxsat.simulation.loops import AbstractLoop
from jaxsat.studies.ensemble import Study
from jaxsat.studies.torques_left import reach_at_rest
from jaxsat.synthesis.controller_design.candidates import Candidate
from jaxsat.synthesis.controller_design.vehicle import VehicleVerdict, coupling

BODIES = 1000
"""Number of bodies drawn."""

LEAST_COUPLING = 0.02
"""Coupling c below which the duration of a case is not made longer."""

FEW = 0.01
"""Fraction of the bodies that may drift beyond a balance without a word."""

IN_PLANE = 1e-6
"""Sine of the angle to the plane of the torques below which a thruster is in it."""


class DrawnBody(NamedTuple):
    """Inertia (kg m²) of one case, and two orthonormal directions of its torques."""

    inertia: Float[np.ndarray, "3 3"]
    directions: Float[np.ndarray, "3 2"]


def lost_holds(scenario: Scenario, bodies: list[DrawnBody]) -> str | None:
    """Return sentences if over 1 % of the drawn bodies drift beyond balance, else None."""
    if scenario.orbit.rate() == 0:
        return None
    drifts = drawn_drifts(scenario, bodies)
    count = sum(abs(one.drift) > one.balanced for one in drifts)
    if count <= FEW * len(drifts):
        return None
    hopeless = sum(abs(one.drift) > one.most_balanced for one in drifts)
    c = dimensionless_numbers(scenario)["coupling"]
    return (
        f"In orbit with c = {c:.2g}, {count} of {len(drifts)} bodies drawn from [dispersion] drift "
        "at rest about the unactuated axis by more than attitudes within the tolerances and "
        f"oscillations of the tolerated rate balance, {hopeless} of them by more than any periodic "
        "rates balance. No law of jaxsat holds such a body for ever: a hold ends after some time "
        "and begins again, so fewer than 99 % of the cases may settle, however long the run. A "
        "better known inertia helps."
    )


def small_couplings(scenario: Scenario, bodies: list[DrawnBody]) -> str | None:
    """Return sentences if over 1 % of the drawn bodies have a small c, else None."""
    count = sum(coupling(*body) < LEAST_COUPLING for body in bodies)
    if count <= FEW * len(bodies):
        return None
    c = dimensionless_numbers(scenario)["coupling"]
    return (
        f"With c = {c:.2g}, {count} of {len(bodies)} bodies drawn from [dispersion] have c below "
        f"{LEAST_COUPLING}. Two rates hardly turn the third axis of such a body, so some of these "
        "cases settle late or not at all. A better known inertia helps."
    )


def holds_last(scenario: Scenario) -> bool:
    """Whether oscillations of the tolerated rate alone balance the drift of 99 % of `BODIES` drawn
    bodies, so that no balancing attitude is needed."""
    if scenario.orbit.rate() == 0:
        return True
    drifts = drawn_drifts(scenario, first_bodies(scenario))
    return sum(abs(one.drift) > one.oscillation for one in drifts) <= FEW * len(drifts)


def drawn_drifts(scenario: Scenario, bodies: list[DrawnBody]) -> list[RestDrift]:
    """Return the drift of each body in the orbit of a scenario, with its tolerances."""
    settled = scenario.settled
    tilt = 2 * math.atan(SETTLED_W) if settled.tilt_rad is None else settled.tilt_rad
    tolerances = (tilt, settled.turn_rad, settled.rate_rad_s)
    rate, gradient = scenario.orbit.rate(), scenario.disturbance.gravity_gradient
    return [rest_drift(*body, rate, gradient, tolerances) for body in bodies]


def first_bodies(scenario: Scenario) -> list[DrawnBody]:
    """Return the first `BODIES` bodies of the study of a scenario."""
    study = build_study(scenario, BODIES, engine="diffrax")
    return drawn_bodies(study, torque_directions(believed_axes(scenario)))


def drawn_bodies(study: Study, directions: Float[np.ndarray, "3 2"]) -> list[DrawnBody]:
    """Return the bodies of all cases of a study, none of which is flown.

    The nominal torques are about two orthonormal `directions`. The plane of a body's torques is the
    nearest, by least squares, to its thrusters that push in the nominal plane.
    """
    copies = study.case_factory

    def body(case, _):
        loop = copies(case).loop
        return loop.plant.spacecraft.inertia, _torques(loop), _torques(copies.loop)

    cases = study.cases(np.arange(study.count))
    first = jax.tree.map(lambda x: x[0], cases)
    inertia, torques, believed = map(np.asarray, compiled_over_cases(body, first)(cases))
    normal = np.cross(directions[:, 0], directions[:, 1])
    columns = believed[0] / np.linalg.norm(believed[0], axis=0)
    unit = torques / np.linalg.norm(torques, axis=1, keepdims=True)
    along, _, _ = np.linalg.svd(unit[:, :, np.abs(normal @ columns) < IN_PLANE])
    return [DrawnBody(*one) for one in zip(inertia, along[:, :, :2], strict=True)]


def _torques(loop: AbstractLoop) -> Float[Array, "3 m"]:
    """Return a column for each thruster."""
    columns = [
        reach_at_rest(
            one, jnp.zeros(0 if one.failures is None else one.failures.count, bool)
        ).columns
        for one in loop.plant.effectors
        if one.storage() is None and one.dipoles() is None
    ]
    return jnp.concatenate(columns, axis=1)


def design_cautions(
    vehicle: Scenario, verdict: VehicleVerdict, candidates: tuple[Candidate, ...]
) -> tuple[str, ...]:
    """Return sentences on bodies that no law holds or hardly turns, on numbers of the vehicle
    outside the verified domain, and on flexible parts that laws may excite."""
    told = ()
    if verdict.judgement.laws == "two torques" and not vehicle.wheel and candidates:
        scenario = candidates[0].scenario
        if scenario.dispersion is not None:
            bodies = first_bodies(scenario)
            told = (lost_holds(scenario, bodies), small_couplings(scenario, bodies))
    beyond = (
        f"{'.'.join(map(str, issue.location))} {issue.message}"
        for one in candidates
        for issue in (*domain_cautions(one.scenario), *flexibility_cautions(one.scenario))
    )
    return (*filter(None, told), *beyond)
