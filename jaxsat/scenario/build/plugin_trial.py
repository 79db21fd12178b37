"""Trial of plug-ins by tracing: whether their results suit the loop."""

import contextlib
import inspect
from collections.abc import Callable, Iterator
from operator import attrgetter
from typing import Any

import equinox as eqx
import jax
import jax.numpy as jnp

from jaxsat.control.controller import AbstractController, AbstractFeedbackLaw
from jaxsat.control.navigation.estimator import AbstractEstimator, Estimate, Measurement
from jaxsat.control.sampled import AbstractSampledController
from jaxsat.core.array_types import RealScalar
from jaxsat.core.attitude import Quaternion
from jaxsat.core.declaration.laws import Law
from jaxsat.core.errors import foreign_exceptions
from jaxsat.scenario.build.errors import BuildError
from jaxsat.scenario.errors import Issue, Location
from jaxsat.scenario.parts.named import PartTable
from jaxsat.scenario.plugins import Part, place_in
from jaxsat.scenario.quantities import values_of
from jaxsat.spacecraft.actuators import AbstractActuators
from jaxsat.spacecraft.dynamics import PlantState
from jaxsat.spacecraft.environment.sensed_vectors import AbstractSensedVector

Controller = AbstractController | AbstractSampledController
LAW = ("control", "law")


def require_runs(law: Law, controller: Controller, start: PlantState) -> None:
    """Raise `BuildError` if the law, run once, raises or returns arrays of other shapes.

    Nothing is computed: JAX traces the law with the shapes of the start.
    """
    _require_arrays(law, LAW, controller)
    _require_tunable(law, controller)
    with sound(law, LAW, law.controller):
        memory = eqx.filter_eval_shape(controller.init, start)
        outcome = eqx.filter_eval_shape(_run, controller, start)
        answers = eqx.filter_eval_shape(_answers, controller, start)
    method = _method(controller)
    if not (isinstance(outcome, tuple) and len(outcome) == 2):
        what = "its next memory" if law.declaration.sampled else "the rate of its memory"
        _refuse(law, LAW, f"gives two things from `{method}`, the torque and {what}", outcome)
    place = place_of_method(law.controller, method)
    _require_shape(law, LAW, outcome[0], (law.declaration.torques or 2,), f"commands {{}}{place}")
    for name, (value, shape) in answers.items():
        place = place_of_method(law.controller, name)
        _require_shape(law, LAW, value, shape, f"gives {{}} from `{name}`{place}")
    _require_same_memory(law, LAW, memory, outcome[1], method)


def sound(
    part: Law | Part, location: Location, part_class: type, rule: str = "can be run"
) -> contextlib.AbstractContextManager[None]:
    """Convert exceptions in a part's own code inside this context to a `BuildError`."""
    keys = ", ".join(key.name for key in part.declaration.keys)
    return _converted(part_class, location, f"{_name_of(part)} {rule}", keys)


def at_code_of(
    part_class: type, location: Location, rule: str = "can be run"
) -> contextlib.AbstractContextManager[None]:
    """Convert exceptions in this context to a `BuildError` if another package has the class."""
    if is_own(part_class):
        return contextlib.nullcontext()
    return _converted(part_class, location, f'its "{part_class.__name__}" {rule}')


@contextlib.contextmanager
def _converted(
    part_class: type, location: Location, rule: str, keys: str | None = None
) -> Iterator[None]:
    """Convert exceptions to a `BuildError`; `keys` are those that the class has declared."""
    try:
        yield
    except BuildError:
        raise
    except foreign_exceptions() as error:
        text = str(error).strip().split("\n", 1)[0]
        hint = ""
        if isinstance(error, jax.errors.ConcretizationTypeError):
            hint = (
                "; use jnp.where in place of `if`, and functions of jnp in place of those of math"
            )
        elif isinstance(error, jax.errors.TracerArrayConversionError):
            hint = "; use functions of jnp in place of those of numpy"
        elif isinstance(error, KeyError) and keys is not None:
            hint = f"; the declared keys are {keys}"
        place = place_in(inspect.getfile(part_class), error)
        message = f"must be such that {rule}, got {type(error).__name__}: {text}{hint}{place}"
        raise BuildError(Issue(location, message)) from error


def is_own(part_class: type) -> bool:
    """Whether a class is one of jaxsat's."""
    return part_class.__module__.partition(".")[0] == "jaxsat"


