"""One tuning run for all tests, from a scenario to its receipt."""

import pytest

# jaxsat is imported in fixtures: pytest reads this file before types are checked.


@pytest.fixture(scope="session")
def scenario(tmp_path_factory):
    from jaxsat.scenario.build.load import load
    from synthesis.tuning.scenarios import RATE

    file = tmp_path_factory.mktemp("scenario") / "rate.toml"
    file.write_text(RATE, encoding="utf-8")
    return load(file)


@pytest.fixture(scope="session")
def plan(scenario):
    from jaxsat.synthesis.tuning.build import build_plan

    return build_plan(scenario, batch_size=4)


@pytest.fixture(scope="session")
def final(plan):
    from jaxsat.synthesis.tuning.descent import descend, initial_state

    return descend(plan, initial_state(plan))


@pytest.fixture(scope="session")
def receipt(plan, final):
    from jaxsat.synthesis.tuning.receipt import make_receipt

    return make_receipt(plan, final)
