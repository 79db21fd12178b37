"""The class that all errors of jaxsat derive from."""


class JaxsatError(Exception):
    """An error of jaxsat's own; the message says what happened and what to do.

    Errors are told apart by their classes and attributes. A wrong argument of a function raises
    `ValueError` or `TypeError` as it does anywhere in Python.

    >>> import jaxsat
    >>> try:
    ...     jaxsat.load("no-such-scenario")
    ... except jaxsat.JaxsatError as error:
    ...     print(type(error).__name__)
    ScenarioError
    """
