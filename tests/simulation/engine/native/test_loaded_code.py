"""The hash of a module in memory: what changes it, and what must not."""

import functools
import importlib
import sys
import types
from fractions import Fraction

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from jaxsat.simulation.engine.native import loaded_code as loaded
from jaxsat.simulation.engine.native.loaded_code import ForeignCode, loaded_as_written

SOURCE = """
import dataclasses, enum, functools, threading
import equinox as eqx
import jax
import numpy as np
from jaxsat.core.once import once, once_property

LIMIT = 2.0
TABLE = {"gains": (1.0, None), "names": frozenset(["a", "b"])}
POINTS = np.array([1.0, 2.0])
_made = {}
lock = threading.Lock()

def scaled(x, by=2.0, *, most=LIMIT):
    return min(x * by, most)

def factory(width):
    def narrow(x):
        return x / width
    return narrow

narrow = factory(3.0)
twice = functools.partial(scaled, by=2.0)
half = lambda x: x / 2
NESTED = [lambda x: (lambda y: y + 1)(x)]

@once
def slow(x):
    return x

@jax.custom_jvp
def smooth(x):
    return x

@smooth.defjvp
def _slope(primals, tangents):
    return primals[0], tangents[0]

class Colour(enum.Enum):
    RED = 1

@dataclasses.dataclass(frozen=True)
class Settings:
    rough: float = 0.5
    rule: object = half

    @once_property
    def later(self):
        return self.rough

ROUGH = Settings(0.1)

class Law(eqx.Module):
    gain: float = 1.0
    WIDTH = 0.25

    def torque(self, x):
        return self.gain * x

    @property
    def name(self):
        return "law"

    @classmethod
    def made(cls):
        return super().__new__(cls)

    @staticmethod
    def zero():
        return 0.0
"""


KNOWN = {"jaxsat", "jax", "equinox", "numpy", "helpers", __name__.partition(".")[0]}


def loaded_code(package):
    return loaded.loaded_code(package, KNOWN)


def imported(monkeypatch, source=SOURCE, name="spacecraft_package.laws"):
    module = types.ModuleType(name)
    monkeypatch.setitem(sys.modules, name, module)
    exec(compile(source, f"/{name}.py", "exec"), vars(module))
    return module


def hash_of(module):
    return loaded_code("spacecraft_package")[module.__name__]


def test_the_same_source_has_the_same_hash_whatever_it_was_used_for(monkeypatch):
    first = imported(monkeypatch)
    before = hash_of(first)
    first._made["kept"] = 1
    first.slow(3)
    assert first.ROUGH.later == 0.1
    first.lock.acquire()
    first.Law(2.0).torque(jnp.ones(2))
    assert hash_of(first) == before
    second = imported(monkeypatch)
    assert hash_of(second) == before
    importer = imported(
        monkeypatch, "from spacecraft_package.laws import Law, scaled", "spacecraft_package.user"
    )
    assert loaded_code("spacecraft_package").keys() == {
        "spacecraft_package.laws",
        "spacecraft_package.user",
    }
    alone = hash_of(importer)
    second.Law.torque = second.Law.zero
    assert hash_of(second) != before
    assert hash_of(importer) == alone  # the module that defines it tells of it


def test_neither_the_order_of_imports_nor_other_modules_of_a_package_change_a_hash(monkeypatch):
    source = "from spacecraft_package.laws import *\nfrom spacecraft_package.laws import _made"
    laws = imported(monkeypatch)
    user = imported(monkeypatch, source, "spacecraft_package.user")
    package = imported(monkeypatch, "ORDER = 4", "spacecraft_package.solvers")
    before = loaded_code("spacecraft_package")
    for module in (laws, package):  # to the end
        monkeypatch.delitem(sys.modules, module.__name__)
        monkeypatch.setitem(sys.modules, module.__name__, module)
    assert [*sys.modules][-3:] == [user.__name__, laws.__name__, package.__name__]
    assert loaded_code("spacecraft_package") == before
    name = f"{package.__name__}.tsit5"
    monkeypatch.setattr(package, "tsit5", imported(monkeypatch, "ORDER = 5", name), raising=False)
    assert hash_of(package) == before[package.__name__]
    monkeypatch.setattr(package, "tsit5", types.ModuleType(name))  # another than was imported
    assert hash_of(package) != before[package.__name__]


