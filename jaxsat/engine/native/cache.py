"""Machine code kept on disk, by a hash of all that it was made from.

The folder is the platform's for caches, or that of the environment variable JAXSAT_CACHE_DIR.
Writers of the same entry do not disturb one another: an entry appears whole or not at all.
"""

import contextlib
import hashlib
import os
import sys
import tempfile
from pathlib import Path

from jaxsat.engine.native import target

ENTRIES = 256
"""How many are kept; the ones unused for longest go."""

_DIGEST = 32


def folder() -> Path:
    """Where machine code is kept."""
    chosen = os.environ.get("JAXSAT_CACHE_DIR")
    if chosen:
        return Path(chosen) / "native"
    home = Path.home()
    if sys.platform == "darwin":
        base = home / "Library" / "Caches"
    elif sys.platform == "win32":
        base = Path(os.environ.get("LOCALAPPDATA", home / "AppData" / "Local"))
    else:
        base = Path(os.environ.get("XDG_CACHE_HOME", home / ".cache"))
    return base / "jaxsat" / "native"


def object_code(text: str) -> bytes:
    """Machine code of an LLVM text, from the cache or made and put there."""
    host = target.host()
    made_from = (target.PASSES, target.version(), host.name, host.features, text)
    path = folder() / f"{hashlib.sha256(repr(made_from).encode()).hexdigest()}.o"
    with contextlib.suppress(OSError):
        kept = path.read_bytes()
        if hashlib.sha256(kept[_DIGEST:]).digest() == kept[:_DIGEST]:
            os.utime(path)
            return kept[_DIGEST:]
    code = target.object_code(text)
    with contextlib.suppress(OSError):  # a cache that cannot be written is none
        _write(path, hashlib.sha256(code).digest() + code)
    return code


def _write(path: Path, content: bytes) -> None:
    path.parent.mkdir(parents=True, exist_ok=True)
    handle, name = tempfile.mkstemp(dir=path.parent, prefix=".new-")
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(name, path)
    except OSError:
        Path(name).unlink(missing_ok=True)
        raise
    entries = sorted(path.parent.glob("*.o"), key=lambda entry: entry.stat().st_mtime)
    for entry in entries[:-ENTRIES]:
        entry.unlink(missing_ok=True)
