"""Store of whole kernels on disk, so that a known program is neither traced nor lowered again.

The name of an entry is a hash of all that tracing and lowering depend on:

- the program, its steps and the kinds of its inputs, as `pickle` writes them, with shapes and types
  in place of numbers: equal bytes build equal code. All classes and functions in it must
  be in `PACKAGES`. A user's own part, a lambda or a local function prevents a name, and
  such a program is traced each time.
- the content and the time of every source file of jaxsat, and the versions of Python and of
  `PACKAGES`. If a file was changed after jaxsat was imported there is no entry, as the code
  in memory may be older than the file.
- every setting of JAX in force, and its backend.
- LLVM and the processor, as for machine code.

The name does not cover code that a program has changed in memory. Each entry therefore contains the
hashes of jaxsat's modules as they were in memory at its creation (`loaded_code`), of those imported
when the program's first entry was made: it is used if the modules imported by now have the same
hashes. Only packages that the program's code can reach count (`LAYERS`). The command line runs no
user code except parts that a scenario names, which have no entries. It has entries of its own, and
trusts them. The environment variable JAXSAT_KEPT_KERNELS is 1 there; with 0 nothing is stored.
Entries are located and protected as those of `cache`.
"""

import contextlib
import hashlib
import importlib.metadata
import io
import os
import pickle
import sys
from collections.abc import Callable, Iterable
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
"""Distributions, besides jaxsat, whose code runs during tracing and lowering."""

LAYERS = (
    *("core", "compiler", "spacecraft", "control", "simulation", "controllability", "store"),
    *("flight", "studies", "scenario", "report", "synthesis", "cli"),
)
"""Packages of jaxsat from below: none imports from a later one, which CI checks."""

_ENGINE = "simulation"
"""The highest package whose code traces and lowers every program."""

_OTHERS = (
    *("annotated_types", "bokeh", "casadi", "cloudpickle", "cma", "cyclopts", "distributed"),
    *("google_crc32c", "h5py", "jinja2", "markupsafe", "matplotlib", "numcodecs", "optax"),
    *("pandas", "pydantic", "pydantic_core", "rich", "scipy", "typing_extensions", "xarray"),
)
"""Packages whose names are in modules of jaxsat, but whose code does not run during tracing."""

_BUILT_IN = {"builtins", "collections", "copyreg", "functools", "operator", "pathlib", "_codecs"}
CLOCK_NS = 60 * 10**9
"""Largest lag of a file system's clock, ns. Nothing is stored for so long after a change."""

T = TypeVar("T")

SETTING = "JAXSAT_KEPT_KERNELS"

Code = dict[str, bytes]
"""Hashes of modules by name."""


@dataclass(frozen=True)
class StoredKernel:
    """Stored part of a kernel: its machine code, how to call it, and its fingerprint."""

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
class StoredObserver:
    """Stored part of a kernel for replays: the code that observes, and its arena's size."""

    code: bytes
    arena: int


@dataclass(frozen=True)
class EntryName:
    """The name of entries, and the packages of jaxsat whose code the program can reach."""

    digest: str
    packages: tuple[str, ...] = LAYERS


def entry_name(*parts: PyTree) -> EntryName | None:
    """The name of the entry for trees and plain data; None where there must be no entry."""
    if os.environ.get(SETTING) == "0" or not loaded_as_written("jaxsat"):
        return None
    stream = io.BytesIO()
    structure = _Structure(stream)
    try:
        structure.dump(jax.tree.map(_shape_of, parts))
        packages = _reached(structure.modules)
    except Exception:  # pickle raises any error for an object that it cannot write
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
    digest = hashlib.sha256(repr(ingredients).encode()).hexdigest()
    return EntryName(digest, packages)


def _reached(modules: Iterable[str]) -> tuple[str, ...]:
    """The packages that the code of these modules can import from, with those of the engine."""
    names = {_ENGINE, *(module.split(".")[1] for module in modules)}
    return LAYERS[: max(map(LAYERS.index, names)) + 1]


