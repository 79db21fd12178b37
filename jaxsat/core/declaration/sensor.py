"""How a sensor with a table of its own declares itself."""

import pkgutil
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

from jaxsat.core.declaration.keys import PartDeclaration


@dataclass(frozen=True, kw_only=True)
class SensorDeclaration(PartDeclaration):
    """A sensor of a sampled law with a table of its own.

    - `name`: of its table `[name]`.
    - `meaning`: one line, for the schema.
    - `place`: the attribute of a sampled loop where it stands.
    - `maker`: "module:Class.method" of the function that makes it of a checked table and a
      `SensorContext`. Nothing is imported before it is used.
    """

    name: str
    meaning: str
    place: str
    maker: str

    def made(self, table: Mapping[str, Any], context: Any) -> Any:
        """The sensor of a checked table in a `SensorContext`."""
        return pkgutil.resolve_name(self.maker)(table, context)
