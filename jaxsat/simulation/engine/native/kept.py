"""Whole kernels kept on disk, so that a program seen before is neither traced nor lowered again.

The name of an entry is a hash of all that tracing and lowering depend on:

- the program, its steps and the kinds of its inputs, as `pickle` writes them, with shapes and types
  in place of numbers: what has the same bytes is built alike. All classes and functions in it must
  be those of `PACKAGES`. A part of a user's own, a lambda or a local function makes no name, and
  such a program is traced each time.
- the content and the time of every source file of jaxsat, and the versions of Python and of
  `PACKAGES`. Where a file was changed after jaxsat was imported there is no entry, as what is
  in memory may be older than what is in the file.
- every setting of JAX, as it is in force, and its backend.
- LLVM and the processor, as for machine code.

What none of this tells is code that a program has changed in memory. With each entry are therefore
the hashes of jaxsat's modules as they were in memory when it was made (`loaded_code`): it is used
where those that are imported by now have the same. The command line runs nobody's code but that of
parts that a scenario names, which have no entries. It has entries of its own, and trusts them.
The environment variable JAXSAT_KEPT_KERNELS is 1 there; with 0 nothing is kept. Entries lie and are
protected as those of `cache`.
"""

import contextlib
import hashlib
import importlib.metadata
import io
import os
import pickle
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any, TypeVar

import jax
from jaxtyping import PyTree

import jaxsat
from jaxsat.compiler.llvm import cache, target
from jaxsat.compiler.llvm.arguments import Arguments
from jaxsat.core.once import once, once_property
from jaxsat.simulation.engine.native.loaded_code import loaded_as_written, loaded_code

PACKAGES = (
    *("jax", "jaxlib", "equinox", "diffrax", "lineax", "optimistix"),
    *("jaxtyping", "numpy", "ml_dtypes", "llvmlite"),
)
"""Distributions whose code tracing and lowering run, besides jaxsat."""

_BUILT_IN = {"builtins", "collections", "copyreg", "functools", "operator", "pathlib", "_codecs"}
CLOCK_NS = 60 * 10**9
"""By how much the clock of a file system may be behind. Sooner after a change nothing is kept."""

T = TypeVar("T")

SETTING = "JAXSAT_KEPT_KERNELS"

Code = dict[str, bytes]
"""Hashes of modules by their names."""


@dataclass(frozen=True)
class MadeKernel:
    """What of a kernel is kept: its machine code, how it is called, and what tells it apart."""

    code: bytes
    arena: int
    state_size: int
    arguments: Arguments
    outputs: PyTree
    signals: PyTree
    going: int | None
    behind: bool
    operations: str


@dataclass(frozen=True)
class MadeObserver:
    """What of a kernel is kept for replays: the code that observes, and its arena's size."""

    code: bytes
    arena: int


def entry_name(*parts: PyTree) -> str | None:
    """The name of the entry for trees and plain data; None where there is to be none."""
    if os.environ.get(SETTING) == "0" or not loaded_as_written("jaxsat"):
        return None
    stream = io.BytesIO()
    try:
        _Structure(stream).dump(jax.tree.map(_shape_of, parts))
    except Exception:  # pickle raises what it likes for what it cannot write
        return None
    surroundings = _surroundings()
    if surroundings is None:
        return None
    host = target.host()
    ingredients = (
        *(surroundings, _settings(), jax.default_backend()),
        *(target.PASSES, target.version(), host.name, host.features),
        stream.getvalue(),
    )
    return hashlib.sha256(repr(ingredients).encode()).hexdigest()