class Entries:
    """The entries under one name, as the code in memory was at the first look-up.

    `look_up` returns the entry of a kind, creating and storing it if missing.
    """

    def __init__(self, name: EntryName | None):
        self._name = name
        self._trusted = os.environ.get(SETTING) == "1"

    @once_property
    def _code(self) -> Code | None:
        return self._code_in_memory()

    def _code_in_memory(self) -> Code | None:
        assert self._name is not None
        try:
            return loaded_code("jaxsat", {*PACKAGES, *_OTHERS}, self._name.packages)
        except Exception:  # foreign objects in modules may raise any error
            return None

    def look_up(self, kind: type[T], make: Callable[[], T]) -> T:
        """The entry of a kind."""
        if self._name is None:
            return make()
        digest = self._name.digest
        trusted = f"{digest}.{kind.__name__}.kernel"
        own = trusted if self._trusted else f"{digest}.{kind.__name__}.python.kernel"
        for name in dict.fromkeys((trusted, own)):
            content = self._found(name, kind)
            if content is not None:
                return content
        before = None if self._trusted else self._code
        entry = make()
        code = self._code if self._trusted else self._code_in_memory()  # trusted: changed by nobody
        if self._trusted or _agree(before, code):
            with contextlib.suppress(Exception):  # trees that `pickle` cannot write
                cache.keep(own, pickle.dumps((entry, code)))
        return entry

    def _found(self, name: str, kind: type[T]) -> T | None:
        content = cache.content_of(name)
        if content is None:
            return None
        try:
            # only this user can have written it: see `cache`
            entry, code = pickle.loads(content)
            fits = isinstance(entry, kind) and (self._trusted or _agree(self._code, code))
        except Exception:
            return None
        return entry if fits else None


def _agree(one: Code | None, other: Code | None) -> bool:
    """Whether both are known, and modules imported in both have equal code."""
    if one is None or other is None:
        return False
    return all(other.get(module, code) == code for module, code in one.items())


@dataclass(frozen=True)
class _Shape:
    """Shape and type of an array."""

    shape: tuple[int, ...]
    dtype: str


def _shape_of(x: Any) -> Any:
    if isinstance(x, jax.Array | jax.ShapeDtypeStruct):
        return _Shape(tuple(x.shape), str(x.dtype))
    return x


class _Structure(pickle.Pickler):
    """Pickler that refuses references to code outside `PACKAGES`, and notes jaxsat's modules."""

    def __init__(self, stream: io.BytesIO):
        super().__init__(stream)
        self.modules: set[str] = set()

    def reducer_override(self, obj: Any) -> Any:
        owner = obj if isinstance(obj, type) or callable(obj) else type(obj)
        module = getattr(owner, "__module__", None) or type(obj).__module__
        if not isinstance(module, str) or module.split(".")[0] not in _known_roots():
            raise pickle.PicklingError(f"{obj!r} is of {module}")
        if module.startswith("jaxsat."):
            self.modules.add(module)
        if isinstance(obj, jax.Array):
            raise pickle.PicklingError("an array is hidden in the structure")
        return NotImplemented


@once
def _known_roots() -> frozenset[str]:
    return frozenset({"jaxsat", *PACKAGES, *_BUILT_IN})


def _surroundings() -> str | None:
    """Python, the packages, and jaxsat's own files; None if one of them is unknown."""
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
    """Whether a folder has files, all older than `before_ns` (of `time.time_ns`).

    A long-running program may import modules that were edited since it began.
    """
    times = [max(one.st_mtime_ns, one.st_ctime_ns) for one in map(os.stat, _files(folder))]
    return max(times, default=before_ns) < before_ns - CLOCK_NS


def sources_hash(folder: Path) -> str:
    """A hash of the names, contents and times of all files in a folder."""
    digest = hashlib.sha256()
    for name in _files(folder):
        with open(name, "rb", buffering=0) as file:
            content, status = file.read(), os.fstat(file.fileno())
        digest.update(f"{name[len(str(folder)) :]} {len(content)} {status.st_mtime_ns}\n".encode())
        digest.update(content)
    return digest.hexdigest()


def _files(folder: Path) -> list[str]:
    return sorted(
        os.path.join(parent, name)
        for parent, _, names in os.walk(folder)
        for name in names
        if not parent.endswith("__pycache__")  # where files come and go as Python compiles
    )


def _settings() -> list[str]:
    """Settings of JAX in force, including those of a context."""
    names = sorted(jax.config.values)  # pyright: ignore[reportAttributeAccessIssue]
    return [f"{name}={getattr(jax.config, name, None)!r}" for name in names]
