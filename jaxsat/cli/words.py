"""The command line as the user typed it."""

import shlex
import sys

from jaxsat.core.text import clean


def command_line() -> str:
    """The command for a record of what was done, in characters that every file can hold."""
    return clean(shlex.join(["jaxsat", *sys.argv[1:]]))
