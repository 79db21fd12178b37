"""Base class of all errors of jaxsat, and errors that need no other import."""

import sys


class JaxsatError(Exception):
    """Base class of jaxsat's errors; the message describes the problem and its remedy.

    Errors are distinguished by class and attributes. A wrong argument of a function raises
    `ValueError` or `TypeError` as anywhere in Python, often an `ArgumentError`.

    >>> import jaxsat
    >>> try:
    ...     jaxsat.load("no-such-scenario")
    ... except jaxsat.JaxsatError as error:
    ...     print(type(error).__name__)
    ScenarioError
    """

    failure: bool = False
    """Whether a valid request failed, for example for a full disk."""


def foreign_exceptions() -> tuple[type[BaseException], ...]:
    """Return the exceptions that an `except` clause catches from foreign code: all but interrupts.

    This includes `SystemExit`, which is no success here, and classes that derive from
    `BaseException` alone, such as panics of Rust libraries. Call it in the `except` clause itself,
    while the exception is being handled.
    """
    return () if isinstance(sys.exc_info()[1], KeyboardInterrupt) else (BaseException,)


class ArgumentError(JaxsatError, ValueError):
    """An argument that breaks a rule: "Argument `argument` must …, but got …."

    `rule` is "must …" and `got` the text after "got", None where the value need not be shown.

    >>> import jaxsat
    >>> try:
    ...     jaxsat.Spacecraft([1.0, 2.0, float("nan")])
    ... except jaxsat.ArgumentError as error:
    ...     print(error.argument, error.rule)
    inertia must be finite
    """

    argument: str
    rule: str
    got: str | None

    def __init__(self, argument: str, rule: str, got: object = None):
        self.argument, self.rule = argument, rule
        self.got = None if got is None else str(got)
        super().__init__(argument, rule, self.got)

    def __str__(self) -> str:
        """Return the message: the argument, the broken rule, and the value."""
        ending = "" if self.got is None else f", but got {self.got}"
        return f"Argument `{self.argument}` {self.rule}{ending}."


class PrecisionError(JaxsatError, RuntimeError):
    """JAX is set to 32-bit floats, in which no scenario is built."""


class LibraryError(JaxsatError):
    """An invalid library of flight code, or one of another controller."""
