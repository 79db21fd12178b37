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

What none of this tells is code that another program has changed in memory. Entries are therefore
used only where the environment variable JAXSAT_KEPT_KERNELS is 1. The command line sets it for
itself, as it runs nobody's code but that of parts that a scenario names. Entries lie and are
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
from jaxsat.core.once import once

PACKAGES = (
    *("jax", "jaxlib", "equinox", "diffrax", "lineax", "optimistix"),
    *("jaxtyping", "numpy", "ml_dtypes", "llvmlite"),
)
"""Distributions whose code tracing and lowering run, besides jaxsat."""

_BUILT_IN = {"builtins", "collections", "copyreg", "functools", "operator", "pathlib", "_codecs"}
CLOCK_NS = 60 * 10**9
"""By how much the clock of a file system may be behind. Sooner after a change nothing is kept."""

T = TypeVar("T")

IN_USE = "JAXSAT_KEPT_KERNELS"


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
    if os.environ.get(IN_USE) != "1":
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
    return f"{hashlib.sha256(repr(ingredients).encode()).hexdigest()}.kernel"


def kept_or_made(name: str | None, kind: type[T], make: Callable[[], T]) -> T:
    """The entry of that name and kind, made and kept where there is none.

    Without a name it is simply made.
    """
    if name is None:
        return make()
    content = cache.kept(name)
    if content is not None:
        try:
            entry = pickle.loads(content)  # which nobody but this user has written: see `cache`
        except Exception:
            entry = None
        if isinstance(entry, kind):
            return entry
    entry = make()
    with contextlib.suppress(Exception):  # trees of a kind that `pickle` cannot write
        cache.keep(name, pickle.dumps(entry))
    return entry


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


@once
def _surroundings() -> str | None:
    """Python, the packages, and jaxsat's own files; None where these are not all known."""
    sources = sources_hash(Path(jaxsat.__file__).parent, jaxsat.IMPORTED_NS)
    if sources is None:
        return None
    try:
        versions = [importlib.metadata.version(name) for name in PACKAGES]
    except importlib.metadata.PackageNotFoundError:
        return None
    return repr((sys.version, versions, sources))


def sources_hash(folder: Path, before_ns: int) -> str | None:
    """A hash of the names, contents and times of all files in a folder: code, and what it reads.

    None where one was changed at `before_ns` (of the clock `time.time_ns`) or later, or there is
    none.
    """
    digest = hashlib.sha256()
    files = sorted(one for one in folder.rglob("*") if one.is_file() and one.suffix != ".pyc")
    for file in files:
        content, status = file.read_bytes(), file.stat()
        if max(status.st_mtime_ns, status.st_ctime_ns) >= before_ns - CLOCK_NS:
            return None
        name = file.relative_to(folder).as_posix()
        digest.update(f"{name} {len(content)} {status.st_mtime_ns}\n".encode())
        digest.update(content)
    return digest.hexdigest() if files else None


def _settings() -> list[str]:
    """Settings of JAX that are in force here, those of a context included."""
    names = sorted(jax.config.values)  # pyright: ignore[reportAttributeAccessIssue]
    return [f"{name}={getattr(jax.config, name, None)!r}" for name in names]
