"""Flight code: the controller of a sampled loop as C99, with test vectors and build files."""

from jaxsat.compiler.lowering import CannotLower
from jaxsat.core.errors import LibraryError
from jaxsat.flight.external import Library, with_library
from jaxsat.flight.files import Export, Request, export
from jaxsat.flight.flight import CannotExport
from jaxsat.flight.templates import is_built

__all__ = [
    "CannotExport",
    "CannotLower",
    "Export",
    "Library",
    "LibraryError",
    "Request",
    "export",
    "is_built",
    "with_library",
]
