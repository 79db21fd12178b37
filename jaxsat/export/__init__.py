"""Flight code: the controller of a sampled loop as C99, with test vectors and build files."""

from jaxsat.compiler.lowering import CannotLower
from jaxsat.core.errors import LibraryError
from jaxsat.export.external import Library, with_library
from jaxsat.export.files import Export, Request, export
from jaxsat.export.flight import CannotExport
from jaxsat.export.templates import is_built

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