def made_part(part: Part, location: Location, table: PartTable, context: Any) -> Any:
    """Build a part by `from_table` from a checked table; raises `BuildError` if this fails."""
    with sound(part, location, part.made, "can be built"):
        instance = part.made.from_table(values_of(part.declaration.keys, table), context)
    if not isinstance(instance, part.made):
        _refuse(part, location, "is made by its `from_table`", instance)
    _require_arrays(part, location, instance)
    return instance


def require_torque(
    part: Part, location: Location, torque: Callable[..., Any], *arguments: Any
) -> None:
    """Raise `BuildError` if a part, called once, raises or returns no torque of shape (3,)."""
    with sound(part, location, part.made):
        value = eqx.filter_eval_shape(torque, *arguments)
    place = place_of_method(part.made, "__call__")
    _require_shape(part, location, value, (3,), f"gives {{}}, a torque in N m{place}")


def require_vector(part: Part, location: Location, vector: AbstractSensedVector) -> None:
    """Raise `BuildError` if a sensed vector, called once, raises or returns other shapes."""
    t = jnp.zeros(())
    with sound(part, location, part.made):
        outcome = eqx.filter_eval_shape(vector, t)
        ideal = eqx.filter_eval_shape(vector.distorted, t, jnp.zeros(3))
    place = place_of_method(part.made, "__call__")
    if not (isinstance(outcome, tuple) and len(outcome) == 2):
        _refuse(part, location, f"gives a vector and its visibility{place}", outcome)
    _require_shape(part, location, outcome[0], (3,), f"gives {{}}, a vector{place}")
    _require_shape(part, location, outcome[1], (), f"gives {{}}, a visibility{place}")
    place = place_of_method(part.made, "distorted")
    _require_shape(part, location, ideal, (3,), f"gives {{}} from `distorted`{place}")


def require_estimates(
    part: Part,
    location: Location,
    estimator: AbstractEstimator,
    period: RealScalar,
    measurement: Measurement,
) -> None:
    """Raise `BuildError` if an estimator, called once, raises or returns no estimate.

    Its memory must have the same shapes and types after a step.
    """
    zero = jnp.zeros_like(period)
    upright = Quaternion(jnp.eye(4, dtype=zero.dtype)[0])
    with sound(part, location, part.made):
        memory = eqx.filter_eval_shape(estimator.init, upright, zero)
        outcome = eqx.filter_eval_shape(estimator.step, jnp.array(0), period, measurement, memory)
    place = place_of_method(part.made, "step")
    if not (isinstance(outcome, tuple) and len(outcome) == 2 and isinstance(outcome[0], Estimate)):
        _refuse(part, location, f"gives an `Estimate` and the memory from `step`{place}", outcome)
    estimate, after = outcome
    attitude = estimate.attitude
    if not isinstance(attitude, Quaternion):
        _refuse(part, location, f"estimates an attitude that is a `Quaternion`{place}", attitude)
    estimates = {"attitude": (attitude.q, (4,)), "omega": (estimate.omega, (3,))}
    others = {name: getattr(estimate, name) for name in Estimate._fields[2:]}
    sensors = len(measurement.vectors) + (measurement.attitude is not None)
    sizes = {"innovation": sensors, "excluded": sensors}
    estimates |= {
        name: (value, (sizes.get(name, 3),)) for name, value in others.items() if value is not None
    }
    for name, (value, shape) in estimates.items():
        _require_shape(part, location, value, shape, f"estimates {{}} as `{name}`{place}")
    _require_same_memory(part, location, memory, after, "step")


def require_events(
    part: Part, location: Location, actuators: AbstractActuators, *arguments: Any
) -> None:
    """Raise `BuildError` unless actuators have `event_count` event functions."""
    with sound(part, location, part.made):
        count = actuators.event_count
        values = eqx.filter_eval_shape(actuators.event_functions, *arguments)
        piece = actuators.smooth_piece(jnp.ones(count, bool))
    rule = "gives {} from `event_functions`, as `event_count` says"
    _require_shape(
        part, location, values, (count,), rule + place_of_method(part.made, "event_functions")
    )
    require_torque(part, location, piece, *arguments)


def _run(controller: Controller, start: PlantState) -> Any:
    t, memory = jnp.zeros(()), controller.init(start)
    if isinstance(controller, AbstractSampledController):
        return controller.step(t, start, memory)
    return controller(t, start, memory)


