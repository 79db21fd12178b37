"""Calls of jaxsat in tests are checked against annotations, with shapes and without."""

import jax.numpy as jnp
import pytest

from jaxsat.core.attitude import skew
from jaxsat.core.text import clean


def test_shapes_are_checked():
    with pytest.raises(TypeError, match="skew"):
        skew(jnp.ones(4))


def test_types_are_checked():
    with pytest.raises(TypeError, match="clean"):
        clean(3)
