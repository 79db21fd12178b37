"""Trial of effectors of packages and of their steering: results, and what their failures change."""

import dataclasses
from collections.abc import Iterable, Sequence
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxsat.core.array_types import BoolScalar, IntScalar
from jaxsat.scenario.build.errors import BuildError
from jaxsat.scenario.build.plugin_trial import (
    array_kinds,
    at_code_of,
    is_own,
    place_of_method,
    shapes_text,
)
from jaxsat.scenario.errors import Issue
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.effector import AbstractEffector
from jaxsat.spacecraft.steering import AbstractSteering


def require_acts(effectors: Iterable[AbstractEffector], start: PlantState) -> None:
    """Raise `BuildError` if a package's effector, called once, raises or returns other shapes.

    So does one whose failures change more than its pieces.
    """
    for one, state in zip(effectors, start.of_each, strict=True):
        if is_own(type(one)):
            continue
        with at_code_of(type(one), (one.kind,)):
            torque, rate = eqx.filter_eval_shape(_act, one, start, state)
        if torque.shape != (3,):
            _refuse_of(one, "effect", "gives a torque of shape (3,)", torque.shape)
        if array_kinds(rate) != array_kinds(state):
            rule = f"gives the rate of its state, {shapes_text(state)}"
            _refuse_of(one, "derivative", rule, shapes_text(rate))
        for kind in () if one.failures is None else one.failures.kinds:
            with at_code_of(type(one), (one.kind,)):
                alike = eqx.filter_jit(_keeps_failure_in_piece)(one, start, state, jnp.array(kind))
            if not alike:
                rule = "puts all that a failure changes into the piece"
                _refuse_of(one, "driven", rule, f'another effect of "{kind.text}" without it')


def _act(one: AbstractEffector, start: PlantState, state: Any) -> tuple[Any, Any]:
    """Torque, and rate of the state, at rest without failures and under the command for zero."""
    struck = jnp.zeros(one.failure_times.shape, bool)
    driven, command = one.driven(state, one.idle(), struck)
    return _motion(driven, driven.piece(driven.mode(state), command), start, state)


def _motion(one: AbstractEffector, piece: Any, start: PlantState, state: Any) -> tuple[Any, Any]:
    torque = one.effect(piece, jnp.zeros(()), start, state).torque
    return torque, one.derivative(piece, start, state, jnp.zeros(3))


def _keeps_failure_in_piece(
    one: AbstractEffector, start: PlantState, state: Any, kind: IntScalar
) -> BoolScalar:
    """Whether an effector with all devices half failed moves alike before and after `driven`."""
    whole = jnp.ones(one.failures.count)
    broken = dataclasses.replace(one.failures, kind=kind * whole, amount=0.5 * whole)
    one = eqx.tree_at(lambda x: x.failures, one, broken)
    state = jax.tree.map(lambda x: x + 0.1, state)
    driven, command = one.driven(state, one.idle() + 0.1, whole > 0)
    piece = driven.piece(driven.mode(state), command)
    pairs = zip(
        jax.tree.leaves(_motion(one, piece, start, state)),
        jax.tree.leaves(_motion(driven, piece, start, state)),
        strict=True,
    )
    return jnp.all(jnp.stack([_alike(x, y) for x, y in pairs]))


def _alike(x: Any, y: Any) -> BoolScalar:
    """Whether arrays are equal up to round-off of their largest element."""
    largest = jnp.max(jnp.nan_to_num(jnp.abs(x)), initial=0.0)
    return jnp.allclose(x, y, atol=1e-9 * largest, equal_nan=True)


def require_steered(
    steering: Iterable[AbstractSteering], effectors: Sequence[AbstractEffector], start: PlantState
) -> None:
    """Raise `BuildError` if a package's steering, called once, raises or returns other shapes."""
    sizes = {one.kind: one.command_size for one in effectors}
    for one in steering:
        if is_own(type(one)):
            continue
        with at_code_of(type(one), (one.kind,)):
            outcome = eqx.filter_eval_shape(one, jnp.zeros(()), start, jnp.zeros(3))
        shapes = ((sizes[one.kind],), (3,))
        actual = tuple(getattr(value, "shape", None) for value in jax.tree.leaves(outcome))
        if actual != shapes:
            _refuse_of(one, "__call__", f"gives arrays of shapes {shapes}", actual)


def _refuse_of(one: AbstractEffector | AbstractSteering, method: str, rule: str, got: Any) -> None:
    place = place_of_method(type(one), method)
    message = f'must be such that its "{type(one).__name__}" {rule}{place}, got {got}'
    raise BuildError(Issue((one.kind,), message))
