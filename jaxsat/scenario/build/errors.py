"""Errors of scenarios whose values, each valid by itself, make no valid object of the core."""

import contextlib
from collections.abc import Iterator
from typing import TypeVar

import equinox as eqx
import jax
import numpy as np
from jaxtyping import PyTree

from jaxsat.core.errors import JaxsatError
from jaxsat.scenario.errors import Issue, key_of

Instance = TypeVar("Instance", bound=PyTree)


class BuildError(JaxsatError, ValueError):
    """A scenario that cannot be built; `issue` names the key and the reason."""

    issue: Issue

    def __init__(self, issue: Issue):
        super().__init__(f"Key {key_of(issue.location)} {issue.message}.")
        self.issue = issue


@contextlib.contextmanager
def at_key(key: str) -> Iterator[None]:
    """Convert errors of constructors inside this context to a `BuildError` at a dotted key."""
    try:
        with np.errstate(all="ignore"):  # invalid results are rejected later
            yield
    except BuildError:
        raise
    except (ValueError, ArithmeticError) as error:
        reason = str(error).rstrip(".")
        message = f"must be something that can be built, got numbers of which jaxsat says: {reason}"
        raise BuildError(Issue(tuple(key.split(".")), message)) from error


def made_of_numbers(instance: Instance) -> Instance:
    """Return the object unchanged; raises `ValueError` if a number in it is NaN."""
    for leaf in jax.tree.leaves(eqx.filter(instance, eqx.is_inexact_array)):
        if np.isnan(np.asarray(leaf)).any():
            raise ValueError(f"a number of {type(instance).__name__} is NaN")
    return instance
