"""The class that all errors of jaxsat derive from, and those that need no other import."""

import sys


class JaxsatError(Exception):
    """An error of jaxsat's own; the message says what happened and what to do.

    Errors are told apart by their classes and attributes. A wrong argument of a function raises
    `ValueError` or `TypeError` as it does anywhere in Python, often an `ArgumentError`.

    >>> import jaxsat
    >>> try:
    ...     jaxsat.load("no-such-scenario")
    ... except jaxsat.JaxsatError as error:
    ...     print(type(error).__name__)
    ScenarioError
    """

    failure: bool = False
    """Whether something failed although it was rightly asked for, such as a full disk."""


def foreign_exceptions() -> tuple[type[BaseException], ...]:
    """What an `except` clause catches of code that is not jaxsat's: all but what a signal raised.

    So also `SystemExit`, which is no success here, and what derives from `BaseException` alone, as
    panics of libraries in Rust do. An `except` clause calls it while the exception is on its way.
    """
    return () if isinstance(sys.exc_info()[1], KeyboardInterrupt) else (BaseException,)


class ArgumentError(JaxsatError, ValueError):
    """An argument that breaks a rule: "Argument `argument` must …, but got …."

    `rule` is "must …" and `got` what follows "got", None where the value need not be shown.

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
        """The message: which argument breaks which rule, and what it got."""
        ending = "" if self.got is None else f", but got {self.got}"
        return f"Argument `{self.argument}` {self.rule}{ending}."


class PrecisionError(JaxsatError, RuntimeError):
    """JAX is set to 32-bit floats, in which no scenario is built."""


class LibraryError(JaxsatError):
    """A library of flight code that is none, or that belongs to another controller."""
