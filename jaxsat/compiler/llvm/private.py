"""Files that only this user can have written: a folder of our own, and how it is read and written.

On systems without owners and modes as POSIX has them (Windows) a folder is as private as its
place.
"""

import contextlib
import os
import secrets
import stat
import time
from pathlib import Path

ANYBODY_ELSE = stat.S_IRWXG | stat.S_IRWXO

NEW = ".new-"
"""How the names of files begin that are being written."""

ABANDONED = 3600.0
"""Seconds after which nobody writes such a file any more."""

_READ = os.O_RDONLY | getattr(os, "O_NOFOLLOW", 0) | getattr(os, "O_NONBLOCK", 0)
_WRITE = os.O_WRONLY | os.O_CREAT | os.O_EXCL | getattr(os, "O_NOFOLLOW", 0)
_BINARY = getattr(os, "O_BINARY", 0)


class NotPrivate(OSError):
    """A folder that others could have written to, or could put another one in the place of."""


def private_folder(path: Path) -> Path:
    """The real path of a folder of this user alone (mode 0700), which is made if need be.

    Raises `NotPrivate` where it is a link or belongs to or can be written by somebody else, or
    where somebody else could rename one of the folders it is in (which may be in a folder like
    /tmp, whose sticky bit forbids that), and `OSError` where it cannot be made.
    """
    for folder in (*reversed(path.parents), path):
        try:
            folder.mkdir(mode=stat.S_IRWXU)
        except OSError:
            if not folder.is_dir():
                raise
    real = path.parent.resolve() / path.name
    found = os.lstat(real)
    if not stat.S_ISDIR(found.st_mode):
        raise NotPrivate(f"{real} is not a folder")
    if not hasattr(os, "geteuid"):
        return real
    if found.st_uid != os.geteuid():
        raise NotPrivate(f"{real} belongs to another user")
    if _others_write(found):
        raise NotPrivate(f"{real} can be written by other users (chmod 700 would change that)")
    if found.st_mode & ANYBODY_ELSE:
        real.chmod(stat.S_IRWXU)
    for folder in real.parents:
        above = os.stat(folder)
        if above.st_uid not in (0, os.geteuid()):
            raise NotPrivate(f"{folder}, which it is in, belongs to another user")
        if _others_write(above) and not above.st_mode & stat.S_ISVTX:
            raise NotPrivate(f"{folder}, which it is in, can be written by other users")
    return real


def _others_write(found: os.stat_result) -> bool:
    if found.st_mode & stat.S_IWOTH:
        return True
    return bool(found.st_mode & stat.S_IWGRP) and not _is_own_group(found.st_gid)


def _is_own_group(number: int) -> bool:
    """Whether a group has this user as its one member, as many systems make one for each user."""
    import grp
    import pwd

    try:
        group, user = grp.getgrgid(number), pwd.getpwuid(os.geteuid())
    except KeyError:
        return False
    named = (group.gr_gid, group.gr_name) == (user.pw_gid, user.pw_name)
    return named and set(group.gr_mem) <= {user.pw_name}


def read(path: Path) -> bytes | None:
    """What a file holds; None unless it is a plain file that this user alone can read and write."""
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


def _is_ours(found: os.stat_result) -> bool:
    """Whether a file is a plain one that this user alone can read and write."""
    if not hasattr(os, "geteuid"):
        return stat.S_ISREG(found.st_mode)
    owned = found.st_uid == os.geteuid() and not found.st_mode & ANYBODY_ELSE
    return stat.S_ISREG(found.st_mode) and owned


def write(path: Path, content: bytes) -> None:
    """Let a file hold `content`: whole or not at all. Raises `OSError`."""
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
    """Remove what writers left that were killed."""
    for new in folder.glob(NEW + "*"):
        with contextlib.suppress(OSError):
            if time.time() - new.lstat().st_mtime > ABANDONED:
                new.unlink()
