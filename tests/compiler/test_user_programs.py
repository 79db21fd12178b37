"""What people write for one trajectory: machine code and interpreter against XLA, or refused."""

import jax
import numpy as np
import pytest

from compiler.user_programs import IMPOSSIBLE, SUBJECTS, arguments
from jaxsat.compiler import CannotLower, Mapped

CASES = 16
QUICK = ("networks",)


def _close(found, expected, name: str) -> None:
    for x, y in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        assert x.dtype == y.dtype, name
        floating = x.dtype.kind == "f"
        np.testing.assert_allclose(
            x, y, rtol=1e-11 if floating else 0, atol=1e-13 if floating else 0, err_msg=name
        )


@pytest.mark.parametrize(
    "subject", [pytest.param(s, marks=() if s in QUICK else pytest.mark.slow) for s in SUBJECTS]
)
def test_what_people_write_gives_the_same_numbers_as_xla(subject):
    """All programs of a subject as one."""
    programs = SUBJECTS[subject]
    cases = {name: arguments(letters, CASES) for name, (letters, _) in programs.items()}

    def all_of_them(case, shared):
        return {name: function(*case[name]) for name, (_, function) in programs.items()}

    expected = jax.jit(jax.vmap(lambda case: all_of_them(case, None)))(cases)
    mapped = Mapped(all_of_them, jax.tree.map(lambda x: x[0], cases))
    found, interpreted = mapped(cases), mapped.interpreted(cases)
    for name in programs:
        _close(found[name], expected[name], name)
        _close(interpreted[name], expected[name], name)


@pytest.mark.parametrize("name", IMPOSSIBLE)
def test_what_cannot_be_done_is_named_with_its_place(name):
    letters, function = IMPOSSIBLE[name]
    case = [x[0] for x in arguments(letters, 1)]
    with pytest.raises(CannotLower, match=rf"{name}.*user_programs\.py"):
        Mapped(lambda case, _: function(*case), case)


def test_typed_keys_are_taken_as_cases():
    keys = jax.random.split(jax.random.key(3), 5)
    mapped = Mapped(lambda key, _: jax.random.uniform(key), keys[0])
    np.testing.assert_array_equal(mapped(keys), jax.vmap(jax.random.uniform)(keys))
