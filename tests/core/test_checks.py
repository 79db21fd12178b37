"""Converters that check the fields of modules."""

import ast
from pathlib import Path

import jax
import jax.numpy as jnp
import numpy as np
import pytest

import jaxsat
from jaxsat import ArgumentError
from jaxsat.core.checks import finite, not_negative, positive

CONVERTERS = ("finite", "positive", "not_negative")


@pytest.mark.parametrize(
    ("converter", "good", "bad", "rule"),
    [
        (positive("gain"), [1, 2.5], [1.0, 0.0], "must be positive"),
        (positive("gain"), 3, np.nan, "must be positive"),
        (not_negative("gain"), 0, -1e-9, "must be zero or positive"),
        (finite("gain"), [-1.0, 0.0], [1.0, np.inf], "must be finite"),
    ],
)
def test_a_converter_checks_numbers_and_makes_them_floats(converter, good, bad, rule):
    array = converter(good)
    assert jnp.issubdtype(array.dtype, jnp.floating)
    assert array.tolist() == np.asarray(good, float).tolist()
    with pytest.raises(ArgumentError, match=f"Argument `gain` {rule}, but got"):
        converter(bad)
    assert jax.jit(converter)(bad).shape == np.shape(bad)  # what is traced is not known


def test_converters_name_their_own_fields():
    named = 0
    for path in sorted(Path(jaxsat.__file__).parent.rglob("*.py")):
        text = path.read_text()
        if not any(f'{name}("' in text for name in CONVERTERS):
            continue
        for node in ast.walk(ast.parse(text)):
            if isinstance(node, ast.AnnAssign) and isinstance(node.value, ast.Call):
                for one in ast.walk(node.value):
                    if isinstance(one, ast.Call) and getattr(one.func, "id", "") in CONVERTERS:
                        assert one.args[0].value == node.target.id, f"{path}:{node.lineno}"
                        named += 1
    assert named > 50
