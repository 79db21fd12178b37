"""The entry point, defined before any slow import: signals and exit statuses."""

import gc
import os
import signal
import sys
import threading
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, nullcontext
from typing import NoReturn

from jaxsat.cli.progress import showing_progress
from jaxsat.cli.terminal import Terminated, finish, make_streams_safe, print_stderr

SIGNALS = [
    getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)
]


def main(tokens: Sequence[str] | None = None) -> None:
    """Run the command line and exit with a status of docs/scenarios.md."""
    if tokens is None:  # a process of its own, with unchanged code
        gc.disable()  # until `interruptibly` starts long work
        os.environ.setdefault("JAXSAT_KEPT_KERNELS", "1")
        os.environ |= {"MATPLOTLIBRC": os.devnull, "MPLBACKEND": "agg"}  # the user's may be damaged
    with _signals_as_exceptions() as received:
        try:
            with _no_exit_unsaid():
                status = _status(tokens, received)
        except KeyboardInterrupt:  # a second one during the report of the first
            status = _signal_status(received)
        if received:
            os._exit(status)  # a computation may still hold a thread
    if tokens is None:
        gc.freeze()  # otherwise Python's exit would collect garbage once more
    sys.exit(status)


def _status(tokens: Sequence[str] | None, received: list[int]) -> int:
    try:
        make_streams_safe()
        words = sys.argv[1:] if tokens is None else tokens
        with nullcontext() if "--quiet" in words else showing_progress("starting"):
            from jaxsat.cli.app import run

            return finish(run(tokens))
    except KeyboardInterrupt as stop:
        word = "terminated" if isinstance(stop, Terminated) else "interrupted"
        print_stderr(f"{word}; {stop.args[0] if stop.args else 'nothing was written'}")
        return _signal_status(received)


@contextmanager
def _no_exit_unsaid() -> Iterator[None]:
    """Make `os._exit` raise `SystemExit`, as `sys.exit` does, inside the `with` block.

    Otherwise a user's own code could end a command with status 0 unreported. Forked processes still
    end by it.
    """
    end, process = os._exit, os.getpid()

    def exit_or_raise(status: int) -> NoReturn:
        if os.getpid() != process:
            end(status)
        raise SystemExit(f"os._exit({status})")

    os._exit = exit_or_raise
    try:
        yield
    finally:
        os._exit = end


def _signal_status(received: Sequence[int]) -> int:
    return 128 + (received[0] if received else signal.SIGINT)


@contextmanager
def _signals_as_exceptions() -> Iterator[list[int]]:
    """Convert signals to exceptions, and list them; a third one ends the process at once.

    A signal that is ignored from the start, as under `nohup`, stays ignored.
    """
    received: list[int] = []
    end = os._exit

    def handle(number: int, frame: object) -> None:
        received.append(number)
        if len(received) > 2:
            end(_signal_status(received))
        raise KeyboardInterrupt if number == signal.SIGINT else Terminated

    before = {}
    if threading.current_thread() is threading.main_thread():
        for number in SIGNALS:
            if signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, handle)
    try:
        yield received
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
