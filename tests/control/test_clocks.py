"""Laws that settle count time from their own first sample, whenever that is."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from control.cases import ORBIT_RATE, body
from helpers.compiling import by_machine_code, interpreted
from jaxsat.control.presets import oscillatory_settling, three_slew_settling
from jaxsat.control.supervisor import Phase
from jaxsat.core.attitude import WZ
from jaxsat.spacecraft.dynamics import PlantState

SPINNING = PlantState(WZ([-1.0, 1.0], 1.27).as_quaternion(), [0.1, -0.11, 0.05])
TURNED = PlantState(WZ([0.1, 0.0], 0.2).as_quaternion(), [0.0, -ORBIT_RATE, 0.0])
PERIOD = 0.125


@pytest.mark.parametrize(
    "make", [oscillatory_settling, pytest.param(three_slew_settling, marks=pytest.mark.slow)]
)
def test_commands_are_the_same_from_any_begin(make):
    """To the bit, through the phases: nothing of the law depends on the clock of the run."""
    law = make(body(), 5.0, period=PERIOD)
    step = by_machine_code(law.step)
    found = []
    for begin in (0.0, 1e4, 8e8):
        memory, commands = law.init(SPINNING), []
        for number in range(24):
            state = SPINNING if number < 12 else TURNED
            command, memory = step(jnp.asarray(begin + number * PERIOD), state, memory)
            commands.append(np.asarray(command))
        assert max(float(jnp.max(jnp.abs(x))) for x in jax.tree.leaves(memory)) < 1e6
        found.append(np.stack(commands))
    assert np.abs(found[0]).max() > 0.1
    np.testing.assert_array_equal(found[1], found[0])
    np.testing.assert_array_equal(found[2], found[0])


@pytest.mark.slow
def test_patience_begins_with_the_law():
    """A law that begins late still stops the body first; at t = 1e4 s patience was over at once."""
    law = three_slew_settling(body(), 5.0, period=PERIOD)
    assert 0 < law.patience < 1e4
    slow = PlantState(SPINNING.attitude, [0.0, -0.01, float(law.slow_rate) / 2])
    _, memory = interpreted(law.step, jnp.asarray(1e4), slow, law.init(slow))
    assert memory.phase == Phase.STOPPING
