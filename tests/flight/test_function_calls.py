"""Calls of the elementary functions of an export with arguments that no law has."""

import re

import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.flight.calls import SIZES, function_calls
from jaxsat.flight.program import flight_program
from jaxsat.flight.source import source
from tests.flight.laws import loop_of, start
from tests.flight.test_conditions import _Law


@pytest.fixture(scope="module", params=[False, True], ids=["double", "single"])
def printed(request):
    """The type of numbers, and the text."""
    law = _Law(
        function=lambda omega: jnp.stack([jnp.arctan2(omega[0], omega[1]), jnp.cbrt(omega[2])])
    )
    program = flight_program(loop_of(law), start(), single=request.param)
    source(program, [], libm=False)
    return np.float32 if request.param else np.float64, function_calls(program, [])


def _rows(text, name, kind):
    table = re.search(rf"of_{name}\[\d+\]\[\d\] = {{\n(.*?)\n}};", text, re.DOTALL)
    assert table is not None
    plain = re.sub(r"\((double|float)\)|(?<=\d)F", "", table.group(1))
    plain = plain.replace("INFINITY", "inf").replace("NAN", "nan")
    rows = re.findall(r"{(.*?)}", plain, re.DOTALL)
    return np.array([[kind(x) for x in row.split(",")] for row in rows]).T


def test_results_are_those_of_numpy_at_every_end_of_the_domain(printed):
    kind, text = printed
    with np.errstate(all="ignore"):
        y, x, angle = _rows(text, "atan2_of", kind)
        assert len(y) == (2 * len(SIZES) + 1) ** 2
        _assert_near(angle, np.arctan2(y, x))
        number, root = _rows(text, "cbrt_of", kind)
        assert np.isnan(number).sum() == 1
        assert np.isinf(number).sum() >= 2
        _assert_near(root, np.cbrt(number))


def _assert_near(found, expected):
    """Within three units of the last place."""
    np.testing.assert_array_equal(np.isnan(found), np.isnan(expected))
    numbers = ~np.isnan(expected)
    np.testing.assert_array_equal(np.signbit(found)[numbers], np.signbit(expected)[numbers])
    normal = np.abs(expected) > np.finfo(found.dtype).tiny
    normal &= np.isfinite(expected)
    np.testing.assert_allclose(found[normal], expected[normal], rtol=3 * np.finfo(found.dtype).eps)
    np.testing.assert_array_equal(found[np.isinf(expected)], expected[np.isinf(expected)])
