"""From the requirements of a scenario to what judges every case of a study."""

import jax

from jaxsat.core.declaration.requirements import comparisons
from jaxsat.scenario.build.plant import sunlight_of
from jaxsat.scenario.build.run import Run
from jaxsat.scenario.schema import Scenario
from jaxsat.simulation.engine.monitors import state_signals
from jaxsat.simulation.requirements import Requirements, raw_signals


def build_requirements(scenario: Scenario, run: Run) -> Requirements | None:
    """The requirements that can be judged by the state of the loop alone; None without any."""
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
