"""The commands, and the handling of every exception that they raise."""

import contextlib
import sys
import warnings
from collections.abc import Sequence

from cyclopts import App, CycloptsError, UnusedCliTokensError

import jaxsat
from jaxsat.cli.bound import bound
from jaxsat.cli.bugs import ending_of, report_error, thread_errors_reported
from jaxsat.cli.compare import compare
from jaxsat.cli.completion import completion
from jaxsat.cli.computing import import_interruptibly
from jaxsat.cli.controllability import controllability
from jaxsat.cli.convert import convert
from jaxsat.cli.design import design
from jaxsat.cli.export import export
from jaxsat.cli.front import front
from jaxsat.cli.montecarlo import montecarlo
from jaxsat.cli.progress import stop_progress
from jaxsat.cli.report import report
from jaxsat.cli.reproduce import reproduce
from jaxsat.cli.scenarios import scenarios
from jaxsat.cli.simulate import simulate
from jaxsat.cli.terminal import (
    FAILED_RUN,
    SUCCESS,
    USER_MISTAKE,
    FailedRun,
    UserMistake,
    print_problems,
    print_stderr,
    print_warning,
)
from jaxsat.cli.tune import tune
from jaxsat.core.errors import JaxsatError
from jaxsat.core.numerals import at_least_digits
from jaxsat.core.process import no_collection

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
app.command(front)
app.command(tune)
app.command(design)
app.command(controllability)
app.command(export)
app.command(reproduce)
app.command(report)
app.command(convert)
app.command(scenarios)
app.command(completion)


def run(tokens: Sequence[str] | None = None) -> int:
    """Run one command; gives its exit status, whatever it raised, but for signals."""
    try:
        with no_collection(), thread_errors_reported(), warnings.catch_warnings():
            warnings.showwarning = _show_warning
            warnings.filterwarnings("ignore", "Glyph .* missing from font", UserWarning)
            return _command(tokens)
    except UnusedCliTokensError as mistake:
        extra = " ".join(mistake.unused_tokens or ())
        takes_overrides = "overrides" in getattr(mistake.target, "__annotations__", {})
        hint = " (each KEY=VALUE follows a --set of its own)" if takes_overrides else ""
        print_stderr(f"must be given without {extra}{hint}")
        return USER_MISTAKE
    except CycloptsError as mistake:
        print_stderr(f"{mistake}\nsee `jaxsat --help` and `jaxsat COMMAND --help`")
        return USER_MISTAKE
    except UserMistake as mistake:
        print_stderr(str(mistake))
        return USER_MISTAKE
    except FailedRun as failure:
        print_stderr(str(failure))
        return FAILED_RUN
    except SystemExit as ended:  # of code that is not jaxsat's; its status says nothing
        print_stderr(
            "control.law, a disturbance, actuators or an estimator: must be such that its code "
            f"returns, got {ending_of(ended)}"
        )
        return USER_MISTAKE
    except Exception as error:
        return _failure(error)


def _failure(error: Exception) -> int:
    """Tell of a scenario or results that cannot be used; all else is a mistake of jaxsat's."""
    if isinstance(error, JaxsatError):
        from jaxsat.scenario import ScenarioError

        if isinstance(error, ScenarioError):
            print_problems(error)
            return USER_MISTAKE
        from jaxsat.store import OutputError  # slow to import

        if isinstance(error, OutputError):
            print_stderr(f"{error}{' (--elsewhere)' if error.elsewhere else ''}")
            return FAILED_RUN if error.failure else USER_MISTAKE
    report_error(error)
    return FAILED_RUN


def _command(tokens: Sequence[str] | None) -> int:
    tokens = sys.argv[1:] if tokens is None else list(tokens)
    command, bound, _ = app.parse_args(tokens, exit_on_error=False, print_error=False)
    if any(getattr(options, "quiet", False) for options in bound.arguments.values()):
        stop_progress()
    if not command.__module__.startswith("jaxsat."):
        with contextlib.suppress(BrokenPipeError, SystemExit):  # of a reader who has seen enough
            command(*bound.args, **bound.kwargs)
        return SUCCESS
    computes = command.__module__ not in ("jaxsat.cli.scenarios", "jaxsat.cli.completion")
    import_interruptibly("jaxsat.scenario", *(["jaxsat.store"] if computes else []))
    digits = (getattr(options, "digits", None) for options in bound.arguments.values())
    with at_least_digits(next(filter(None, digits), None)):
        result = command(*bound.args, **bound.kwargs)
    return result if isinstance(result, int) else SUCCESS


def _show_warning(message: Warning | str, *place: object) -> None:
    del place  # in the source, which says nothing to a user
    print_warning(str(message))
