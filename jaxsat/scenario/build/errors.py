"""Scenarios whose numbers, each right in itself, make no object of the core."""

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
    """What a scenario asks for cannot be built; `issue` says which key is to blame and why."""

    issue: Issue

    def __init__(self, issue: Issue):
        super().__init__(f"Key {key_of(issue.location)} {issue.message}.")
        self.issue = issue


@contextlib.contextmanager
def at_key(key: str) -> Iterator[None]:
    """Blame this dotted key for what the constructors inside refuse: `BuildError`."""
    try:
        with np.errstate(all="ignore"):  # what comes of it is looked at
            yield
    except BuildError:
        raise
    except (ValueError, ArithmeticError) as error:
        reason = str(error).rstrip(".")
        message = f"must be something that can be built, got numbers of which jaxsat says: {reason}"
        raise BuildError(Issue(tuple(key.split(".")), message)) from error


def made_of_numbers(instance: Instance) -> Instance:
    """Return the object as it is; raises `ValueError` where a number in it is NaN."""
    for leaf in jax.tree.leaves(eqx.filter(instance, eqx.is_inexact_array)):
        if np.isnan(np.asarray(leaf)).any():
            raise ValueError(f"a number of {type(instance).__name__} is NaN")
    return instance
