"""Fastest motion of a scenario, steps that resolve it, and refinement after a run with too large an
error."""

import math
from collections.abc import Callable, Iterator
from typing import NamedTuple, TypeVar, cast

import numpy as np

from jaxsat.core.declaration.actuators import PARTS
from jaxsat.core.declaration.quantities import DISPERSIBLE
from jaxsat.scenario.dispersion_tables import DistributionTable
from jaxsat.scenario.errors import Issue, Location
from jaxsat.scenario.flexibility import oscillations
from jaxsat.scenario.parts.torque_makers import wheel_axes
from jaxsat.scenario.parts.wheels import inertia_of
from jaxsat.scenario.schema import Scenario

ORDERS = {
    "euler": 1,
    "midpoint": 2,
    "heun": 2,
    "ralston": 2,
    "bosh3": 3,
    "tsit5": 5,
    "dopri5": 5,
    "dopri8": 8,
}
"""Orders of the solvers. `STUDIES` stands in for a solver that a scenario leaves open."""

STUDIES = "tsit5"
FINE, COARSE = 1e-7, 1e-2
"""Relative error per radian of the fastest motion: the target for default steps, and the threshold
of a caution."""

MOST_SUBSTEPS, MOST_STEPS = 1024, 2**24
"""Largest number of steps in a period and in a run, unless the scenario asks for more."""

FASTEST = 1e12
"""Largest rate of a motion, rad/s."""

SPREAD = 3.0
"""Standard deviations of a normal distribution that are treated as its range."""

REFINEMENTS = 4
"""Largest number of doublings of the substeps; each reduces the error by 2^p, order p."""

Errors = tuple[float | None, float | None]
"""Estimates of the rate error (rad/s) and of the attitude error (rad), None without an estimate."""

Flight = TypeVar("Flight")


class Fast(NamedTuple):
    """A motion, its angular frequency or inverse time constant (rad/s or 1/s), and its key."""

    what: str
    rate: float
    location: Location


def substeps_of(scenario: Scenario) -> int:
    """Steps in each period of a sampled law, or between two edges of pulses.

    Without `simulation.solver.substeps` a power of two that resolves the fastest motion, as far as
    the run has at most `MOST_STEPS`, and at least the number for slow motions.
    """
    count = scenario.simulation.solver.substeps
    if count is not None:
        return count
    usual, period = 1 if scenario.thruster else 4, _period(scenario)
    fast = fastest(scenario)
    if fast is None:
        return usual
    substeps = period * fast.rate / _resolved_angle(scenario, FINE)
    most = min(MOST_SUBSTEPS, MOST_STEPS * period / scenario.simulation.duration_s)
    if substeps <= usual or most <= usual:
        return usual
    return 2 ** min(math.ceil(math.log2(substeps)), math.floor(math.log2(most)))


def resolution_cautions(scenario: Scenario) -> Iterator[Issue]:
    """Yield a caution if equal steps do not resolve the fastest motion."""
    solver, fast = scenario.simulation.solver, fastest(scenario)
    if fast is None:
        return
    longest = _resolved_angle(scenario, COARSE) / fast.rate
    of = f"the {fast.what} of {fast.rate:.3g} rad/s ({'.'.join(map(str, fast.location))})"
    if not scenario.law.declaration.sampled:
        if solver.step_s is not None and solver.step_s > longest:
            message = f"should be at most {longest:.2g} s to resolve {of}, got {solver.step_s:g} s"
            yield Issue(("simulation", "solver", "step_s"), message, (fast.location,))
        return
    count, period = substeps_of(scenario), _period(scenario)
    if period / count > longest:
        message = (
            f"should be at least {math.ceil(period / longest)} to resolve {of}, got {count} steps "
            f"of {period / count:.3g} s"
        )
        yield Issue(("simulation", "solver", "substeps"), message, (fast.location,))


def fastest(scenario: Scenario) -> Fast | None:
    """Fastest motion that follows from the numbers of a scenario, None without any.

    Candidates are a periodic torque, the initial spin with its nutation, the spin-down of a rotor
    by viscous friction or a failure, and an oscillation of a passive part; dispersed quantities
    have their largest values.
    """
    with np.errstate(over="ignore", invalid="ignore"):
        motions = [*_periodic(scenario), *_spin(scenario), *_friction(scenario)]
        modes = oscillations(scenario)
        more = 1 + np.max(_dispersed_size(scenario, "mode_frequency", len(modes)), initial=0.0)
        motions += [Fast(one.of, more * one.frequency, one.location) for one in modes]
    fast = max((one for one in motions if one.rate > 0), key=lambda one: one.rate, default=None)
    return None if fast is None else fast._replace(rate=min(fast.rate, FASTEST))


def refined(
    scenario: Scenario,
    fly: Callable[[Scenario], Flight],
    errors: Callable[[Flight], Errors],
    tell: Callable[[str], None],
) -> tuple[Scenario, Flight]:
    """Return a scenario and its `fly` result with enough substeps that `errors` meet its limits.

    The scenario contains that number of substeps. Substeps that it gives stay. `tell` receives each
    change.
    """
    keeps_substeps, flight = scenario.simulation.solver.substeps is not None, fly(scenario)
    for _ in range(0 if keeps_substeps else REFINEMENTS):
        finer = with_finer_steps(scenario, errors(flight))
        if finer is None:
            break
        count = finer.simulation.solver.substeps
        tell(
            f"simulated with simulation.solver.substeps = {count}, because with fewer substeps the "
            "integration error is too large"
        )
        scenario, flight = finer, fly(finer)
    return scenario, flight


