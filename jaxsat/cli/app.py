"""The entry point: commands, exit statuses and interruption."""

import os
import signal
import sys
from collections.abc import Sequence

from cyclopts import App, CycloptsError, UnusedCliTokensError

import jaxsat
from jaxsat.cli.bound import bound
from jaxsat.cli.compare import compare
from jaxsat.cli.controllability import controllability
from jaxsat.cli.montecarlo import montecarlo
from jaxsat.cli.reproduce import reproduce
from jaxsat.cli.scenarios import scenarios
from jaxsat.cli.simulate import simulate
from jaxsat.cli.terminal import (
    FAILED_RUN,
    INTERRUPTED,
    TERMINATED,
    USER_MISTAKE,
    FailedRun,
    Terminated,
    UserMistake,
    make_streams_safe,
    report,
    report_mistake,
    warnings_as_lines,
)
from jaxsat.cli.tune import tune
from jaxsat.collection import no_collection

app = App(
    name="jaxsat",
    version=jaxsat.__version__,
    help="Simulate and tune spacecraft that have lost thrusters.",
    help_format="plaintext",
    suppress_keyboard_interrupt=False,
)
app.command(simulate)
app.command(montecarlo)
app.command(compare)
app.command(bound)
app.command(tune)
app.command(controllability)
app.command(reproduce)
app.command(scenarios)


def main(tokens: Sequence[str] | None = None) -> None:
    """Run the command line and exit with one of the statuses of `jaxsat.cli.terminal`."""
    make_streams_safe()
    signal.signal(signal.SIGTERM, _raise_terminated)
    with no_collection(), warnings_as_lines():
        status = _status(tokens)
    try:
        sys.stdout.flush()
    except BrokenPipeError:
        _silence_stdout()
    if status in (INTERRUPTED, TERMINATED):
        os._exit(status)  # a computation may still hold a thread
    sys.exit(status)


def _status(tokens: Sequence[str] | None) -> int:
    try:
        result = app(
            tokens,
            exit_on_error=False,
            print_error=False,
            result_action="return_value",
        )
    except UnusedCliTokensError as mistake:
        extra = " ".join(mistake.unused_tokens or ())
        report(f"must be given without {extra} (each KEY=VALUE follows a --set of its own)")
        return USER_MISTAKE
    except CycloptsError as mistake:
        report(f"{mistake}\nsee `jaxsat --help` and `jaxsat COMMAND --help`")
        return USER_MISTAKE
    except UserMistake as mistake:
        report_mistake(mistake)
        return USER_MISTAKE
    except FailedRun as failure:
        report(str(failure))
        return FAILED_RUN
    except KeyboardInterrupt as stop:
        report(f"interrupted; {stop.args[0] if stop.args else 'nothing was written'}")
        return INTERRUPTED
    except Terminated as stop:
        report(f"terminated; {stop.args[0] if stop.args else 'nothing was written'}")
        return TERMINATED
    except BrokenPipeError:
        _silence_stdout()
        return 0
    return result if isinstance(result, int) else 0


def _raise_terminated(number: int, frame: object) -> None:
    del number, frame
    raise Terminated


def _silence_stdout() -> None:
    """Whoever read the output has gone: what is left of it goes nowhere, without complaint."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
