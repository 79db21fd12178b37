"""Where a dask scheduler is to be found: its address, or the JSON file that it wrote."""

import json
import os
import re
import stat
import time
from pathlib import Path

MAX_FILE_SIZE = 1_000_000
"""Bytes of a scheduler's file that are read; such a file has about a thousand."""

FLUSHED_S = 1.0
"""How long a scheduler may take to write its file in full."""

EXAMPLE = "tcp://host:8786"
ADDRESS = re.compile(r"[a-z][a-z0-9+.-]*://\S+|[^\s/]+:[0-9]+")
"""With any protocol that dask knows, or without one."""


def scheduler_address(place: str, timeout: float) -> str:
    """The address of the scheduler at `place`, which is an address or a scheduler's file.

    A file that is not there yet is waited for, `timeout` seconds. Raises `ValueError` where there
    is none then, or where there is something else.
    """
    if not os.path.exists(place):
        if ADDRESS.fullmatch(place):
            return place
        if not place.endswith(".json"):
            raise ValueError(
                f"A scheduler must be an address such as {EXAMPLE} or the JSON file that it "
                f"wrote, but got {place!r}."
            )
    begun = time.monotonic()
    while True:
        try:
            return _address_in(Path(place))
        except FileNotFoundError:
            limit, reason = timeout, f"there is none after {timeout:g} s"
        except json.JSONDecodeError as error:
            limit, reason = FLUSHED_S, f"it must be JSON, but {error}"
        except (OSError, ValueError) as error:
            limit, reason = 0.0, getattr(error, "strerror", None) or str(error)
        if time.monotonic() - begun >= limit:
            raise ValueError(f"The scheduler's file {place!r} cannot be used: {reason}.")
        time.sleep(0.1)


def _address_in(path: Path) -> str:
    if not stat.S_ISREG(path.stat().st_mode):
        raise ValueError("it must be a regular file")
    with path.open("rb") as file:
        content = file.read(MAX_FILE_SIZE + 1)
    if len(content) > MAX_FILE_SIZE:
        raise ValueError(f"it must be of at most {MAX_FILE_SIZE} bytes")
    try:
        found = json.loads(content.decode())
    except json.JSONDecodeError:
        raise
    except (RecursionError, ValueError):  # nested too deeply; bytes that are no text; long numbers
        raise ValueError("it must be the JSON that a scheduler wrote") from None
    address = found.get("address") if isinstance(found, dict) else None
    if not isinstance(address, str) or not ADDRESS.fullmatch(address):
        raise ValueError(f"it must have the key `address` with a text such as {EXAMPLE}")
    return address
