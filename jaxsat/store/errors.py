"""What goes wrong with places to write to and to read from."""

import errno

from jaxsat.core.errors import JaxsatError

FAILURES = (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EFBIG)
"""System errors of a disk that is full or broken, which no other command would have avoided."""


class OutputError(JaxsatError):
    """A place that cannot be written or read; the message says why and what to do.

    `failure` is true where the disk failed, or another process is in the way, and false where
    something else should have been asked for. `elsewhere` is true where only versions or processor
    are others, which the argument `elsewhere` allows.
    """

    failure: bool
    elsewhere: bool

    def __init__(self, message: str, *, failure: bool = False, elsewhere: bool = False):
        super().__init__(message)
        self.failure = failure
        self.elsewhere = elsewhere


def system_failure(message: str, error: OSError) -> OutputError:
    """The system's error in our words; a failure if it is one of the disk."""
    return OutputError(message, failure=error.errno in FAILURES)


def reason(error: OSError) -> str:
    """What the system says, without the file."""
    return error.strerror or str(error)


def one_line(error: BaseException) -> str:
    """What an exception says, on one line and not at length."""
    text = " ".join(str(error).split()) or type(error).__name__
    return text if len(text) <= 200 else text[:199] + "…"
