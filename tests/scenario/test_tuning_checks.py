"""Checks of the tuning table."""

import pytest

from jaxsat.scenario.tuning_checks import USUAL_OPTIMISERS
from jaxsat.tuning.optimisers import OptimiserSettings


@pytest.mark.parametrize("name", USUAL_OPTIMISERS)
def test_optimisers_that_are_not_tried_will_do(name):
    OptimiserSettings(name)