def with_finer_steps(scenario: Scenario, errors: Errors) -> Scenario | None:
    """Return the scenario with twice the substeps if its own leave too large an error.

    None if the error is small enough, the loop has no substeps, or the limits on steps forbid more.
    """
    is_sampled = scenario.law.declaration.sampled
    if not is_sampled or not excessive_error(errors, scenario):
        return None
    simulation, count = scenario.simulation, 2 * substeps_of(scenario)
    periods = simulation.duration_s / min(_period(scenario), simulation.duration_s)
    if count > MOST_SUBSTEPS or count * periods > MOST_STEPS:
        return None
    return scenario.with_keys("simulation.solver", substeps=count)


def excessive_error(errors: Errors, scenario: Scenario) -> str:
    """Message about estimates larger than the scenario allows; empty without any."""
    solver = scenario.simulation.solver
    limits = {
        "rate_error_rad_s": ("rate", errors[0], solver.rate_error_rad_s, "rad/s"),
        "attitude_error_rad": ("attitude", errors[1], solver.attitude_error_rad, "rad"),
    }
    parts = [
        f"{of} error about {value:.2g} {unit} (limit: simulation.solver.{key} = {most:g})"
        for key, (of, value, most, unit) in limits.items()
        if value is not None and value > most
    ]
    if not parts:
        return ""
    finer = "make simulation.solver.step_s smaller, or use adaptive steps"
    if scenario.law.declaration.sampled:
        finer = (
            f"raise simulation.solver.substeps, now {substeps_of(scenario)}, or name a solver of "
            "higher order"
        )
    excesses = " and ".join(parts)
    return f"the steps are too long: {excesses}, compared with steps of half the length; {finer}"


def _period(scenario: Scenario) -> float:
    return cast(float, getattr(scenario.control, "period_s", math.inf))


def _resolved_angle(scenario: Scenario, error: float) -> float:
    """Angle (rad) per step at which a solver of order p has this error, by its (p + 1)! term."""
    order = ORDERS[scenario.simulation.solver.name or STUDIES]
    return (error * math.factorial(order + 1)) ** (1 / order)


def _periodic(scenario: Scenario) -> Iterator[Fast]:
    table = scenario.disturbance
    amplitudes, rates = np.abs(table.amplitude_N_m), np.abs(table.frequency_rad_s)
    more = 1 + _dispersed_size(scenario, "disturbance_frequency", 3)
    yield Fast(
        "periodic torque",
        float(np.max(rates * more * (amplitudes > 0))),
        ("disturbance", "frequency_rad_s"),
    )


def _spin(scenario: Scenario) -> Iterator[Fast]:
    """The initial rate, and the momentum of body and rotors over the least mean moment."""
    omega = np.linalg.norm(scenario.initial.omega_rad_s)
    omega = max(omega, np.linalg.norm(_dispersed_size(scenario, "omega", 3)))
    omega += np.linalg.norm(_dispersed_size(scenario, "rate_error", 2))
    moments = np.linalg.eigvalsh(inertia_of(scenario))
    momentum = moments[2] * omega + _stored_momentum(scenario)
    location = ("initial", "omega_rad_s")
    yield Fast("spin", float(omega), location)
    yield Fast("nutation", float(momentum / np.sqrt(moments[0] * moments[1])), location)


def _stored_momentum(scenario: Scenario) -> float:
    """Sum of all momenta that devices may store at the start, N m s."""
    total = 0.0
    for part in PARTS:
        if part.momentum is not None:
            key, name = part.momentum
            sizes = np.abs([getattr(one, key) for one in getattr(scenario, part.name)])
            dispersion = _dispersed_size(scenario, name, sizes.size)
            relative = DISPERSIBLE[name].unit == "1"
            sizes = sizes * (1 + dispersion) if relative else np.maximum(sizes, dispersion)
            total += float(sizes.sum())
    return total


def _friction(scenario: Scenario) -> Iterator[Fast]:
    inertia = inertia_of(scenario)
    more = max([1.0, *(one.factor or 1.0 for one in scenario.failure)])
    for number, one in enumerate(scenario.wheel):
        axis, rotor = wheel_axes((one,))[:, 0], one.rotor_inertia_kg_m2
        if rotor is not None and one.viscous_friction_N_m_s > 0:
            free = 1 + rotor * axis @ np.linalg.solve(inertia, axis)
            rate = float(more * one.viscous_friction_N_m_s / rotor * free)
            yield Fast("viscous friction", rate, ("wheel", number, "viscous_friction_N_m_s"))
    for number, one in enumerate(scenario.failure):
        if one.time_constant_s is not None:
            rate = 1 / one.time_constant_s
            yield Fast("run-down of a rotor", rate, ("failure", number, "time_constant_s"))


def _dispersed_size(scenario: Scenario, name: str, size: int) -> np.ndarray:
    """Largest magnitude of a component of a dispersed quantity, `size` times; zeros without one."""
    table = None
    if scenario.dispersion is not None:
        table = scenario.dispersion.distributions.get(name)
    return np.full(size, 0.0 if table is None else _largest(table))


def _largest(table: DistributionTable) -> float:
    """Largest magnitude that a distribution gives."""
    sizes = [np.zeros(1)]
    if table.values is not None:
        sizes.append(np.abs(np.ravel(table.values)))
    elif table.low is not None and table.high is not None:
        sizes += [np.abs(np.atleast_1d(table.low)), np.abs(np.atleast_1d(table.high))]
    elif table.mean is not None and table.sigma is not None:
        sizes.append(np.abs(np.atleast_1d(table.mean)) + SPREAD * np.max(table.sigma))
    return float(np.concatenate(sizes).max())
