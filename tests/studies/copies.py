"""Dispersed copies of loops."""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np

from helpers.paper import (
    PAPER_THREE_AXIS,
    bodies,
    three_axis_law,
)
from helpers.switching import CASE, start, switching_loop
from jaxsat.control.three_axis import InternalModel
from jaxsat.simulation.loops import ContinuousLoop
from jaxsat.simulation.sampled_loop import SampledLoop
from jaxsat.spacecraft.sensors import Sensors
from jaxsat.studies.designs import Independent
from jaxsat.studies.dispersions import Dispersed, Dispersions, StudyCase


def sampled():
    plain = switching_loop(CASE, internal=InternalModel([0.7, 0.8]))
    return SampledLoop(
        plain.plant,
        plain.controller,
        sensors=Sensors(),
        delay=0.0,
    )


def backstepping():
    plain = switching_loop(CASE)
    return ContinuousLoop(
        bodies(PAPER_THREE_AXIS)[0].with_effectors((plain.plant.effectors[0],)),
        three_axis_law(PAPER_THREE_AXIS),
    )


def copies_of(loop, count, seed=3, begin=None, known=False, **distributions):
    dispersions = Dispersions(distributions, known)
    study = Dispersed(loop, begin or start(), dispersions, seed)
    numbers = np.arange(count)
    points = Independent(seed).points(numbers, study.dimensions())
    cases = StudyCase(jnp.array(numbers, jnp.uint32), jnp.array(points))
    return eqx.filter_jit(lambda study, cases: jax.vmap(study)(cases))(study, cases)
