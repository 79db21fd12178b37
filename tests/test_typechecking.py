"""Calls of jaxsat in tests are checked against annotations, with shapes and without."""

from typing import Any

import equinox as eqx
import jax.numpy as jnp
import pytest
from jaxtyping import Array, Float

from helpers.typechecking import CALLS, begin_test, checked
from jaxsat.core.attitude import skew
from jaxsat.core.text import clean


def test_shapes_are_checked():
    with pytest.raises(TypeError, match="skew"):
        skew(jnp.ones(4))


def test_types_are_checked():
    with pytest.raises(TypeError, match="clean"):
        clean(3)


@checked
def product(matrix: Float[Array, "rows columns"], vector: Float[Array, " columns"]):
    return matrix @ vector


@checked
def doubled(vector: Float[Array, " rows"], copies: int) -> Float[Array, " rows"]:
    return jnp.tile(vector, copies)


def test_an_axis_has_one_length_in_a_call():
    assert product(jnp.ones((2, 3)), jnp.ones(3)).shape == (2,)
    with pytest.raises(TypeError, match="vector"):
        product(jnp.ones((2, 3)), jnp.ones(2))
    begin_test()
    assert product(jnp.ones((3, 2)), jnp.ones(2)).shape == (3,)  # and another in the next


def test_what_is_returned_is_checked():
    assert doubled(jnp.ones(2), 1).shape == (2,)
    with pytest.raises(TypeError, match="return"):
        doubled(jnp.ones(2), 2)


def test_the_first_calls_of_each_test_are_checked():
    for _ in range(CALLS):
        doubled(jnp.ones(2), 1)
    assert doubled(jnp.ones(2), 2).shape == (4,)
    begin_test()
    with pytest.raises(TypeError, match="return"):
        doubled(jnp.ones(2), 2)


def test_so_are_the_first_closures_of_a_function_within_another():
    def closure() -> Any:
        def copies(count: int) -> int:
            return count

        return checked(copies)

    made = [closure() for _ in range(CALLS + 1)]
    assert made.pop()("two") == "two"
    for one in made:
        with pytest.raises(TypeError, match="count"):
            one("two")


@checked
class Wheel(eqx.Module):
    axis: Float[Array, "3"]
    inertia: float


class WheelWithFriction(Wheel):
    friction: float


@pytest.mark.parametrize("fields", [(jnp.ones(2), 1.0), (jnp.ones(3), "heavy")])
def test_fields_are_checked(fields):
    with pytest.raises(TypeError, match=r"axis|inertia"):
        Wheel(*fields)
    with pytest.raises(TypeError, match=r"axis|inertia"):
        checked(WheelWithFriction)(*fields, 0.1)
