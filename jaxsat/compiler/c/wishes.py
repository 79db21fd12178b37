"""What values of a program are called in Python."""

from jaxsat.compiler.c.naming import assigned_name, identifier
from jaxsat.compiler.ir import Scalar, Value
from jaxsat.compiler.trace import Element, Frame, Trace


def element_of(trace: Trace, value: Value) -> Element | None:
    """The array's element that a value is, if it was computed by the statement that made that."""
    found, places = trace.elements.get(value.number), trace.places.get(value.number, ())
    if found is None or not places or not found.place:
        return None
    here, there = places[-1], found.place[-1]
    same = here.function == there.function and here.file == there.file
    if same and assigned_name(here.file, here.line) == assigned_name(there.file, there.line):
        return found
    return None


def wish_of(frames: tuple[Frame, ...]) -> str:
    """The name that Python has for what is computed at a place."""
    for frame in reversed(frames):
        name = assigned_name(frame.file, frame.line) or frame.function.split(".")[-1]
        if not name.startswith("<"):
            return identifier(name)
    return "x"


def name_of(trace: Trace, x: Scalar, otherwise: str) -> str:
    """The Python name of the array that a value is the first element of."""
    if not isinstance(x, Value):
        return otherwise
    if x.number in trace.names:
        return trace.names[x.number]
    element = element_of(trace, x)
    frames = element.place if element is not None else trace.places.get(x.number, ())
    return wish_of(frames) if frames else otherwise
