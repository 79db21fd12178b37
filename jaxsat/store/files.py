"""Single files: written whole or not at all, durably, without following links.

All output of jaxsat goes through `write_file`. System errors become an `OutputError`.
"""

import contextlib
import errno
import hashlib
import json
import os
import secrets
import stat
from collections.abc import Iterable, Iterator, Sequence
from concurrent.futures import ThreadPoolExecutor
from pathlib import Path
from typing import Any

from jaxsat.core.errors import JaxsatError

FAILURES = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EFBIG)
"""System errors of a full or broken disk, which no other command would have avoided."""


class OutputError(JaxsatError):
    """A place that cannot be written or read; the message gives the reason and the remedy.

    `failure` is true for a failed disk or an interfering process, and false for a request that
    should be changed. `elsewhere` is true where only versions or processor differ, which the
    argument `elsewhere` allows.
    """

    failure: bool
    elsewhere: bool

    def __init__(self, message: str, *, failure: bool = False, elsewhere: bool = False):
        super().__init__(message)
        self.failure = failure
        self.elsewhere = elsewhere


def system_failure(path: str | Path, verb: str, error: OSError, more: str = "") -> OutputError:
    """Return the error that a place cannot be `verb` ("read", "written"), its reason, and `more`.

    The error is a failure if the system's error is one of the disk.
    """
    why = reason(error)
    if verb == "written" and error.errno == errno.ENOENT:  # the file need not exist yet
        folder = next(one for one in Path(os.path.abspath(path)).parents if one.is_dir())
        why = f"{folder} takes no new files"
    text = f"{path} cannot be {verb}: {why}.{more}"
    return OutputError(text, failure=error.errno in FAILURES)


@contextlib.contextmanager
def explained(path: str | Path, verb: str, more: str = "") -> Iterator[None]:
    """Convert an `OSError` into the `OutputError` of `system_failure`."""
    try:
        yield
    except OSError as error:
        raise system_failure(path, verb, error, more) from error


def reason(error: OSError) -> str:
    """Return the system's message without the file."""
    return error.strerror or str(error)


def one_line(error: BaseException) -> str:
    """Return an exception's message on one line, shortened."""
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 200 else text[:199] + "…"


WRITERS = 8
"""Number of files written at once: most of the time is spent waiting for the disk."""

_PLAIN = getattr(os, "O_BINARY", 0) | getattr(os, "O_NOFOLLOW", 0)
_NEW = os.O_WRONLY | os.O_CREAT | os.O_EXCL | _PLAIN
_READ = os.O_RDONLY | getattr(os, "O_NONBLOCK", 0) | _PLAIN  # a pipe must not block
_ABSENT = (errno.ENOENT, errno.ENOTDIR, errno.ELOOP, errno.EISDIR, errno.ENXIO)
_NO_HARD_LINKS = (errno.EPERM, errno.ENOTSUP, errno.EOPNOTSUPP, errno.ENOSYS, errno.EMLINK)


def new_token() -> str:
    """Return an unpredictable token that makes a partial file's name unique."""
    return secrets.token_hex(8)


def partial_name(token: str) -> str:
    """Return the name of a file during writing, in the folder of the final file."""
    return f".jaxsat-{token}.partial"


def content_hash(data: bytes, place: str = "") -> str:
    """Return a hash of a content and, if given, of its place."""
    return hashlib.blake2b(place.encode() + b"\0" + data, digest_size=16).hexdigest()


Content = str | bytes | Iterable[bytes]
"""Content of a file; pieces are written as they come."""


