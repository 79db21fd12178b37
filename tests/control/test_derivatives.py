"""Every law with every default: what JAX makes of its derivatives, by gains and by the state.

At a start, at the target and half a turn from it, with and without rates. The laws are those that
a scenario can name, so that a new one is among them; `helpers.every_law` has its required keys.
"""

import equinox as eqx
import jax
import jax.numpy as jnp
import numpy as np
import pytest

from helpers.derivatives import Derivatives
from helpers.every_law import PLACES, PLANNED, UPSIDE_DOWN, scenario_of
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.attitude import Quaternion
from jaxsat.core.declaration.laws import LAWS
from jaxsat.scenario.build.run import build_loop
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.studies.changes import controller_of
from jaxsat.studies.dispersions import number_at

SAMPLES = 12
"""Of a sampled law, so that its estimators have had an interval."""

START_RATE = np.array([0.02, -0.03, 0.04])
START_DRIFT = np.array([1, -2, 1.5, 0.1, -0.2, 0.3]) * 1e-3
"""rad/s, and rad and rad/s a sample."""


class Commands:
    """What a law commands, by the logarithms of its gains, and changes of attitude and rate."""

    def __init__(self, law, **changes):
        self.loop = build_loop(scenario_of(law, **changes))
        self.law = controller_of(self.loop)
        places = LAWS[law].declaration.tunable.items()
        self.gains = [(key, place, number_at(self.law, place)) for key, place in places]
        self.gains = [(key, place, value) for key, place, value in self.gains if np.all(value > 0)]
        self.tuned = [key for key, _, value in self.gains for _ in range(value.size)]
        self.names = [*self.tuned, *"φθψ", "ω1", "ω2", "ω3"]

    def __call__(self, x, quaternion, omega, drift):
        """All of several samples, told of a state that drifts; of a continuous law also the rates
        of its memory."""
        law, first = self.law, 0
        for _, place, value in self.gains:
            scaled = value * jnp.exp(x[first : first + value.size].reshape(value.shape))
            law = eqx.tree_at(lambda law, at=place: number_at(law, at), law, scaled)
            first += value.size

        def seen(number):
            turn = x[first : first + 3] + number * drift[:3]
            turned = quaternion + Quaternion(quaternion).rate(turn).q
            rate = omega + x[first + 3 :] + number * drift[3:]
            return self.loop.plant.complete(PlantState(Quaternion(turned).normalised(), rate))

        if not isinstance(law, AbstractSampledController):
            state = seen(0.0)
            command, rates = law(jnp.array(1.3), state, law.init(state))
            return jnp.concatenate([command, *map(jnp.ravel, jax.tree.leaves(rates))])

        def sample(memory, number):
            command, memory = law.step(number * law.period, seen(number), memory)
            return memory, command

        return jax.lax.scan(sample, law.init(seen(0.0)), jnp.arange(float(SAMPLES)))[1].ravel()


LONG = ("oscillatory", "three-slew")
"""Laws beside those that command actuators whose derivatives take more than five seconds."""


def _all_laws():
    """Those that no gradient is taken of take longest.

    Gravity gradient gives the laws for any plane more to estimate: the drift that is left.
    """
    gradient = {"disturbance": {"gravity_gradient": True}}
    for name, law in LAWS.items():
        if name != PLANNED:
            long = law.declaration.commands_actuators or name in LONG
            slow = [pytest.mark.slow] if long else []
            yield pytest.param((name, {}), marks=slow, id=name)
            if law.declaration.any_plane:
                yield pytest.param(
                    (name, gradient), marks=pytest.mark.slow, id=f"{name}, gravity gradient"
                )


@pytest.fixture(scope="module", params=_all_laws())
def law(request):
    name, changes = request.param
    commands = Commands(name, **changes)
    return name, commands, Derivatives(commands, commands.names)


@pytest.mark.parametrize("place", PLACES)
def test_derivatives_are_finite_and_equal_to_differences(law, place):
    name, commands, derivatives = law
    quaternion = np.array(PLACES[place]) / np.linalg.norm(PLACES[place])
    if LAWS[name].declaration.works_in_wz and place in UPSIDE_DOWN:
        initial = {"quaternion": PLACES[place], "omega_rad_s": [0, 0, 0]}
        with pytest.raises(ValueError, match="must not be upside down"):
            scenario_of(name, initial=initial)
        return
    frame = np.asarray(commands.loop.plant.orbit.frame_rate(Quaternion(quaternion)))
    omega, drift = frame, np.zeros(6)
    if place == "a start":
        omega, drift = frame + START_RATE, START_DRIFT
    found = derivatives.at(np.zeros(len(commands.names)), quaternion, omega, drift)
    assert found.wrong == []
    assert found.compared >= set(commands.tuned)
    if place == "a start":
        assert found.compared == set(commands.names)


def test_laws_without_derivatives_are_refused_with_the_reason():
    assert LAWS[PLANNED].declaration.searched
    refused = [law.name for law in LAWS.values() if law.declaration.searched]
    refused += [law.name for law in LAWS.values() if law.declaration.commands_actuators]
    for name in refused:
        gain = next(iter(LAWS[name].declaration.tunable))
        tuning = {"parameters": {gain: {"low": 0.01, "high": 0.2}}}
        dispersed = {"omega_rad_s": {"distribution": "uniform", "low": -0.01, "high": 0.01}}
        with pytest.raises(ValueError, match=r'must be "cma-es" under the law .*, (which|whose) '):
            scenario_of(name, tuning=tuning, dispersion=dispersed)
