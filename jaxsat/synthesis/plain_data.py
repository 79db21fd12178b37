"""Conversion of results to plain data for records and documents."""

import dataclasses
import json
from typing import Any

import numpy as np

from jaxsat.core.package_files import text_of
from jaxsat.store.provenance import record_of
from jaxsat.store.resumable import ResumableFolder


def plain_data(value: Any) -> Any:
    """Convert nested results to plain data for JSON; numbers that are not finite become None.

    A result becomes what its `as_data` returns or, without that, its fields by name.
    """
    if hasattr(value, "as_data"):
        return plain_data(value.as_data())
    if isinstance(value, dict):
        return {str(key): plain_data(entry) for key, entry in value.items()}
    if hasattr(value, "_asdict"):
        return plain_data(value._asdict())
    if dataclasses.is_dataclass(value):
        return plain_data(vars(value))
    if isinstance(value, np.ndarray):
        return plain_data(value.tolist())
    if isinstance(value, list | tuple):
        return [plain_data(entry) for entry in value]
    if isinstance(value, np.generic):
        return plain_data(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value


def write_record(folder: ResumableFolder, package: str, name: str, result: Any) -> dict[str, Any]:
    """Write the record of a result with its JSON Schema, a file of the `package`; return it."""
    record, schema = record_of(plain_data(result)), f"{name}.schema.json"
    folder.write(f"{name}.json", json.dumps(record, indent=1, ensure_ascii=False) + "\n")
    folder.write(schema, text_of(package, schema))
    return record
