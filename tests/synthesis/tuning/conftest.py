"""One tuning run for all tests, from a scenario to its receipt."""

import pytest

from jaxsat.scenario.build.load import load
from jaxsat.synthesis.tuning.build import build_plan
from jaxsat.synthesis.tuning.descent import descend, initial_state
from jaxsat.synthesis.tuning.receipt import make_receipt
from synthesis.tuning.scenarios import RATE


@pytest.fixture(scope="session")
def scenario(tmp_path_factory):
    file = tmp_path_factory.mktemp("scenario") / "rate.toml"
    file.write_text(RATE, encoding="utf-8")
    return load(file)


@pytest.fixture(scope="session")
def plan(scenario):
    return build_plan(scenario, batch_size=4)


@pytest.fixture(scope="session")
def final(plan):
    return descend(plan, initial_state(plan))


@pytest.fixture(scope="session")
def receipt(plan, final):
    return make_receipt(plan, final)
