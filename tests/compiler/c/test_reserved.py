"""Names of Python that mean something in C become other names there."""

import importlib.util
import shutil
import subprocess

import pytest

from jaxsat.compiler.c.naming import is_reserved
from jaxsat.flight.program import flight_program
from jaxsat.flight.source import header, source
from tests.flight.laws import loop_of, start

NAMES = (
    "conj", "llround", "malloc", "int32_t", "j0", "y1", "index", "controller_step", "auto",
    "double", "this", "template", "xor", "isnan", "fabsf", "sub_i32", "maximum_f64", "errno", "now",
    "atomic_load", "main", "memcpy", "controller_state", "sinf", "control", "begin_law", "next",
    "i", "k",
)  # fmt: skip

LAW = """
from typing import NamedTuple
import equinox as eqx
import jax
import jax.numpy as jnp
from jaxsat.core.checks import as_float
from jaxsat.control import AbstractSampledController


class Memory(NamedTuple):
    {fields}


class Law(AbstractSampledController):
    {gains}
    period: jax.Array = eqx.field(converter=as_float, default=0.5)

    def init(self, state):
        return Memory(*[jnp.zeros(()) for _ in Memory._fields])

    def step(self, t, state, memory):
        x = state.omega[:2]
        whole = jnp.array(3, jnp.int32) - x.astype(jnp.int32)[0]
        total = x + jnp.maximum(jnp.sum(x), 0.5) + whole
        {calls}
        return total, memory


{functions}
"""

FUNCTION = """
def {name}(x):
    {name} = x / jnp.sqrt(1.0 + x[0] * x[0] + x[1] * x[1])
    return jnp.stack([{name}[0] * {name}[1] + {k}, {name}[1] - x[0] * {k}])
"""


@pytest.fixture(scope="module")
def law(tmp_path_factory):
    """Its functions, variables, gains and fields of memory have such names."""
    call = "total = total + {0}(x) + {0}(2 * x) * self.{0} + memory.{0}"
    gain = "{}: jax.Array = eqx.field(converter=as_float, default=0.25)"
    text = LAW.format(
        fields="\n    ".join(f"{name}: jax.Array" for name in NAMES),
        gains="\n    ".join(gain.format(name) for name in NAMES),
        calls="\n        ".join(call.format(name) for name in NAMES),
        functions="".join(FUNCTION.format(name=name, k=k) for k, name in enumerate(NAMES, 1)),
    )
    file = tmp_path_factory.mktemp("names") / "names_law.py"
    file.write_text(text)
    spec = importlib.util.spec_from_file_location("names_law", file)
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module.Law()


@pytest.mark.skipif(shutil.which("gcc") is None, reason="gcc is not installed")
def test_no_name_of_c_is_taken(tmp_path, law):
    """As strict C99 and in a compiler's own dialect; the header as C++ too."""
    program = flight_program(loop_of(law), start())
    (tmp_path / "controller.h").write_text(header(program, []))
    text = source(program, [], libm=False)
    (tmp_path / "controller.c").write_text(text)
    assert "static void conj_2(" in text  # the names were there to be changed
    assert "sub_i32(" in text
    strict = ["-Wall", "-Wextra", "-Werror", "-fsyntax-only", "controller.c"]
    ways = [["gcc", "-std=c99", "-pedantic", *strict], ["gcc", "-std=gnu17", *strict]]
    ways.append(["g++", "-std=c++17", "-fsyntax-only", "-x", "c++", "controller.h"])
    for way in ways:
        if shutil.which(way[0]):
            done = subprocess.run(way, cwd=tmp_path, capture_output=True, text=True, check=False)
            assert done.returncode == 0, done.stderr[:3000]


@pytest.mark.parametrize(
    "name",
    ["lgammaf_r", "sincosf", "uint_fast8_t", "atomic_load", "strlen", "read_controller_x", "i"],
)
def test_whole_families_are_reserved(name):
    assert is_reserved(name)


@pytest.mark.parametrize("name", ["torque", "rate", "state", "stretch", "index_of", "half", "mode"])
def test_other_names_stay(name):
    assert not is_reserved(name)
