"""Points in the search space of a plan, and plans with other settings."""

import dataclasses

import jax
import numpy as np


def points(plan):
    return plan.space.to_search(np.array([[0.5, 0.3], [1.2, 0.1], [0.2, 1.0]]))


def with_settings(plan, **changes):
    return dataclasses.replace(plan, settings=dataclasses.replace(plan.settings, **changes))


def same_bits(one, other):
    jax.tree.map(np.testing.assert_array_equal, one, other)
