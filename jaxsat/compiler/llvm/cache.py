"""Machine code kept on disk, by a hash of all that it was made from.

The folder is the platform's for caches, or that of the environment variable JAXSAT_CACHE_DIR.
Writers of the same entry do not disturb one another: an entry appears whole or not at all.

Machine code runs as it is, so whoever could write an entry could do whatever this user can. The
folder and every entry are therefore this user's alone (`private`). An entry begins with a hash
(SHA-256) of its name and content: one that is damaged, or that stands under another's name, is not
run, but made anew. The hash keeps nobody out, nor could a key that lies beside the entries. Access
lists beyond the mode bits are not looked at.

Where the cache cannot be used, a `CacheWarning` tells why, once in a process.
"""

import contextlib
import hashlib
import os
import sys
import threading
import warnings
from pathlib import Path

from jaxsat.compiler.llvm import target
from jaxsat.compiler.llvm.private import private_folder, read, remove_abandoned, write

MOST_BYTES = 2**30
"""Of all entries; the ones unused for longest go."""

KINDS = (".o", ".kernel")
"""How the names of entries end: machine code, and kernels (`kept`)."""

_BYTES = 32
"""Of the hash before an entry's content."""

_told = threading.Event()
_threads = threading.Lock()


class CacheWarning(UserWarning):
    """Machine code cannot be kept; everything else works, but begins more slowly."""


class _Unusable(OSError):
    """Why there is no place for a cache."""


def folder() -> Path:
    """Where machine code is kept. Raises `OSError` where no absolute path is known."""
    chosen = os.environ.get("JAXSAT_CACHE_DIR")
    if chosen:
        if not os.path.isabs(chosen):
            raise _Unusable(f"JAXSAT_CACHE_DIR must be an absolute path, but is {chosen!r}")
        return Path(chosen) / "native"
    if sys.platform == "darwin":
        base = _home() / "Library" / "Caches"
    elif sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA") or _home() / "AppData" / "Local")
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", ""))
        base = base if base.is_absolute() else _home() / ".cache"  # as the specification says
    return base / "jaxsat" / "native"


def _home() -> Path:
    try:
        home = Path.home()
    except RuntimeError:
        raise _Unusable("no home folder is known") from None
    if not home.is_absolute() or os.environ.get("HOME") == "":
        raise _Unusable("the home folder must be an absolute path, but HOME is none")
    return home


def object_code(text: str) -> bytes:
    """Machine code of an LLVM text, from the cache or made and put there."""
    host = target.host()
    made_from = (target.PASSES, target.version(), host.name, host.features, text)
    name = f"{hashlib.sha256(repr(made_from).encode()).hexdigest()}.o"
    found = kept(name)
    if found is None:
        found = target.object_code(text)
        keep(name, found)
    return found


def kept(name: str) -> bytes | None:
    """What an entry contains; None where there is none, or none that was written here."""
    try:
        place = private_folder(folder())
    except OSError as error:
        _tell(error)
        return None
    content = read(place / name)
    if content is None or content[:_BYTES] != _hash(name, content[_BYTES:]):
        return None
    with contextlib.suppress(OSError):
        os.utime(place / name)
    return content[_BYTES:]


def keep(name: str, content: bytes) -> None:
    """Let an entry contain this, if there is a place for it."""
    try:
        place = private_folder(folder())
        write(place / name, _hash(name, content) + content)
        _remove_oldest(place)
    except OSError as error:
        _tell(error)


def _hash(name: str, content: bytes) -> bytes:
    return hashlib.sha256(name.encode() + b"\0" + content).digest()


def _remove_oldest(place: Path) -> None:
    remove_abandoned(place)
    entries = []
    with os.scandir(place) as files:
        for entry in (file for file in files if file.name.endswith(KINDS)):
            with contextlib.suppress(FileNotFoundError):  # another process has removed it
                status = entry.stat(follow_symlinks=False)
                entries.append((status.st_mtime_ns, status.st_size, entry.path))
    room = MOST_BYTES
    for _, size, path in sorted(entries, reverse=True):
        room -= size
        if room < 0:
            with contextlib.suppress(OSError):
                os.unlink(path)


def _tell(error: OSError) -> None:
    with _threads:
        if _told.is_set():
            return
        _told.set()
    reason = f"{error.filename}: {error.strerror}" if error.filename else str(error)
    warnings.warn(
        f"machine code cannot be kept for later runs, which takes them longer: {reason}",
        CacheWarning,
        stacklevel=3,
    )
