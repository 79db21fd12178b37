"""Checks of the tuning table."""

import pytest

from jaxsat.scenario.optimisers import OptimiserSettings
from jaxsat.scenario.tuning import USUAL_OPTIMISERS


@pytest.mark.parametrize("name", USUAL_OPTIMISERS)
def test_optimisers_that_are_not_tried_will_do(name):
    OptimiserSettings(name)
