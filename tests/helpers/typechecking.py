"""Every call of jaxsat checked against its annotations, shapes of arrays among them.

`jaxtyped` binds the arguments of every call to relate their shapes, which would take a third of all
tests' time. Functions without a shape in their annotations need only beartype. The compiler is left
to the static checks: it has no shapes, and calls by the million.
"""

from typing import Any, get_args

import jaxtyping
from beartype import BeartypeConf, beartype

_with_shapes = jaxtyping.jaxtyped
_types_alone = beartype(conf=BeartypeConf(violation_type=TypeError))


def install() -> None:
    """Check all modules of jaxsat that are imported from now on."""
    jaxtyping.jaxtyped = _checked
    jaxtyping.install_import_hook("jaxsat", "beartype.beartype")


def _checked(*, typechecker: Any) -> Any:
    def decorate(part: Any) -> Any:
        if part.__module__.startswith(("jaxsat.compiler", "jaxsat.simulation.engine.native")):
            return part
        if isinstance(part, type) or not hasattr(part, "__annotations__"):
            return _with_shapes(part, typechecker=typechecker)
        hints = list(part.__annotations__.values())
        if any(map(_has_shape, hints)):
            return _with_shapes(part, typechecker=typechecker)
        return _types_alone(part) if hints else part

    return decorate


def _has_shape(hint: Any) -> bool:
    if isinstance(hint, list):  # the arguments of a callable
        return any(map(_has_shape, hint))
    if isinstance(hint, str):  # may be anything
        return True
    place = getattr(hint, "__module__", "") or ""
    return place.startswith("jaxtyping") or any(map(_has_shape, get_args(hint)))
