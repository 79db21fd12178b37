"""The history of a run as a dataset."""

import numpy as np

from jaxsat.scenario import dump
from jaxsat.synthesis.tuning.checkpoint import history_dataset


def test_the_history_has_gains_and_losses(scenario, plan, final):
    dataset = history_dataset(plan, final, scenario.title, dump(scenario))
    assert dataset["gain"].dims == ("step", "start", "parameter")
    assert dataset.sizes["step"] == 4
    np.testing.assert_allclose(dataset["gain"][0, 0], [0.5, 0.3])
    best = dataset["best_gain"][-1].values
    np.testing.assert_allclose(best, plan.space.to_values(final.best_point))
    assert dataset["loss"].attrs["units"] == "1"