class Entries:
    """What is kept under one name, as the code in memory was when it was first looked for.

    `look_up` gives what is of a kind, made and kept where there is none; without a name it is made.
    """

    def __init__(self, name: str | None):
        self._name = name
        self._trusted = os.environ.get(SETTING) == "1"

    @once_property
    def _code(self) -> Code | None:
        return _code_in_memory()

    def look_up(self, kind: type[T], make: Callable[[], T]) -> T:
        """The entry of a kind."""
        if self._name is None:
            return make()
        trusted = f"{self._name}.{kind.__name__}.kernel"
        own = trusted if self._trusted else f"{self._name}.{kind.__name__}.python.kernel"
        for name in dict.fromkeys((trusted, own)):
            content = self._found(name, kind)
            if content is not None:
                return content
        before = None if self._trusted else self._code
        entry, code = make(), _code_in_memory()
        if self._trusted or _agree(before, code):
            with contextlib.suppress(Exception):  # trees of a kind that `pickle` cannot write
                cache.keep(own, pickle.dumps((entry, code)))
        return entry

    def _found(self, name: str, kind: type[T]) -> T | None:
        content = cache.kept(name)
        if content is None:
            return None
        try:
            # nobody but this user has written it: see `cache`
            entry, code = pickle.loads(content)
            fits = isinstance(entry, kind) and (self._trusted or _agree(self._code, code))
        except Exception:
            return None
        return entry if fits else None


def _code_in_memory() -> Code | None:
    try:
        return loaded_code("jaxsat")
    except Exception:  # of objects that a program has put into modules, which raise what they like
        return None


def _agree(one: Code | None, other: Code | None) -> bool:
    """Whether both are known, and what is imported in both is the same code."""
    if one is None or other is None:
        return False
    return all(other.get(module, code) == code for module, code in one.items())


@dataclass(frozen=True)
class _Shape:
    """An array of which only its kind matters."""

    shape: tuple[int, ...]
    dtype: str


def _shape_of(x: Any) -> Any:
    if isinstance(x, jax.Array | jax.ShapeDtypeStruct):
        return _Shape(tuple(x.shape), str(x.dtype))
    return x


class _Structure(pickle.Pickler):
    """Writes nothing that refers to code of others than `PACKAGES`."""

    def reducer_override(self, obj: Any) -> Any:
        owner = obj if isinstance(obj, type) or callable(obj) else type(obj)
        module = getattr(owner, "__module__", None) or type(obj).__module__
        if not isinstance(module, str) or module.split(".")[0] not in _known_roots():
            raise pickle.PicklingError(f"{obj!r} is of {module}")
        if isinstance(obj, jax.Array):
            raise pickle.PicklingError("an array is hidden in the structure")
        return NotImplemented


@once
def _known_roots() -> frozenset[str]:
    return frozenset({"jaxsat", *PACKAGES, *_BUILT_IN})


def _surroundings() -> str | None:
    """Python, the packages, and jaxsat's own files; None where these are not all known."""
    folder = Path(jaxsat.__file__).parent
    try:
        return _packages_and_sources(folder) if unchanged(folder, jaxsat.IMPORTED_NS) else None
    except (OSError, importlib.metadata.PackageNotFoundError):
        return None


@once
def _packages_and_sources(folder: Path) -> str:
    versions = [importlib.metadata.version(name) for name in PACKAGES]
    return repr((sys.version, versions, sources_hash(folder)))


def unchanged(folder: Path, before_ns: int) -> bool:
    """Whether there are files in a folder, and all are older than `before_ns` (of `time.time_ns`).

    A program that runs for long may import modules that were edited since it began.
    """
    times = [max(one.st_mtime_ns, one.st_ctime_ns) for one in map(Path.stat, _files(folder))]
    return max(times, default=before_ns) < before_ns - CLOCK_NS


def sources_hash(folder: Path) -> str:
    """A hash of the names, contents and times of all files in a folder: code, and what it reads."""
    digest = hashlib.sha256()
    for file in _files(folder):
        content = file.read_bytes()
        name = file.relative_to(folder).as_posix()
        digest.update(f"{name} {len(content)} {file.stat().st_mtime_ns}\n".encode())
        digest.update(content)
    return digest.hexdigest()


def _files(folder: Path) -> list[Path]:
    return sorted(
        Path(parent, name)
        for parent, _, names in os.walk(folder)
        for name in names
        if not parent.endswith("__pycache__")  # where files come and go as Python compiles
    )


def _settings() -> list[str]:
    """Settings of JAX that are in force here, those of a context included."""
    names = sorted(jax.config.values)  # pyright: ignore[reportAttributeAccessIssue]
    return [f"{name}={getattr(jax.config, name, None)!r}" for name in names]