def _method(controller: Controller) -> str:
    if isinstance(controller, AbstractSampledController):
        return "step"
    return "torque" if isinstance(controller, AbstractFeedbackLaw) else "__call__"


def _answers(controller: Controller, start: PlantState) -> dict[str, tuple[Any, tuple]]:
    """Results of a law's methods other than its torque, by method, with their required shapes.

    The number of event functions is the law's own.
    """
    memory = controller.init(start)
    if isinstance(controller, AbstractSampledController):
        return {
            "rate_error": (controller.rate_error(start, memory), (2,)),
            "mode": (controller.mode(memory), ()),
        }
    none = jnp.zeros(2)
    events = controller.event_functions(start)
    controller.smooth_piece(jnp.ones(jnp.shape(events), bool))(jnp.zeros(()), start, memory)
    return {
        "rate_error": (controller.rate_error(start), (2,)),
        "lyapunov": (controller.lyapunov(start, memory, none, none), ()),
        "event_functions": (events, jnp.shape(events)[:1] or (0,)),
    }


def _require_arrays(part: Law | Part, location: Location, instance: Any) -> None:
    """Raise `BuildError` for attributes that are neither arrays nor declared static."""
    for path, leaf in jax.tree_util.tree_flatten_with_path(instance)[0]:
        if not eqx.is_array_like(leaf):
            name = jax.tree_util.keystr(path).lstrip(".")
            message = f"holds arrays and numbers, got {leaf!r} in `{name}`"
            cure = "; declare the attribute with `= equinox.field(static=True)`"
            raise BuildError(_issue(part, location, message[:200] + cure))


def _require_same_memory(
    part: Law | Part, location: Location, first: Any, after: Any, method: str
) -> None:
    if array_kinds(first) != array_kinds(after):
        message = "keeps a memory of arrays of the same shapes and types, "
        message += f"got {shapes_text(first)} from `init` and {shapes_text(after)} from `{method}`"
        raise BuildError(_issue(part, location, message))


def _require_tunable(law: Law, controller: Controller) -> None:
    for key, place in law.declaration.tunable.items():
        try:
            attrgetter(place)(controller)
        except AttributeError:
            message = (
                f'has an attribute `{place}`, as its key {key} is tunable (tunable="name" gives '
                "another name), got none"
            )
            raise BuildError(_issue(law, LAW, message)) from None


def _require_shape(
    part: Law | Part, location: Location, value: Any, shape: tuple[int, ...], rule: str
) -> None:
    if getattr(value, "shape", None) != shape:
        _refuse(part, location, rule.format(f"an array of shape {shape}"), value)


def _refuse(part: Law | Part, location: Location, rule: str, value: Any) -> None:
    shape = getattr(value, "shape", None)
    got = f"one of shape {shape}" if shape is not None else type(value).__name__
    raise BuildError(_issue(part, location, f"{rule}, got {got}"))


def place_of_method(part_class: type, method: str) -> str:
    """File and line of a method of a part, " (file:12)", or empty."""
    try:
        function = inspect.unwrap(getattr(part_class, method))
        return f" ({inspect.getfile(function)}:{inspect.getsourcelines(function)[1]})"
    except (OSError, TypeError):
        return ""


def array_kinds(tree: Any) -> Any:
    """Return shapes and types of the arrays of a tree, and its structure."""
    shapes = [(leaf.shape, leaf.dtype) for leaf in jax.tree.leaves(tree) if _is_array(leaf)]
    return shapes, jax.tree.structure(tree)


def _is_array(leaf: Any) -> bool:
    return isinstance(leaf, jax.Array | jax.ShapeDtypeStruct)


def shapes_text(tree: Any) -> str:
    """Return types and shapes of the leaves of a tree as text."""
    leaves = [
        f"{leaf.dtype} {leaf.shape}" if _is_array(leaf) else f"the number {leaf!r}"
        for leaf in jax.tree.leaves(tree)
    ]
    return (" and ".join(leaves) or "nothing")[:200]


def _issue(part: Law | Part, location: Location, message: str) -> Issue:
    return Issue(location, f"must be such that {_name_of(part)} {message}")


def _name_of(part: Law | Part) -> str:
    return f'the law "{part.name}"' if isinstance(part, Law) else f'"{part.name}"'
