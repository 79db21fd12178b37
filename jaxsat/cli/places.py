"""Output paths, checked before any computation."""

import contextlib
import os
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

from jaxsat.cli.terminal import UserMistake

if TYPE_CHECKING:
    from jaxsat.store.folder import OutputFolder


class _EndOfTrial(Exception):
    """End of a folder that was opened only as a trial."""


def try_folder(open_folder: "Callable[[], OutputFolder]") -> None:
    """Raise `OutputError` now for a folder that could not be written later."""

    with contextlib.suppress(_EndOfTrial), open_folder():
        raise _EndOfTrial


def refuse_nested(first: tuple[str, Path], second: tuple[str, Path]) -> None:
    """Raise `UserMistake` where one of two places is the other or is inside it."""
    (one, here), (other, there) = (
        (name, Path(os.path.realpath(path))) for name, path in (first, second)
    )
    if here.is_relative_to(there) or there.is_relative_to(here):
        raise UserMistake(f"{one} and {other}: must be apart from each other, got {here}, {there}")