def write_file(
    path: Path,
    content: Content,
    *,
    replace: bool = True,
    durable: bool = True,
    partial: Path | None = None,
) -> None:
    """Write a file in one step: a new file, beside it or at `partial`, is renamed to `path`.

    Without `replace` an existing file is kept and `FileExistsError` raised. `durable` waits
    until file and folder are on disk. A symbolic link is replaced, never followed. Raises
    `OSError`, with the previous state kept.
    """
    data = content.encode() if isinstance(content, str) else content
    pieces = (data,) if isinstance(data, bytes) else data
    if partial is None:
        partial = path.with_name(partial_name(new_token()))
    handle = os.open(partial, _NEW, 0o666)
    try:
        with os.fdopen(handle, "wb") as file:
            file.writelines(pieces)
            if durable:
                file.flush()
                os.fsync(file.fileno())
        if replace:
            partial.replace(path)
        else:
            _put_beside(partial, path)
    except BaseException:
        partial.unlink(missing_ok=True)
        raise
    if durable:
        sync_folder(path.parent)


def read_file(path: Path) -> bytes | None:
    """Return the content of a plain file; None for a link, a folder, a pipe or a missing file."""
    try:
        handle = os.open(path, _READ)
    except OSError as error:
        if error.errno in _ABSENT:
            return None
        raise
    if not stat.S_ISREG(os.fstat(handle).st_mode):
        os.close(handle)
        return None
    with os.fdopen(handle, "rb") as file:
        return file.read()


def read_or_explain(path: Path) -> bytes | None:
    """Return the content of a plain file, None for a missing one.

    Raises `OutputError` where the system cannot read it.
    """
    with explained(path, "read"):
        return read_file(path)


def save_file(
    path: str | Path, content: Content, *, overwrite: bool = False, option: str = "--out"
) -> None:
    """Write a file that a user named; raises `OutputError`, also for one that exists.

    `overwrite` replaces it, through symbolic links, if it is a file. Messages name the `option`
    for another file.
    """
    refuse_existing(path, overwrite=overwrite, option=option)
    target = Path(os.path.realpath(path))
    with explained(path, "written"):
        try:
            write_file(target, content, replace=overwrite)
        except FileExistsError:
            raise OutputError(_already_there(path, option)) from None


def refuse_existing(path: str | Path, *, overwrite: bool, option: str = "--out") -> None:
    """Raise `OutputError` where `save_file` would, as far as that is known beforehand."""
    target = Path(os.path.realpath(path))
    if os.path.lexists(target):
        if not target.is_file():
            raise OutputError(f"{path} is not a file; give another one with {option}.")
        if not overwrite:
            raise OutputError(_already_there(path, option))
    elif not target.parent.is_dir():
        raise OutputError(f"{path} cannot be written: {target.parent} is not a folder.")


def parse_json(content: bytes | None) -> Any:
    """Return the data in a JSON file; None for invalid content."""
    try:
        return None if content is None else json.loads(content)
    except (ValueError, RecursionError):
        return None


def sync_file(path: Path) -> None:
    """Wait until a file or folder is on disk."""
    handle = os.open(path, os.O_RDONLY | _PLAIN)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def sync_files(paths: Sequence[Path]) -> None:
    """Wait until some files, and their names in their folders, are on disk, all at once."""
    with ThreadPoolExecutor(WRITERS, thread_name_prefix="jaxsat-sync") as pool:
        list(pool.map(sync_file, paths))
        list(pool.map(sync_folder, {path.parent for path in paths}))


def sync_folder(path: Path) -> None:
    """Wait until the names in a folder are on disk, where the system supports it."""
    if os.name == "posix":
        with contextlib.suppress(PermissionError):  # a writable folder need not be readable
            sync_file(path)


def _put_beside(partial: Path, path: Path) -> None:
    """Give a new file its name unless the name exists."""
    try:
        os.link(partial, path)
    except OSError as error:
        if error.errno not in _NO_HARD_LINKS:
            raise
        if os.path.lexists(path):
            raise FileExistsError(errno.EEXIST, os.strerror(errno.EEXIST)) from None
        partial.rename(path)
    else:
        partial.unlink()


def _already_there(path: str | Path, option: str) -> str:
    return f"{path} already exists; give --overwrite to replace it, or another file with {option}."
