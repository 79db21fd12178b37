"""Python's search for dead cycles of objects, kept away from where it takes long for nothing."""

import gc
import threading
from collections.abc import Iterator
from contextlib import contextmanager

_switching = threading.Lock()


@contextmanager
def no_collection() -> Iterator[None]:
    """Without the search, which goes through all objects again and again while many are made."""
    with _switching:
        active = gc.isenabled()
        gc.disable()
    try:
        yield
    finally:
        if active:  # others inside are slower from here on, no more
            with _switching:
                gc.enable()
