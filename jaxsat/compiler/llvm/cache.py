"""Cache of machine code on disk, by a hash of all its inputs.

The folder is the platform's for caches, or that of the environment variable JAXSAT_CACHE_DIR.
Writers of the same entry do not disturb one another: an entry appears whole or not at all.

Machine code runs as it is, so whoever could write an entry could do whatever this user can. The
folder and every entry are therefore this user's alone (on systems without owners and modes as POSIX
has them, such as Windows, as private as their place). An entry begins with a hash (SHA-256) of its
name and content: a damaged one, or one under another's name, is not run, but made anew. The hash
keeps nobody out, nor could a key beside the entries. Access lists beyond the mode bits are not
examined.

Where the cache cannot be used, a `CacheWarning` gives the reason, once in a process.
"""

import contextlib
import hashlib
import os
import secrets
import stat
import sys
import threading
import time
import warnings
from pathlib import Path

from jaxsat.compiler.llvm import target

MOST_BYTES = 2**30
"""Largest total size of the entries, bytes; the least recently used ones are removed."""

KINDS = (".o", ".kernel", ".measured")
"""Suffixes of entries: machine code, kernels (`kernel_store`), and measurements of flight code."""

_BYTES = 32
"""Bytes of the hash before an entry's content."""

_told = threading.Event()
_threads = threading.Lock()


class CacheWarning(UserWarning):
    """Machine code cannot be cached; everything else works, but starts more slowly."""


class _Unusable(OSError):
    """Reason why there is no place for a cache."""


def folder() -> Path:
    """Return the folder of machine code. Raises `OSError` where no absolute path is known."""
    path = os.environ.get("JAXSAT_CACHE_DIR")
    if path:
        if not os.path.isabs(path):
            raise _Unusable(f"JAXSAT_CACHE_DIR must be an absolute path, but is {path!r}")
        return Path(path) / "native"
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
    """Return the machine code of an LLVM text, from the cache or made and put there."""
    host = target.host()
    made_from = (target.PASSES, target.version(), host.name, host.features, text)
    name = f"{hashlib.sha256(repr(made_from).encode()).hexdigest()}.o"
    code = content_of(name)
    if code is None:
        code = target.object_code(text)
        keep(name, code)
    return code


def content_of(name: str) -> bytes | None:
    """Return the content of an entry; None where there is none, or none that was written here."""
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
    """Write an entry, if there is a place for it."""
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


ANYBODY_ELSE = stat.S_IRWXG | stat.S_IRWXO

NEW = ".new-"
"""Prefix of files that are being written."""

ABANDONED = 3600.0
"""Age (s) from which such a file counts as abandoned."""

_READ = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
_WRITE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)
_BINARY = getattr(os, "O_BINARY", 0)


class NotPrivate(OSError):
    """A folder that others could have written to, or could have replaced."""


def private_folder(path: Path) -> Path:
    """Return the real path of a folder of this user alone (mode 0700), created if necessary.

    Raises `NotPrivate` where it is a link or belongs to or can be written by somebody else, or
    where somebody else could rename a parent folder (whose parent may be a folder like /tmp, whose
    sticky bit forbids that), and `OSError` where it cannot be created.
    """
    for folder in (*reversed(path.parents), path):
        try:
            folder.mkdir(mode=stat.S_IRWXU)
        except OSError:
            if not folder.is_dir():
                raise
    real = path.parent.resolve() / path.name
    status = os.lstat(real)
    if not stat.S_ISDIR(status.st_mode):
        raise NotPrivate(f"{real} is not a folder")
    if not hasattr(os, "geteuid"):
        return real
    if status.st_uid != os.geteuid():
        raise NotPrivate(f"{real} belongs to another user")
    if _others_write(status):
        raise NotPrivate(f"{real} can be written by other users (chmod 700 would change that)")
    if status.st_mode & ANYBODY_ELSE:
        real.chmod(stat.S_IRWXU)
    for folder in real.parents:
        above = os.stat(folder)
        if above.st_uid not in (0, os.geteuid()):
            raise NotPrivate(f"{folder}, which it is in, belongs to another user")
        if _others_write(above) and not above.st_mode & stat.S_ISVTX:
            raise NotPrivate(f"{folder}, which it is in, can be written by other users")
    return real


def _others_write(status: os.stat_result) -> bool:
    if status.st_mode & stat.S_IWOTH:
        return True
    return bool(status.st_mode & stat.S_IWGRP) and not _is_own_group(status.st_gid)


def _is_own_group(number: int) -> bool:
    """Whether a group has this user as its only member, as many systems create for each user."""
    import grp
    import pwd

    try:
        group, user = grp.getgrgid(number), pwd.getpwuid(os.geteuid())
    except KeyError:
        return False
    own = (group.gr_gid, group.gr_name) == (user.pw_gid, user.pw_name)
    return own and set(group.gr_mem) <= {user.pw_name}


def read(path: Path) -> bytes | None:
    """Return the content of a plain file that this user alone can read and write, else None."""
    try:
        handle = os.open(path, _READ | _BINARY)
    except OSError:
        return None
    try:
        if not _is_ours(os.fstat(handle)):
            return None
        with os.fdopen(handle, "rb", closefd=False) as file:
            return file.read()
    except OSError:
        return None
    finally:
        os.close(handle)


def _is_ours(status: os.stat_result) -> bool:
    if not hasattr(os, "geteuid"):
        return stat.S_ISREG(status.st_mode)
    owned = status.st_uid == os.geteuid() and not status.st_mode & ANYBODY_ELSE
    return stat.S_ISREG(status.st_mode) and owned


def write(path: Path, content: bytes) -> None:
    """Write `content` to a file, whole or not at all. Raises `OSError`."""
    new = path.with_name(NEW + secrets.token_hex(8))
    handle = os.open(new, _WRITE | _BINARY, stat.S_IRUSR | stat.S_IWUSR)
    try:
        with os.fdopen(handle, "wb") as file:
            file.write(content)
        os.replace(new, path)
    except BaseException:
        new.unlink(missing_ok=True)
        raise


def remove_abandoned(folder: Path) -> None:
    """Remove the files of writers that were killed."""
    for new in folder.glob(NEW + "*"):
        with contextlib.suppress(OSError):
            if time.time() - new.lstat().st_mtime > ABANDONED:
                new.unlink()