@pytest.mark.parametrize(
    ("old", "new"),
    [
        ("LIMIT = 2.0", "LIMIT = 3.0"),
        ("LIMIT = 2.0", "LIMIT = 2"),
        ("(1.0, None)", "[1.0, None]"),
        ('["a", "b"]', '["a", "c"]'),
        ("array([1.0", "array([1.5"),
        ("x * by", "x + by"),
        ("by=2.0, *", "by=3.0, *"),
        ("most=LIMIT", "most=1.0"),
        ("factory(3.0)", "factory(4.0)"),
        ("(scaled, by=2.0)", "(scaled, by=1.0)"),
        ("x / 2", "x / 3"),
        ("y + 1", "y + 2"),
        ("def slow(x):\n    return x", "def slow(x):\n    return 2 * x"),
        ("def smooth(x):\n    return x", "def smooth(x):\n    return 2 * x"),
        ("tangents[0]\n", "2 * tangents[0]\n"),
        ("RED = 1", "RED = 2"),
        ("rough: float = 0.5", "rough: float = 0.6"),
        ("rule: object = half", "rule: object = abs"),
        ("Settings(0.1)", "Settings(0.2)"),
        ("gain: float = 1.0", "gain: float = 2.0"),
        ("WIDTH = 0.25", "WIDTH = 0.5"),
        ("self.gain * x", "-self.gain * x"),
        ('"law"', '"another"'),
        ("super().__new__(cls)", "cls()"),
        ("return 0.0", "return 1.0"),
    ],
)
def test_every_change_of_code_or_constants_is_another_hash(monkeypatch, old, new):
    assert old in SOURCE
    before = hash_of(imported(monkeypatch))
    assert hash_of(imported(monkeypatch, SOURCE.replace(old, new))) != before


@pytest.mark.parametrize(
    "patch",
    [
        lambda module: setattr(module, "scaled", lambda x: x),
        lambda module: setattr(module, "scaled", functools.wraps(module.scaled)(lambda x: x)),
        lambda module: setattr(module, "LIMIT", np.float64(2.0)),
        lambda module: setattr(module.scaled, "__defaults__", (3.0,)),
        lambda module: setattr(module.scaled, "__code__", (lambda x: x).__code__),
        lambda module: setattr(module.Law, "WIDTH", 1.0),
        lambda module: setattr(module.Law, "torque", lambda self, x: x),
        lambda module: setattr(module, "Law", type("Law", (module.Law,), {})),
        lambda module: module.TABLE.update(gains=None),
        lambda module: module.POINTS.__setitem__(0, 5.0),
        lambda module: module.smooth.defjvp(lambda primals, tangents: (primals[0], 0.0)),
    ],
)
def test_what_a_program_changes_in_memory_is_another_hash(monkeypatch, patch):
    module = imported(monkeypatch)
    before = hash_of(module)
    patch(module)
    assert hash_of(module) != before


def test_a_module_with_code_of_others_has_no_hash(monkeypatch):
    """Their function would count by its name, and be another one after an edit."""
    others = imported(monkeypatch, "class Law: ...\ndef turn(x): return 2 * x", "experiment")
    module = imported(monkeypatch)
    hash_of(module)
    for patch in (
        *(others, others.turn, others.Law, others.Law()),
        *(functools.partial(others.turn, 1), jax.tree_util.Partial(others.turn)),
    ):
        with monkeypatch.context() as here:
            here.setattr(module, "scaled", patch)
            with pytest.raises(ForeignCode, match="experiment"):
                hash_of(module)
    for patch in (others.turn, functools.wraps(module.Law.torque)(others.turn)):
        with monkeypatch.context() as here:
            here.setattr(module.Law, "torque", patch)
            with pytest.raises(ForeignCode, match="experiment"):
                hash_of(module)


@pytest.mark.parametrize(
    ("one", "other"),
    [
        (jnp.array(1.0), jnp.array(2.0)),
        (range(3), range(4)),
        (Fraction(1, 3), Fraction(1, 2)),
        (jax.tree_util.Partial(min, 1), jax.tree_util.Partial(min, 2)),
    ],
)
def test_values_of_other_kinds_count_by_their_content(monkeypatch, one, other):
    module = imported(monkeypatch)
    hashes = []
    for value in (one, other, one):
        monkeypatch.setattr(module, "LIMIT", value)
        hashes.append(hash_of(module))
    assert hashes[0] == hashes[2] != hashes[1]


def test_parts_of_a_package_are_hashed_if_they_need_no_others(monkeypatch):
    imported(monkeypatch, name="spacecraft_package.laws.rate")
    user = imported(
        monkeypatch, "from spacecraft_package.laws.rate import Law", "spacecraft_package.studies"
    )
    whole = loaded_code("spacecraft_package")
    laws = loaded.loaded_code("spacecraft_package", KNOWN, ["laws"])
    assert laws == {"spacecraft_package.laws.rate": whole["spacecraft_package.laws.rate"]}
    assert loaded.loaded_code("spacecraft_package", KNOWN, ["law"]) == {}
    assert loaded.loaded_code("spacecraft_package", KNOWN, ["laws", "studies"]) == whole
    assert user.__name__ in whole
    with pytest.raises(ForeignCode, match="laws"):
        loaded.loaded_code("spacecraft_package", KNOWN, ["studies"])


def test_modules_that_a_hook_has_loaded_are_told(monkeypatch, tmp_path):
    assert loaded_as_written("json")
    (tmp_path / "hooked").mkdir()
    (tmp_path / "hooked" / "__init__.py").touch()
    (tmp_path / "hooked" / "law.py").touch()
    monkeypatch.syspath_prepend(tmp_path)
    law = importlib.import_module("hooked.law")
    assert loaded_as_written("hooked")
    monkeypatch.setattr(law, "__loader__", object())
    assert not loaded_as_written("hooked")
