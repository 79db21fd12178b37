"""Whether parts that do not come with jaxsat give what a loop needs, found out by tracing them."""

import inspect
from collections.abc import Callable, Mapping
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxsat.assembly.errors import BuildError
from jaxsat.control import AbstractController, AbstractSampledController
from jaxsat.declaration.laws import Law
from jaxsat.dynamics import PlantState
from jaxsat.scenario.errors import Issue, Location
from jaxsat.scenario.plugins import Part, place_in

Controller = AbstractController | AbstractSampledController


def require_runs(law: Law, controller: Controller, start: PlantState) -> None:
    """Raise `BuildError` where the law, run once, raises or gives arrays of other shapes.

    Nothing is computed: JAX traces the law with the shapes of the start.
    """
    try:
        memory = eqx.filter_eval_shape(controller.init, start)
        command, following = eqx.filter_eval_shape(_once, controller, start)
        eqx.filter_eval_shape(_rest, controller, start)
    except Exception as error:
        raise BuildError(broken(law, error)) from error
    wanted = (law.declaration.torques or 2,)
    shape = getattr(command, "shape", None)
    if shape != wanted:
        found = f"one of shape {shape}" if shape is not None else type(command).__name__
        raise BuildError(_issue(law, f"commands an array of shape {wanted}, got {found}"))
    if _kinds(memory) != _kinds(following):
        raise BuildError(
            _issue(
                law,
                f"keeps its memory's structure, got {_told(memory)} from `init` and "
                f"{_told(following)} from a run",
            )
        )


def broken(law: Law, error: Exception, wanted: str = "can be run") -> Issue:
    """What an exception of the law's own code is told as."""
    return _issue(law, f"{wanted}, got {_of_their_code(law.controller, error)}")


def made_part(part: Part, location: Location, values: Mapping[str, Any], context: Any) -> Any:
    """A disturbance or actuators of a checked table; raises `BuildError` where it makes none."""
    try:
        made = part.made.from_table(values, context)
    except Exception as error:
        message = f"can be built, got {_of_their_code(part.made, error)}"
        raise BuildError(_about(part, location, message)) from error
    if not isinstance(made, part.made):
        message = f"is made by its `from_table`, got {type(made).__name__}"
        raise BuildError(_about(part, location, message))
    return made


def require_torque(part: Part, location: Location, torque: Callable[..., Any], *given: Any) -> None:
    """Raise `BuildError` where a part, called once, raises or gives no torque of shape (3,)."""
    try:
        found = eqx.filter_eval_shape(torque, *given)
    except Exception as error:
        message = f"can be run, got {_of_their_code(part.made, error)}"
        raise BuildError(_about(part, location, message)) from error
    shape = getattr(found, "shape", None)
    if shape != (3,):
        what = f"one of shape {shape}" if shape is not None else type(found).__name__
        message = f"gives an array of shape (3,), a torque in N m, got {what}"
        raise BuildError(_about(part, location, message))


def _of_their_code(made: type, error: Exception) -> str:
    text = str(error).strip().split("\n", 1)[0]
    return f"{type(error).__name__}: {text}{place_in(inspect.getfile(made), error)}"


def _about(part: Part, location: Location, message: str) -> Issue:
    return Issue(location, f'must be such that "{part.name}" {message}')


def _once(controller: Controller, start: PlantState) -> Any:
    t = jnp.zeros(())
    memory = controller.init(start)
    if isinstance(controller, AbstractSampledController):
        return controller.step(t, start, memory)
    return controller(t, start, memory)


def _rest(controller: Controller, start: PlantState) -> Any:
    """What a loop asks of a law besides its torque."""
    memory = controller.init(start)
    if isinstance(controller, AbstractSampledController):
        return controller.rate_error(start, memory), controller.mode(memory)
    none = jnp.zeros(2)
    return (
        controller.rate_error(start),
        controller.lyapunov(start, memory, none, none),
        controller.event_functions(start),
    )


def _kinds(tree: Any) -> Any:
    shapes = [(leaf.shape, leaf.dtype) for leaf in jax.tree.leaves(eqx.filter(tree, _is_array))]
    return shapes, jax.tree.structure(tree)


def _is_array(leaf: Any) -> bool:
    return isinstance(leaf, jax.Array | jax.ShapeDtypeStruct)


def _told(tree: Any) -> str:
    return eqx.tree_pformat(tree, short_arrays=True).replace("\n", " ")[:200]


def _issue(law: Law, message: str) -> Issue:
    return Issue(("control", "law"), f'must be such that the law "{law.name}" {message}')
