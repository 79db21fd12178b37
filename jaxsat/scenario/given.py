"""What a scenario file gives, before it is checked."""

import tomllib
from collections.abc import Iterable
from pathlib import Path
from typing import Any

from jaxsat.scenario.limits import MAX_FILE_SIZE
from jaxsat.scenario.read import library


def given_keys(name_or_path: str | Path, overrides: Iterable[str] = ()) -> set[str]:
    """Dotted keys that a file and overrides give; none of a file that cannot be read."""
    return _keys(_parsed(name_or_path)) | {text.partition("=")[0].strip() for text in overrides}


def _parsed(name_or_path: str | Path) -> dict[str, Any]:
    """The file's tables; none where it cannot be read, which `load` tells."""
    known = library()
    try:
        if isinstance(name_or_path, str) and name_or_path in known:
            content = known[name_or_path].read_bytes()
        else:
            with Path(name_or_path).open("rb") as file:
                content = file.read(MAX_FILE_SIZE)
        return tomllib.loads(content.decode())
    except (OSError, ValueError, RecursionError):
        return {}


def _keys(data: Any, prefix: str = "") -> set[str]:
    """Dotted keys of all that is no table."""
    if not isinstance(data, dict):
        return {prefix.removesuffix(".")}
    return {key for name, value in data.items() for key in _keys(value, f"{prefix}{name}.")}
