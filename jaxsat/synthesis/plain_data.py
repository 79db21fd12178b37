"""Conversion of results to plain data for records and documents."""

from typing import Any

import numpy as np


def plain_data(value: Any) -> Any:
    """Convert nested results to plain data for JSON; numbers that are not finite become None."""
    if isinstance(value, dict):
        return {str(key): plain_data(entry) for key, entry in value.items()}
    if hasattr(value, "_asdict"):
        return plain_data(value._asdict())
    if isinstance(value, np.ndarray):
        return plain_data(value.tolist())
    if isinstance(value, list | tuple):
        return [plain_data(entry) for entry in value]
    if isinstance(value, np.generic):
        return plain_data(value.item())
    if isinstance(value, float) and not np.isfinite(value):
        return None
    return value
